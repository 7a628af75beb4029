"""Further simulated systems with planted laws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tests.benchmarks.planted.systems import Floats, Tables, held, marched, noisy, wandering

FILTER = '''
"""A low-pass filter."""
time = "t"
inputs = {"e": ("e", "V")}
channels = {"v": ("v", "V")}
constants = {"tau": (0.01, "s", 0.002, 0.2)}
start = {"v": "v"}
says = {"e": "the source", "v": "the output", "tau": "the time constant"}
hold_out = ["sweep 1"]

def slopes(t, x, u, c):
    return (u.e - x.v) / c.tau
'''


def low_pass(rng: np.random.Generator, clamps: float) -> Tables:
    """Three sweeps; a clamp draws current above 2 V."""
    out, t = {}, np.arange(0, 1, 0.002)
    for k in range(3):
        e = 2.6 * wandering(rng, t, 0.05)
        x = marched(
            lambda at, x, e=e: ((np.interp(at, t, e) - x[0]) / 0.02 - clamps * max(0.0, x[0] - 1.2),), (e[0],), t, 4
        )
        out[f"sweep {k}"] = {"t": t, "e": e, "v": noisy(rng, x[0], 0.01)}
    return out


REACTOR = '''
"""A vessel in which nothing reacts."""
time = "t"
channels = {"c": ("c", "mol/l")}
start = {"c": "c"}
units = {"c": "mol/l"}
says = {"c": "the concentration"}

def slopes(t, x, u, c):
    return 0.0
'''


def reactor(rng: np.random.Generator, order: float) -> Tables:
    """Batches from four concentrations, which react by a law of some order."""
    out, t = {}, np.linspace(0, 60, 90)
    for k, start in enumerate((2.0, 0.8, 1.4, 3.0)):
        x = marched(lambda _, x: (-0.03 * max(x[0], 0.0) ** order,), (start,), t, 4)
        out[f"batch {k}"] = {"t": t, "c": noisy(rng, x[0], 0.01, 0.4)}
    return out


CAR = '''
"""A car that rolls out on a level road."""
import numpy as np
time = "t"
channels = {"v": ("v", "m/s")}
constants = {"a": (0.2, "m/s^2", 0.02, 2.0)}
start = {"v": "v"}
units = {"v": "m/s"}
says = {"v": "the speed", "a": "the rolling resistance"}
hold_out = ["run 1"]

def slopes(t, x, u, c):
    return -c.a
'''


def car(rng: np.random.Generator, drag: float) -> Tables:
    """Three runs from different speeds."""
    out, t = {}, np.arange(0, 60, 0.5)
    for k, start in enumerate((33.0, 25.0, 18.0)):
        x = marched(lambda _, x: (-0.12 - drag * x[0] * abs(x[0]),), (start,), t, 4)
        out[f"run {k}"] = {"t": t, "v": noisy(rng, x[0], 0.1, 0.3)}
    return out


BOAT = '''
"""A boat that glides, slowed by a constant force."""
time = "t"
channels = {"s": ("s", "m")}
start = {"s": "s", "v": (3.0, 0.0, 8.0)}
units = {"s": "m", "v": "m/s"}
says = {"s": "the way", "v": "the speed"}
start_from_s = 5.0
hold_out = ["glide 2"]

def slopes(t, x, u, c):
    return x.v, -0.05
'''


def boat(rng: np.random.Generator, drag: float) -> Tables:
    """Two short glides, of which one is fitted."""
    out, t = {}, np.arange(0, 22, 0.5)
    for k in (1, 2):
        x = marched(lambda _, x: (x[1], -0.05 - drag * x[1] * abs(x[1])), (0.0, rng.uniform(3.5, 5.0)), t, 4)
        out[f"glide {k}"] = {"t": t, "s": noisy(rng, x[0], 0.04, 0.3)}
    return out


CAMERA = '''
"""A scale that a camera reads."""
time = "t"
inputs = {"x": ("x", "mm")}
channels = {"y": ("y", "px")}
constants = {"a": (10.0, "px/mm", 1.0, 100.0), "y0": (0.0, "px", -500.0, 500.0)}
says = {"x": "the stage", "y": "the scale", "a": "the magnification"}

def shown(t, x, u, c):
    return c.a * u.x + c.y0
'''


def camera(rng: np.random.Generator, wanders_s: float) -> Tables:
    """One recording by a camera whose clock wanders."""
    t = np.arange(0, 200, 0.2)
    fine = np.arange(-20, 220, 0.05)
    x = 5 * wandering(rng, fine, 1.5)
    late = wanders_s * np.sin(2 * np.pi * t / 130) + wanders_s * t / 200
    y = 14 * np.interp(t - late, fine, x) + 60
    return {"film": {"t": t, "x": np.interp(t, fine, x), "y": noisy(rng, y, 1.0)}}


VALVE = '''
"""A proportional valve."""
time = 20.0
inputs = {"u": ("u", "V"), "d": ("d", "bar")}
channels = {"q": ("q", "l/min")}
constants = {"k": (1.0, "l/min/V", 0.1, 10.0), "q0": (0.0, "l/min", -20.0, 20.0)}
says = {"u": "the voltage", "d": "the supply", "q": "the flow", "k": "the gain"}

def shown(t, x, u, c):
    return c.k * u.u + c.q0
'''


def valve(rng: np.random.Generator, dead: float, supply: float) -> Tables:
    """Voltages and a supply that moves slowly; a dead zone, and a flow that grows with the supply."""
    out, t = {}, np.arange(500) / 20
    for k in range(3):
        u, d = 5 + 2.5 * wandering(rng, t, 0.8), 6 + wandering(rng, t, 4.0)
        q = 1.6 * np.maximum(u, dead) * (1 + supply * (d - 6))
        out[f"test {k}"] = {"u": u, "d": d, "q": noisy(rng, q, 0.08)}
    return out


POND = '''
"""A pond that its weir drains."""
import numpy as np
time = "t"
inputs = {"q": ("q", "m3/h")}
channels = {"h": ("h", "m")}
constants = {"A": (100.0, "m2", 20.0, 500.0), "k": (20.0, "m^2.5/h", 2.0, 200.0)}
start = {"h": "h"}
says = {"q": "the inflow", "h": "the depth", "k": "the outlet"}

def slopes(t, x, u, c):
    return (u.q - c.k * np.sqrt(max(x.h, 0.0))) / c.A
'''


def pond(rng: np.random.Generator, seeps: float) -> Tables:
    """Four days of rain; above 1 m water seeps away at the side."""
    out, t = {}, np.arange(0, 96, 0.5)
    for k in range(4):
        q = 30 + 28 * np.abs(wandering(rng, t, 7.0))

        def slope(at: float, x: Floats, q: Floats = q) -> Sequence[float]:
            h = max(x[0], 0.0)
            return ((np.interp(at, t, q) - 42 * np.sqrt(h)) / 150 - seeps * max(0.0, h - 1.0),)

        out[f"rain {k}"] = {"t": t, "q": q, "h": noisy(rng, marched(slope, (0.8,), t, 4)[0], 0.01, 0.5)}
    return out


def quiet_battery(rng: np.random.Generator) -> Tables:
    """A battery without polarisation, its noise growing with the current."""
    out = {}
    for k in range(3):
        current = held(np.arange(0, 400, 35), rng.uniform(-1, 5, 12), np.arange(400.0))
        shown = 3.7 - 0.05 * current + rng.normal(size=400) * 1e-3 * (1 + np.abs(current))
        out[f"pulse {k}"] = {"I": current, "U": shown}
    return out


THROW = '''
"""A ball of foam thrown, filmed from the side."""
time = "t"
channels = {"x": ("x", "m"), "y": ("y", "m")}
start = {"x": "x", "y": "y", "vx": (8.0, 0.0, 20.0), "vy": (8.0, 0.0, 20.0)}
units = {"x": "m", "y": "m", "vx": "m/s", "vy": "m/s"}
says = {"x": "the distance", "y": "the height", "vx": "the speed along", "vy": "the speed up"}
hold_out = ["throw 3"]

def slopes(t, x, u, c):
    return x.vx, x.vy, 0.0, -9.81
'''


def throw(rng: np.random.Generator, drag: float) -> Tables:
    """Three throws, slowed in proportion to the speed along and up; readings start in flight."""
    out, t = {}, np.arange(0, 1.2, 1 / 60)
    for k in (1, 2, 3):
        begin = 0.0, 1.5, rng.uniform(5, 12), rng.uniform(4, 10)
        x = marched(lambda _, x: (x[2], x[3], -drag * x[2], -9.81 - drag * x[3]), begin, t, 4)
        out[f"throw {k}"] = {"t": t, "x": noisy(rng, x[0], 5e-3), "y": noisy(rng, x[1], 5e-3)}
    return out


PREY = '''
"""Prey and their hunters."""
time = "t"
channels = {"p": ("p", "1"), "q": ("q", "1")}
constants = {"a": (0.7, "1", 0.3, 1.5), "b": (0.6, "1", 0.2, 1.5), "c": (0.5, "1", 0.2, 1.5), "d": (0.5, "1", 0.2, 1.5)}
start = {"p": "p", "q": "q"}
says = {"p": "the prey", "q": "the hunters", "a": "the prey's growth"}
hold_out = ["year 3"]

def slopes(t, x, u, c):
    return x.p * (c.a - c.b * x.q), x.q * (c.c * x.p - c.d)
'''


def prey(rng: np.random.Generator, crowded: float) -> Tables:
    """Three years from different beginnings; prey in crowds grow slower."""
    out, t = {}, np.arange(0, 40, 0.25)
    for k in (1, 2, 3):
        begin = rng.uniform(0.5, 2.0), rng.uniform(0.3, 1.0)
        x = marched(lambda _, x: (x[0] * (0.8 - crowded * x[0] - 0.6 * x[1]), x[1] * (0.5 * x[0] - 0.5)), begin, t, 4)
        out[f"year {k}"] = {"t": t, "p": noisy(rng, x[0], 0.01), "q": noisy(rng, x[1], 0.01)}
    return out
