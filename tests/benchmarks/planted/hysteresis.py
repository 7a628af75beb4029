"""Simulated systems with hysteresis: a soft actuator of three plays, and a stage whose friction yields gradually."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tests.benchmarks.planted.systems import Floats, Tables, marched, noisy, wandering

ACTUATOR = '''
"""A soft actuator that bends."""
time = "t"
inputs = {"P": ("P", "kPa")}
channels = {"phi": ("phi", "deg")}
constants = {"g": (1.0, "deg/kPa", 0.1, 10.0), "T": (1.0, "s", 0.1, 10.0)}
start = {"phi": "phi"}
units = {"phi": "deg"}
says = {"phi": "the angle", "P": "the pressure", "g": "the gain", "T": "the time constant"}
hold_out = ["run 2"]

def slopes(t, x, u, c):
    return (c.g * u.P - x.phi) / c.T
'''


def actuator(rng: np.random.Generator, loops: Sequence[tuple[float, float]]) -> Tables:
    """Three runs of an actuator whose angle is the pressure less (share, half width) of what plays hold back (Prandtl
    and Ishlinskii)."""
    out, t = {}, np.arange(0, 80, 0.1)
    for k in range(3):
        pressure = np.maximum(0.0, 20 + 15 * wandering(rng, t, 2.0))
        bends = 1.2 * pressure
        for share, half in loops:
            held = pressure[0]
            for i, one in enumerate(pressure):
                held = min(max(held, one - half), one + half)
                bends[i] -= share * (one - held)
        phi = marched(lambda at, x, b=bends: ((np.interp(at, t, b) - x[0]) / 0.8,), (bends[0],), t, 4)[0]
        out[f"run {k}"] = {"t": t, "P": pressure, "phi": noisy(rng, phi, 0.15)}
    return out


STAGE = '''
"""A stage on a spring."""
time = "t"
inputs = {"f": ("f", "N")}
channels = {"x": ("x", "m")}
constants = {"m": (1.0, "kg", 0.2, 10.0), "c": (10.0, "N s/m", 0.5, 200.0), "k": (80.0, "N/m", 5.0, 1000.0)}
start = {"x": "x", "v": (0.0, -5.0, 5.0)}
units = {"x": "m", "v": "m/s"}
says = {"x": "the position", "v": "the speed", "f": "the force", "c": "the damper", "k": "the spring"}
hold_out = ["run 2"]

def slopes(t, x, u, c):
    return x.v, (u.f - c.c * x.v - c.k * x.x) / c.m
'''


def stage(rng: np.random.Generator, most_n: float) -> Tables:
    """Three runs against a friction that grows to its most over some 3 mm (Dahl)."""
    out, t = {}, np.arange(0, 8, 0.01)
    for k, size in enumerate((8.0, 14.0, 11.0)):
        f = size * wandering(rng, t, 0.25)

        def slope(at: float, x: Floats, f: Floats = f) -> Sequence[float]:
            force = np.interp(at, t, f) - 12 * x[1] - 60 * x[0] - x[2]
            return x[1], force / 1.5, 300 * (most_n * x[1] - abs(x[1]) * x[2])

        x = marched(slope, (0.0, 0.0, 0.0), t, 10)[0]
        out[f"run {k}"] = {"t": t, "f": f, "x": noisy(rng, x, 2e-4)}
    return out
