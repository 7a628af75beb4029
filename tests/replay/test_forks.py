"""Runs in which repeats of a straw take two ways, against an apparatus that shares no code with the model."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.contest import Contestant
from straw.replay.diagnose.findings import _doubts
from straw.replay.diagnose.forks import _calm, _fork, forks
from straw.replay.diagnose.hypothesis import base_unknowns
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import NOISE_LEAVES, run_by_run, unexplained
from straw.replay.diagnose.misfit import Misfit
from straw.replay.diagnose.observation import observe
from straw.replay.diagnose.search import Fit, descend
from straw.replay.diagnose.stages import until_they_fork
from tests.apparatus.campaign import NONE, SCATTER, campaign, drawn
from tests.apparatus.effects import Cause
from tests.apparatus.straw import Straw

BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)
#: A straw whose repeats fork in one run, by 73 sigma (`repeat_sigma`), and differ by at most 2 in the others.
FORKS, RUNS = 101, ("fold-25kPa", "deploy-35kPa-2", "staircase", "deploy-35kPa-3")


def known(straw: Straw) -> StrawParameters:
    """The model's constants of a straw of the apparatus."""
    usual, base = Straw(), StrawParameters()
    zeta = np.array(base.zeta0_m) * [straw.zeta_odd_m / usual.zeta_odd_m, straw.zeta_even_m / usual.zeta_even_m]
    return base.replace(
        r_ch_m=straw.laws["R_CH"],
        c_zeta_n_s_per_m=straw.c_zeta,
        c_phi_n_m_s_per_rad=straw.c_phi,
        E_pa=np.asarray(base.E_pa) * straw.young_pa / usual.young_pa,
        h_m=np.asarray(base.h_m) * straw.thickness_m / usual.thickness_m,
        zeta0_m=zeta,
    )


def test_a_run_that_went_one_of_two_ways_is_looked_at_until_they_part() -> None:
    straw = drawn(FORKS, 0, SCATTER)
    runs = [observe(run) for run in campaign((), FORKS, RUNS, SCATTER, straw=straw)]
    unknowns = base_unknowns(known(straw))
    with ThreadPoolExecutor(2) as pool:
        whole = Campaign(runs, known(straw), pool)
        fit = descend(whole, unknowns, np.zeros(len(unknowns)), rounds=0)
        *others, forked = run_by_run(whole, fit)
        assert forked > 100 * max(*others, NOISE_LEAVES)
        ends = forks(whole, fit)
        assert list(ends) == ["deploy-35kPa-3"]
        assert ends["deploy-35kPa-3"] < runs[-1].snaps_s[0]
        rows = whole.seen_until(ends)
        whole.look_until(ends)
        seen = descend(whole, unknowns, fit.u, rounds=0)
        assert unexplained(whole, seen) < NOISE_LEAVES
    # which of the differences before are still seen: of the other runs all
    assert len(rows) == len(seen.residual) < len(fit.residual)
    whole_runs = sum(3 * len(run.time_s) + len(run.snaps_s) + 1 for run in runs[:-1])
    np.testing.assert_array_equal(rows[:whole_runs], np.arange(whole_runs))
    np.testing.assert_allclose(seen.residual[:-1], fit.residual[rows][:-1], atol=0.1)


def test_when_a_run_forks_every_hypothesis_is_seen_again_without_what_came_after_and_a_note_says_so() -> None:
    straw = drawn(FORKS, 0, SCATTER)
    runs = [observe(run) for run in campaign((), FORKS, RUNS[1:], SCATTER, straw=straw)]
    base = base_unknowns(known(straw))
    with ThreadPoolExecutor(2) as pool:
        whole = Campaign(runs, known(straw), pool)
        wide = whole.only(RUNS[2:]).roughly()
        null = descend(whole, base, np.zeros(len(base)), rounds=0)
        what = whole.hypothesis(["tip_offset"])
        one = descend(whole, (*base, *what.unknowns), np.append(null.u, 0.0), rounds=0)
        # what was only seen in outlines has slopes of another length, which stay as they are
        outlined = replace(one, slopes=one.slopes[:5])
        singles = {"tip_offset": Contestant(what, one), "camera_roll": Contestant(what, outlined)}
        found = Inquiry(whole, null, singles)
        done = {"tip_offset": one.cost}
        until_they_fork(found, wide, done)
        left = unexplained(whole, found.null)
    assert list(found.forked) == ["deploy-35kPa-3"]
    assert left < NOISE_LEAVES < unexplained(Campaign(runs, BASE, pool), null)
    for fit in (found.null, *(c.fit for c in found.singles.values())):
        assert len(fit.residual) == sum(whole.size(o) for o in whole.observations) < len(null.residual)
    assert done["tip_offset"] == found.singles["tip_offset"].cost < one.cost
    assert found.singles["camera_roll"].fit.slopes is outlined.slopes
    assert wide.observations[-1].end_s == whole.observations[-1].end_s < runs[-1].end_s
    (note,) = [note for note in _doubts(found) if "two ways" in note]
    assert note.startswith("run deploy-35kPa-3 is looked at until 0.")


