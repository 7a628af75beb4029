"""The search for laws of a user's system sees no held-out readings, which are used once: whole searches."""

from __future__ import annotations

import numpy as np

from straw.replay.diagnose.discover.discover import discover
from straw.replay.diagnose.discover.findings import SystemFindings
from straw.replay.diagnose.discover.inline import Inline
from straw.replay.diagnose.discover.page import page
from straw.replay.diagnose.discover.said import text
from tests.replay.test_discover_blind import NOISE_N, cylinder, strokes


def test_held_out_readings_do_not_change_which_law_is_chosen_only_whether_it_is_accepted(tmp_path):
    tables = strokes()
    system, recordings = cylinder(tmp_path, tables)
    found = discover(system, recordings, executor=Inline())
    assert not found.refused
    assert found.best.laws[0].says == "the reading of F, over the rate of s"
    assert found.held[-1][0] < 1.3 * NOISE_N < found.held[0][0] / 10

    noise = np.random.default_rng(0).normal(0, 200, len(tables["run2"]["F"]))
    other = {**tables, "run2": {**tables["run2"], "F": noise}}
    blind = discover(*cylinder(tmp_path, other), executor=Inline())
    np.testing.assert_array_equal(blind.chosen[-1].fit.u, found.chosen[-1].fit.u)
    assert [law.says for law in blind.chosen[-1].laws] == [law.says for law in found.best.laws]

    # a law without effect in what is held out is refused, and nothing is claimed
    t = np.arange(0, 12, 0.05)
    without = 50 * tables["run2"]["p"] + NOISE_N * np.random.default_rng(2).normal(size=len(t))
    system, recordings = cylinder(tmp_path, {**tables, "run2": {**tables["run2"], "F": without}})
    refused = discover(system, recordings, executor=Inline())
    findings = SystemFindings(refused, tuple(recordings))
    assert refused.refused
    assert (findings.verdict, findings.laws) == ("unknown_physics", [])
    assert findings.as_json()["refused"] == [law.says for law in refused.chosen[-1].laws]
    assert findings.says.startswith(
        "Located, not explained: what is missing shows most in the reading of F, over the rate"
    )
    assert len(refused.held) == 1
    assert "refused" in text(findings)
    assert "and refused: " in page(findings)
