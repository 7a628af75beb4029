"""Instruments of a user's system: readings that lag, saturate or drop out, and a constant whose range is too narrow."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from straw.replay.diagnose.discover.discover import discover
from straw.replay.diagnose.discover.findings import SystemFindings
from straw.replay.diagnose.discover.screen import candidates
from straw.replay.diagnose.systems.function.codes import CHANNEL, INPUT
from straw.replay.diagnose.systems.function.laws import Law
from straw.replay.diagnose.systems.function.model import load_model
from straw.replay.diagnose.systems.function.passed import passed
from straw.replay.diagnose.systems.function.read_recordings import recordings_of
from straw.replay.diagnose.systems.function.shapes import FOLLOWS, PLAY
from straw.replay.diagnose.systems.function.spikes import spikes
from straw.replay.diagnose.systems.function.system import FunctionSystem
from tests.benchmarks.planted.instruments import DRIVE

#: A tank that is filled: its level is the integral of the flow.
TANK = '''
"""A tank that is filled."""
time = "t"
inputs = {"q": ("q", "l/s")}
channels = {"h": ("h", "l")}
constants = {"g": (1.5, "1", LOW, 3.0)}
start = {"h": "h"}
units = {"h": "l"}
says = {"h": "the level", "q": "the flow", "g": "the gain"}
hold_out = ["b"]
OPTIONS

def slopes(t, x, u, c):
    return c.g * u.q - 0.2 * x.h
'''


def model_file(folder: Path, low: float = 0.2, options: str = "") -> Path:
    path = folder / "tank.py"
    path.write_text(TANK.replace("LOW", str(low)).replace("OPTIONS", options))
    return path


def levels(t: np.ndarray, q: np.ndarray, gain: float) -> np.ndarray:
    """Levels by the exact step of a flow that is held between samples, from an empty tank."""
    h, fade = np.zeros(len(t)), np.exp(-0.2 * (t[1] - t[0]))
    for k in range(len(t) - 1):
        flow = gain * (q[k] + q[k + 1]) / 2
        h[k + 1] = h[k] * fade + flow / 0.2 * (1 - fade)
    return h


def tables(gain: float, noise: float) -> dict[str, tuple[str, dict[str, np.ndarray]]]:
    """Two recordings of the tank under flows that change smoothly."""
    rng, out, t = np.random.default_rng(5), {}, np.arange(0, 60, 0.1)
    for name in "ab":
        q = 2 + np.sum([np.sin(w * t + rng.uniform(0, 6)) for w in (0.11, 0.3, 0.7)], axis=0)
        h = levels(t, q, gain) + rng.normal(0, noise, len(t))
        out[name] = name, {"t": t, "q": q, "h": h}
    return out


def candidate(shape: int, place: int, system: FunctionSystem, recordings: list) -> Law:
    """The first candidate of a shape at a place of this kind."""
    seen = passed(system, recordings, {})
    return next(x for x in candidates(system, seen) if x.shape == shape and x.place.kind == place)


@pytest.mark.parametrize("place", [CHANNEL, INPUT])
def test_a_lag_of_a_reading_or_an_input_is_the_first_order_filter_of_it(tmp_path, place):
    """Of a flow that rises evenly from zero into an empty tank the filtered one is known; a linear tank does not tell a
    lag before it from one behind it."""
    t = np.linspace(0, 30, 601)
    rises = {"t": t, "q": 0.1 * t, "h": levels(t, 0.1 * t, 1.5)}
    system = FunctionSystem(load_model(model_file(tmp_path)))
    recordings = recordings_of(system.model, {name: (name, rises) for name in "ab"})
    law, tau = candidate(FOLLOWS, place, system, recordings), 4.0
    values = {"law.0.strength": 1.0, "law.0.lag_s": tau}
    shown = system.with_laws(law).played(recordings[0], values, np.zeros(1))[0]
    late = 0.1 * (t - tau * (1 - np.exp(-t / tau)))
    assert shown[0] == pytest.approx(levels(t, late, 1.5), abs=2e-4)


@pytest.mark.parametrize("place", [CHANNEL, INPUT])
def test_a_play_of_a_reading_or_an_input_stays_until_the_other_has_crossed_it(tmp_path, place):
    """A flow that rises evenly is behind by the half width; when it falls again, it first stays for the whole width."""
    t, half = np.linspace(0, 40, 801), 0.3
    q = 1.0 + 0.1 * np.where(t < 20, t, 40 - t)
    h = levels(t, q, 1.5)
    table = {"t": t, "q": q, "h": h}
    system = FunctionSystem(load_model(model_file(tmp_path)))
    recordings = recordings_of(system.model, {name: (name, table) for name in "ab"})
    law = candidate(PLAY, place, system, recordings)
    shown = system.with_laws(law).played(recordings[0], {"law.0.strength": 1.0, "law.0.play": half}, np.zeros(1))[0][0]

    def played(row: np.ndarray) -> np.ndarray:
        back = np.maximum(row[0], np.maximum.accumulate(row) - half)
        return np.where(np.arange(len(row)) <= np.argmax(row), back, np.minimum(back, row + half))

    wanted = played(h) if place == CHANNEL else levels(t, played(q), 1.5)
    assert shown == pytest.approx(wanted, abs=5e-3)
    assert np.max(np.abs(shown - h)) > 0.2


def test_a_play_with_its_width_is_found_and_told_from_a_lag(tmp_path):
    rng, out, t = np.random.default_rng(5), {}, np.arange(0, 60, 0.1)
    for name in "ab":
        q = 2 + np.sum([np.sin(w * t + rng.uniform(0, 6)) for w in (0.11, 0.3, 0.7)], axis=0)
        behind = q.copy()
        for k in range(1, len(t)):
            behind[k] = np.clip(behind[k - 1], q[k] - 0.4, q[k] + 0.4)
        out[name] = name, {"t": t, "q": q, "h": levels(t, behind, 1.5) + rng.normal(0, 0.02, len(t))}
    model = load_model(model_file(tmp_path))
    recordings = recordings_of(model, out)
    with ThreadPoolExecutor(1) as pool:
        found = SystemFindings(discover(FunctionSystem(model), recordings, executor=pool), tuple(recordings))
    assert found.laws[0].law.says == "the input the flow, over its own history"
    assert "with a play of" in found.laws[0].formula
    width, sigma, unit = found.laws[0].constants["play"]
    assert unit == "l/s"
    assert width == pytest.approx(0.4, abs=max(4 * sigma, 0.01))
    assert "lag" not in found.forms


def test_a_law_in_a_reading_reaches_as_far_as_the_system_goes_not_as_its_wrong_readings_do(tmp_path):
    t = np.arange(0, 60, 0.1)
    q = 2 + 2 * np.sin(0.2 * t)
    table = {"t": t, "q": q, "h": np.minimum(levels(t, q, 1.5), 12.0)}
    system = FunctionSystem(load_model(model_file(tmp_path)))
    recordings = recordings_of(system.model, {name: (name, table) for name in "ab"})
    laws = candidates(system, passed(system, recordings, {}))
    (own,) = [x for x in laws if x.says == "the reading of the level, over the level"]
    (other,) = [x for x in laws if x.says == "the rate of the level, over the level"]
    assert own.state.high > 20 > 13 > other.state.high
    assert own.at[-1] > 20


def test_a_constant_whose_range_is_too_narrow_is_named_and_no_law(tmp_path):
    model = load_model(model_file(tmp_path, low=1.4))
    recordings = recordings_of(model, tables(gain=1.0, noise=0.02))
    with ThreadPoolExecutor(1) as pool:
        found = SystemFindings(discover(FunctionSystem(model), recordings, executor=pool), tuple(recordings))
    assert found.laws[0].law.says == "the gain, beyond its range"
    assert "in the gain, beyond what the file allows" in found.says
    assert list(found.laws[0].constants) == ["g"]
    gain, sigma, _ = found.laws[0].constants["g"]
    assert sigma < 0.005
    assert gain == pytest.approx(1.0, abs=4 * sigma)
    assert found.laws[0].formula.endswith("where the file says 1.4 to 3")
    assert len(found.laws) == 1


def test_a_fixed_constant_that_is_wrong_is_named_with_its_value(tmp_path):
    path = model_file(tmp_path)
    path.write_text(path.read_text().replace('(1.5, "1", 0.2, 3.0)', '(1.5, "1", "fixed")'))
    model = load_model(path)
    recordings = recordings_of(model, tables(gain=1.0, noise=0.02))
    with ThreadPoolExecutor(1) as pool:
        found = SystemFindings(discover(FunctionSystem(model), recordings, executor=pool), tuple(recordings))
    assert found.laws[0].law.says == "the gain, beyond its range"
    assert found.laws[0].formula.endswith("where the file says 1.5")
    gain, sigma, _ = found.laws[0].constants["g"]
    assert gain == pytest.approx(1.0, abs=4 * sigma)


def test_single_readings_that_jump_away_and_back_are_spikes():
    t = np.arange(0, 50, 0.1)
    row = 5 * np.sin(t) + np.random.default_rng(5).normal(0, 0.02, len(t))
    clean = row.copy()
    at = [60, 200, 201, 333]
    row[at] = -9.0
    assert list(np.flatnonzero(spikes(row))) == at
    assert not spikes(clean).any()


@pytest.mark.parametrize(
    "row",
    [
        np.repeat([0.0, 3.0, 1.0, 8.0], 50),
        np.abs(np.linspace(-5, 5, 200)),
        np.exp(-((np.arange(200) - 100) ** 2) / 8.0),
        np.where(np.arange(200) % 20 == 0, 1.0, 0.0),
        np.full(200, 2.0),
        np.where(np.arange(200) < 2, 9.0, 1.0),
    ],
    ids=["steps", "a corner", "a short pulse", "ticks", "a constant", "a beginning"],
)
def test_how_a_channel_moves_is_no_spike(row):
    assert not spikes(row).any()


def test_spikes_are_left_out_and_reported_unless_the_file_keeps_them(tmp_path):
    given = tables(gain=1.5, noise=0.02)
    for _, table in given.values():
        table["h"][[100, 250]] = 0.0
    model = load_model(model_file(tmp_path))
    recordings = recordings_of(model, given)
    assert [one.left_out for one in recordings] == [(2,), (2,)]
    assert np.isnan(recordings[0].seen[0, [100, 250]]).all()
    with ThreadPoolExecutor(1) as pool:
        found = SystemFindings(discover(FunctionSystem(model), recordings, executor=pool), tuple(recordings))
    assert found.verdict == "complete"
    assert any("left out as spikes: 4 of 1200 readings of the level" in one for one in found.asides)
    kept = recordings_of(load_model(model_file(tmp_path, options="keep_spikes = True")), given)
    assert [one.left_out for one in kept] == [(0,), (0,)]
    assert kept[0].seen[0, 100] == 0.0


def test_a_counter_that_does_not_tell_the_direction_is_found_though_the_base_is_far_off(tmp_path):
    """The best signed speed to a magnitude is nearly none, about which no law over the speed looks promising; the law
    that is fitted first leads to constants about which the counter does: it shows v + 2 max(0, -v)."""
    path, rng, tables_, t = tmp_path / "drive.py", np.random.default_rng(8), {}, np.arange(0, 25, 0.05)
    path.write_text(DRIVE)
    for name in ("run 1", "run 2"):
        u = np.sum([np.sin(w * t + rng.uniform(0, 6)) for w in (0.5, 1.3, 2.9)], axis=0)
        speed, fade = np.zeros(len(t)), np.exp(-0.05 / 0.9)
        for k in range(len(t) - 1):  # exact for a voltage that is held at its mean between samples
            speed[k + 1] = speed[k] * fade + 3 * (u[k] + u[k + 1]) / 2 * (1 - fade)
        tables_[name] = name, {"t": t, "u": u, "w": np.abs(speed) + rng.normal(0, 0.03, len(t))}
    model = load_model(path)
    recordings = recordings_of(model, tables_)
    with ThreadPoolExecutor(1) as pool:
        found = SystemFindings(discover(FunctionSystem(model), recordings, executor=pool), tuple(recordings))
    (law,) = found.laws
    assert law.law.says == "the reading of the pulse rate, over the speed"
    strength, sigma, _ = law.constants["strength"]
    assert strength == pytest.approx(2.0, abs=max(4 * sigma, 0.01))
    values = found.discovery.steps[0].accepted.values
    assert values["constant.g"] == pytest.approx(3.0, rel=0.02)
    assert values["constant.T"] == pytest.approx(0.9, rel=0.02)