def test_a_search_that_is_stopped_asks_no_run_whether_it_forks() -> None:
    run = observe(campaign((), 3, RUNS[2:3], NONE)[0])
    with ThreadPoolExecutor(1) as pool:
        whole = Campaign([run], BASE, pool, stop=lambda: True)
        null = descend(whole, (), np.zeros(0), rounds=0)
        played = whole.tally["played"]
        until_they_fork(Inquiry(whole, null), whole, {})
    assert whole.tally["played"] == played


def test_a_run_in_which_a_cause_acts_is_not_taken_for_a_fork() -> None:
    plain = campaign((), 3, RUNS[:3], NONE)
    (weak,) = campaign((Cause("frustum_spread", 0.1, "all cells differ", 5),), 3, RUNS[3:], NONE)
    runs = [observe(run) for run in (*plain, weak)]
    unknowns = base_unknowns(BASE)
    with ThreadPoolExecutor(2) as pool:
        whole = Campaign(runs, BASE, pool)
        fit = descend(whole, unknowns, np.zeros(len(unknowns)), rounds=0)
        *others, acted = run_by_run(whole, fit)
        assert acted > 10 * max(*others, NOISE_LEAVES)
        assert forks(whole, fit) == {}


@pytest.mark.parametrize(("share", "forked"), [(1.0, True), (0.5, False)])
def test_a_run_forks_where_a_repeat_explains_nearly_all_of_it_though_little_lies_between_the_two(
    share: float, forked: bool
) -> None:
    time_s, noise = np.arange(0, 4, 1 / 240), np.random.default_rng(0).normal(size=(3, 960))
    burst = 6.0 * ((time_s > 2.0) & (time_s < 2.5))
    run = SimpleNamespace(
        name="deploy", time_s=time_s, snaps_s=np.array([1.0]), sigma=lambda _late_s: np.ones((3, 960))
    )

    def misfits(_unknowns: object, points: list[np.ndarray]) -> list[list[Misfit]]:
        ways = [1.0, 1 - share, *[1.0] * (len(points) - 2)]  # of all repeats one goes another way
        late = np.zeros(1)
        return [[Misfit(noise + way * burst, np.zeros(2), late, np.zeros((3, 960)), 0)] for way in ways]

    one = cast(Campaign, SimpleNamespace(observations=[run], misfits=misfits))
    base = base_unknowns(BASE)
    fit = Fit(base, np.zeros(len(base)), np.zeros(1), np.zeros((1, len(base))), 0.0, True)
    at = _fork(one, fit)
    assert (at == pytest.approx(1.95, abs=0.02)) if forked else at is None


def test_a_run_ends_where_it_is_calm() -> None:
    assert _calm(1.0, [0.5, 1.5]) == 1.0
    assert _calm(1.0, [0.5, 0.97, 1.02]) == pytest.approx(0.92, abs=1e-3)
    assert _calm(1.0, [0.9, 0.97]) == pytest.approx(0.85, abs=1e-3)  # where that is near another snap, before that


def test_a_run_looked_at_until_a_moment_shows_nothing_of_what_came_after() -> None:
    run = observe(campaign((), 3, ("fold-25kPa",), NONE)[0])
    end_s = float(run.snaps_s[1:3].mean())
    part = run.until(end_s)
    assert part.time_s[-1] == pytest.approx(end_s, abs=1 / 240 + 1e-9)
    assert part.end_s == part.time_s[-1]
    np.testing.assert_array_equal(part.snaps_s, run.snaps_s[:2])
    for name in ("tip", "at_rest", "rate"):
        np.testing.assert_array_equal(getattr(part, name), getattr(run, name)[:, : len(part.time_s)])
    assert part.outline.size < run.outline.size
