"""What the search for laws of a user's system knows of held-out readings: folds like them, their inputs, refusals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.discover.blocks import FEWEST_BLOCKS, how_held
from straw.replay.diagnose.discover.choose import refusals
from straw.replay.diagnose.discover.discover import base_trial
from straw.replay.diagnose.discover.inline import Inline
from straw.replay.diagnose.discover.samples import to_predict
from straw.replay.diagnose.fit import evaluated, fitted
from straw.replay.diagnose.systems.function.least import least
from straw.replay.diagnose.systems.function.model import load_model
from straw.replay.diagnose.systems.function.read_recordings import recordings_of
from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.stack import Stacked
from straw.replay.diagnose.systems.function.system import FunctionSystem

CYLINDER = '''
"""A cylinder without friction."""
time = 20.0
inputs = {"p": ("p", "bar"), "s": ("s", "mm")}
channels = {"F": ("F", "N")}
constants = {"A": (40.0, "N/bar", 10.0, 100.0), "F0": (0.0, "N", -50.0, 50.0)}
places = ["channel:F"]
depends_on = ["the rate of s", "p"]

def shown(t, x, u, c):
    return c.A * u.p + c.F0
'''
DECAY = '''
"""A vessel that loses its pressure to another."""
time = "t"
inputs = {"q": ("q", "bar")}
channels = {"p": ("p", "bar")}
constants = {"k": (0.3, "1/s", 0.01, 3.0), "n": (1.0, "1", 0.2, 3.0)}
start = {"p": "p"}

def slopes(t, x, u, c):
    return -c.k * abs(x.p - u.q) ** c.n * (1.0 if x.p > u.q else -1.0)
'''
NOISE_N, FRICTION_N = 0.1, 6.0


def strokes(seed: int = 1) -> dict[str, dict[str, np.ndarray]]:
    """Three recordings of a cylinder with friction, at 1, 4 and 2.5 bar."""
    rng, t = np.random.default_rng(seed), np.arange(0, 12, 0.05)
    out = {}
    for k, bar in enumerate((1.0, 4.0, 2.5)):
        s, p = 40 * np.sin(1.3 * t), bar + 0.3 * np.sin(2.1 * t)
        force = 50 * p + FRICTION_N * np.tanh(np.gradient(s, t) / 3) + NOISE_N * rng.normal(size=len(t))
        out[f"run{k}"] = {"p": p, "s": s, "F": force}
    return out


def cylinder(folder: Path, tables: dict[str, dict[str, np.ndarray]], hold_out: Sequence[str] = ("run2",)):
    path = folder / "cylinder.py"
    path.write_text(CYLINDER)
    model = load_model(path)
    return FunctionSystem(model), recordings_of(model, {k: (k, v) for k, v in tables.items()}, hold_out)


def recording(name: str, held: np.ndarray) -> Recorded:
    n = len(held)
    t, one = np.arange(n) / 10, np.ones((1, n))
    return Recorded(name, t, one, np.zeros((0, n)), np.ones(1), ~held, ~held)


def test_folds_are_arranged_like_what_is_held_out():
    none, every = np.zeros(600, bool), np.ones(600, bool)
    whole = [recording(n, none) for n in "abc"] + [recording("d", every)]
    assert how_held(whole[:3], whole).lies == "recordings"
    # two recordings are not predicted one from the other: both are split into long blocks
    few = how_held(whole[:2], [*whole[:2], whole[3]])
    assert (few.lies, few.blocks) == ("between", FEWEST_BLOCKS)
    later = [recording("a", np.arange(600) >= 300)]
    assert how_held(later, later).lies == "after"
    for stretch in (10, 25):  # every other stretch of so many samples
        between = [recording("a", np.arange(600) // stretch % 2 == 1)]
        assert how_held(between, between).blocks == pytest.approx(300 / stretch, abs=1)


def test_a_constant_that_held_out_inputs_leave_undetermined_counts_against_a_model(tmp_path):
    tables = {name: table for name, table in strokes().items() if name != "run1"}
    system, recordings = cylinder(tmp_path, tables)
    fitted_ones = [one.without_held() for one in recordings if one.fitted.any()]
    near = base_trial(system, fitted_ones, to_predict(system, recordings))
    assert np.isnan(to_predict(system, recordings)[0].seen).sum() > 200  # its readings are not used
    far = {**tables, "run2": {**tables["run2"], "p": tables["run2"]["p"] + 20}}
    _, recordings = cylinder(tmp_path, far)
    farther = base_trial(system, fitted_ones, to_predict(system, recordings))
    # the area from pressures of 0.7 to 1.3 bar: its error grows with the distance from their mean
    assert farther.ahead / near.ahead == pytest.approx((21.5 / 1.5) ** 2, rel=0.2)
    assert farther.error.sum() == pytest.approx(near.error.sum())


def decays(folder: Path) -> tuple[FunctionSystem, list[Recorded]]:
    rng, t = np.random.default_rng(4), np.arange(0, 12, 0.02)
    path = folder / "vessel.py"
    path.write_text(DECAY)
    model = load_model(path)
    tables = {}
    for name, start in (("a", 3.0), ("b", 5.0)):
        p = (start**-0.5 + 0.5 * 0.1 * t) ** -2  # exponent 1.5
        tables[name] = name, {"t": t, "q": np.zeros_like(t), "p": p + 0.01 * rng.normal(size=len(t))}
    return replace(FunctionSystem(model), sigma=(0.01,)), recordings_of(model, tables)


def test_a_fit_of_stacked_recordings_ends_where_the_engines_does_and_finds_what_was_planted(tmp_path):
    system, recordings = decays(tmp_path)
    unknowns, pool = system.base, Inline()
    start = system.given()
    mine = least(Stacked(recordings, system, pool), unknowns, start, rounds=60, share=1e-9)
    other = fitted(Campaign(recordings, system, pool), unknowns, start, rounds=60, share=1e-9)
    np.testing.assert_allclose(mine.u, other.u, atol=2e-3)
    assert mine.cost == pytest.approx(other.cost, rel=1e-3)
    assert mine.values["constant.k"] == pytest.approx(0.1, rel=0.02)
    assert mine.values["constant.n"] == pytest.approx(1.5, rel=0.02)


def test_derivatives_are_those_of_the_residuals_with_starts_profiled_out(tmp_path):
    system, recordings = decays(tmp_path)
    campaign = Stacked(recordings, system, Inline())
    fit = least(campaign, system.base, system.given(), rounds=60, share=1e-9)
    slopes = evaluated(campaign, system.base, fit.u).slopes
    for k, h in enumerate(1e-3 * np.eye(len(fit.u))):
        above, below = campaign.residuals(system.base, [fit.u + h, fit.u - h])
        difference = (above - below) / 2e-3
        # robust weights and the weak prior of the starts enter the residuals only
        assert np.linalg.norm(slopes[:, k] - difference) < 0.05 * np.linalg.norm(difference)


def test_the_last_laws_are_refused_until_one_improves_what_was_held_out():
    def kept(*held: float) -> int:
        return len(held) - 1 - refusals([np.array([h]) for h in held])

    assert kept(8.0, 4.0, 1.0) == 2
    assert kept(8.0, 1.0, 1.2) == 1  # the second increases the error
    assert kept(8.0, 1.0, 0.99) == 1  # the second changes next to nothing
    assert kept(8.0, 9.0, 1.0) == 2  # the first alone does not help, both together do
    assert kept(8.0, 9.0, 8.5) == 0  # better than the first, worse than the base
    assert kept(8.0, 8.0) == 0
    assert kept(8.0) == 0


def test_a_law_that_makes_a_channel_that_was_held_out_worse_is_refused_however_much_another_gains():
    assert refusals([np.array([1.0, 9.0]), np.array([1.1, 3.0])]) == 0
    assert refusals([np.array([1.0, 9.0]), np.array([3.0, 3.0])]) == 1
