"""Simulated instruments: a thermometer that lags, a sensor that saturates, backlash, a logger that drops readings."""

from __future__ import annotations

import numpy as np

from tests.benchmarks.planted.systems import Tables, marched, noisy, wandering

OVEN = '''
"""An oven with a heater."""
time = "t"
inputs = {"p": ("p", "W")}
channels = {"T": ("T", "degC")}
constants = {"C": (900.0, "J/K", 100.0, 9000.0), "h": (2.0, "W/K", 0.2, 20.0)}
start = {"T": "T"}
units = {"T": "degC"}
says = {"T": "the temperature", "p": "the power", "C": "the heat capacity", "h": "the cooling"}
hold_out = ["bake 2"]

def slopes(t, x, u, c):
    return (u.p - c.h * (x.T - 22.0)) / c.C
'''


def oven(rng: np.random.Generator, lag_s: float) -> Tables:
    """Three bakes, the temperature of a thermometer that follows late."""
    out, t = {}, np.arange(0, 3000, 6.0)
    for k in range(3):
        p = np.maximum(0, 60 + 50 * wandering(rng, t, 120))
        x = marched(
            lambda at, x, p=p: ((np.interp(at, t, p) - 1.5 * (x[0] - 22)) / 700, (x[0] - x[1]) / lag_s),
            (22.0, 22.0), t, 4,
        )  # fmt: skip
        out[f"bake {k}"] = {"t": t, "p": p, "T": noisy(rng, x[1], 0.1)}
    return out


TANK = '''
"""A pressure tank behind a regulator."""
time = "t"
inputs = {"u": ("u", "V")}
channels = {"p": ("p", "bar")}
constants = {"g": (2.0, "bar/V", 0.2, HIGH), "T": (2.0, "s", 0.2, 20.0)}
start = {"p": "p"}
units = {"p": "bar"}
says = {"p": "the pressure", "u": "the command", "g": "the gain", "T": "the time constant"}
hold_out = ["run 2"]

def slopes(t, x, u, c):
    return (c.g * u.u - x.p) / c.T
'''
#: The same with a range of the gain that holds the truth, and with one that does not.
TANK, NARROW = TANK.replace("HIGH", "20.0"), TANK.replace("HIGH", "2.5")


def tank(rng: np.random.Generator, most: float = 99.0, dropped: float = 0.0, play: float = 0.0) -> Tables:
    """Three runs of a sensor that shows no more than ``most`` bar, and zero for a share ``dropped`` of its readings.

    The regulator follows its command with a ``play`` (V) to each side.
    """
    out, t = {}, np.arange(0, 60, 0.1)
    for k in range(3):
        u = 4 * wandering(rng, t, 2.0)
        felt = u.copy()
        for i in range(1, len(t)):
            felt[i] = np.clip(felt[i - 1], u[i] - play, u[i] + play)
        x = marched(lambda at, x, u=felt: ((3 * np.interp(at, t, u) - x[0]) / 2.5,), (0.0,), t, 6)
        p = np.minimum(noisy(rng, x[0], 0.05), most)
        out[f"run {k}"] = {"t": t, "u": u, "p": np.where(rng.random(len(t)) < dropped, 0.0, p)}
    return out


DRIVE = '''
"""A drive with a counter of pulses."""
time = "t"
inputs = {"u": ("u", "V")}
channels = {"w": ("w", "rad/s")}
constants = {"g": (2.0, "rad/s/V", 0.2, 20.0), "T": (1.5, "s", 0.1, 10.0)}
start = {"om": (0.0, -20.0, 20.0)}
units = {"om": "rad/s"}
says = {"om": "the speed", "u": "the voltage", "g": "the gain", "T": "the time constant", "w": "the pulse rate"}
hold_out = ["run 2"]

def slopes(t, x, u, c):
    return (c.g * u.u - x.om) / c.T

def shown(t, x, u, c):
    return x.om
'''


def drive(rng: np.random.Generator) -> Tables:
    """Three runs of a drive whose counter does not tell forwards from backwards."""
    out, t = {}, np.arange(0, 40, 0.05)
    for k in range(3):
        u = 1.5 * wandering(rng, t, 1.0)
        x = marched(lambda at, x, u=u: ((3 * np.interp(at, t, u) - x[0]) / 0.9,), (0.0,), t, 4)[0]
        out[f"run {k}"] = {"t": t, "u": u, "w": noisy(rng, np.abs(x), 0.03)}
    return out
