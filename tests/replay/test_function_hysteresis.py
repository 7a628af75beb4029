"""Hysteresis in a user's system: a gradual play is that of its equation, and a spring that slips is found as one."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from straw.replay.diagnose.discover.discover import discover
from straw.replay.diagnose.discover.findings import SystemFindings
from straw.replay.diagnose.discover.said import counted
from straw.replay.diagnose.discover.screen import candidates
from straw.replay.diagnose.systems.function.codes import CHANNEL, RATE
from straw.replay.diagnose.systems.function.model import load_model
from straw.replay.diagnose.systems.function.passed import passed
from straw.replay.diagnose.systems.function.read_recordings import recordings_of
from straw.replay.diagnose.systems.function.shapes import PLAY, YIELDS
from straw.replay.diagnose.systems.function.system import FunctionSystem
from tests.benchmarks.planted.hysteresis import STAGE

INTEGRATOR = '''
"""A carriage that is driven."""
time = "t"
inputs = {"v": ("v", "mm/s")}
channels = {"s": ("s", "mm")}
constants = {"g": (1.0, "1", 0.5, 2.0)}
start = {"s": "s"}
units = {"s": "mm"}
hold_out = ["b"]

def slopes(t, x, u, c):
    return c.g * u.v
'''
#: The stage's true constants: mass, damping and spring, and the stiffness and the greatest force of its friction.
M, C, K, STIFF, MOST = 1.5, 12.0, 60.0, 900.0, 3.0


def written(folder: Path, text: str) -> FunctionSystem:
    path = folder / "system.py"
    path.write_text(text)
    return FunctionSystem(load_model(path))


@pytest.mark.parametrize("longest_s", [np.inf, 0.003])
def test_a_gradual_play_follows_its_equation_there_and_back_whatever_the_step(tmp_path, longest_s):
    """Dahl: dz/ds = 1 - z / w forwards, 1 + z / w backwards, both exponentials in the way."""
    system = written(tmp_path, INTEGRATOR)
    t, w = np.linspace(0, 4, 401), 0.3
    v = np.where(t <= 2, 1.0, -1.0)
    v[200] = 0.0  # so that the integral of straight pieces is the way there and back
    s = np.where(t <= 2, t, 4 - t) - 0.005 * np.clip((t - 1.99) / 0.01, 0, 1)
    table = {"t": t, "v": v, "s": s}
    recordings = recordings_of(system.model, {name: (name, table) for name in "ab"})
    seen = passed(system, recordings, {})
    law = next(x for x in candidates(system, seen) if x.shape == PLAY and x.place.kind == CHANNEL)
    finer = replace(system.with_laws(replace(law, shape=YIELDS)), longest_s=longest_s)
    shown = finer.played(recordings[0], {"law.0.strength": 1.0, "law.0.play": w}, np.zeros(1))[0][0]
    top = s.max()
    there = w * (1 - np.exp(-s / w))
    turned = w * (1 - np.exp(-top / w))
    back = -w + (turned + w) * np.exp(-(top - s) / w)
    ahead = np.where(t <= 2, there, back)
    # a straight piece across the turn hides up to half a sample's way
    assert shown == pytest.approx(s - ahead, abs=0.005)
    assert np.max(np.abs(shown - s)) == pytest.approx(turned, abs=0.005)


def test_a_spring_that_slips_is_found_with_its_stiffness_and_its_greatest_force(tmp_path):
    """By another integrator than the diagnosis has, from Dahl's equation for the force."""
    system, tables, rng = written(tmp_path, STAGE), {}, np.random.default_rng(3)
    t = np.arange(0, 6, 0.02)
    for name, size in (("run 1", 14.0), ("run 2", 11.0), ("run 3", 8.0)):
        phases = rng.uniform(0, 6, 3)
        f = size * np.sum([np.sin(w * t + p) for w, p in zip((2.1, 5.3, 9.7), phases, strict=True)], axis=0) / 1.7

        def rates(s: float, y: np.ndarray, f: np.ndarray = f) -> list[float]:
            force = float(np.interp(s, t, f)) - C * y[1] - K * y[0] - y[2]
            return [y[1], force / M, STIFF * (y[1] - abs(y[1]) * y[2] / MOST)]

        x = solve_ivp(rates, (0, t[-1]), [0.0, 0.0, 0.0], t_eval=t, rtol=1e-8, atol=1e-10, max_step=0.005).y[0]
        tables[name] = name, {"t": t, "f": f, "x": x + rng.normal(0, 2e-4, len(t))}
    recordings = recordings_of(system.model, tables)
    with ThreadPoolExecutor(1) as pool:
        found = SystemFindings(discover(system, recordings, executor=pool), tuple(recordings))
    (law,) = found.laws
    assert (law.law.place.kind, law.law.says) == (RATE, "the rate of the speed, over the hysteresis of the position")
    assert "follows x with a gradual play of" in law.formula
    values = found.discovery.steps[0].accepted.values
    stiff, wide = law.constants["strength"][0] * values["constant.m"], law.constants["play"][0]
    assert stiff == pytest.approx(STIFF, rel=0.1)
    assert stiff * wide == pytest.approx(MOST, rel=0.05)
    assert values["constant.m"] == pytest.approx(M, rel=0.03)


def test_laws_at_one_place_over_one_state_are_said_once_with_their_number():
    """Smooth loops are sums of plays, each a law of its own."""
    assert counted(["in the input", "in the input", "in the gain"]) == ["in the input (two laws)", "in the gain"]
    assert counted(["in the input"] * 3) == ["in the input (three laws)"]
