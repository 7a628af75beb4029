"""Which runs are looked at first."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np

from straw.replay.diagnose.observation import Observation
from straw.replay.diagnose.start import FAR_OFF, few_of


def _run(name: str, deployed: tuple[int, ...], snaps: int) -> Observation:
    run = SimpleNamespace(initial_deployed=deployed)
    tip = np.array([[0.0, 1e-3 * snaps]])
    return cast(Observation, SimpleNamespace(name=name, run=run, snaps_s=np.arange(snaps), tip=tip))


RUNS = [
    _run("fold", (1, 4), 4),
    _run("deploy-1", (), 4),
    _run("deploy-2", (), 3),
    _run("fold-other", (2, 5), 4),
    _run("deploy-with-6", (6,), 2),
    _run("deploy-with-7", (7,), 2),
    _run("staircase", (3,), 0),
]


def test_the_most_telling_runs_of_different_starts_and_one_without_a_snap_are_looked_at() -> None:
    assert sorted(few_of(RUNS, [0.0] * len(RUNS))) == ["deploy-1", "fold", "fold-other", "staircase"]


def test_a_start_that_only_shows_what_is_unexplained_is_looked_at_too_and_no_second_repeat() -> None:
    left = dict.fromkeys((run.name for run in RUNS), 0.0)
    left |= {"deploy-2": 9 * FAR_OFF, "deploy-with-6": 2 * FAR_OFF, "deploy-with-7": 3 * FAR_OFF}
    assert few_of(RUNS, list(left.values()))[4:] == ["deploy-with-7"]
    left |= {"deploy-with-6": FAR_OFF / 2, "deploy-with-7": FAR_OFF / 3}
    assert few_of(RUNS, list(left.values()))[4:] == []
