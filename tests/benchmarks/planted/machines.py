"""Simulated machines and a circuit: a valve that saturates, unequal friction, gravity on an arm, a diode."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tests.benchmarks.planted.systems import Floats, Tables, marched, noisy, wandering

SERVO = '''
"""A servo valve with its cylinder."""
time = "t"
inputs = {"u": ("u", "V")}
channels = {"s": ("s", "mm")}
constants = {"k": (5.0, "mm/s/V", 1.0, 50.0), "a": (0.2, "1/s", 0.01, 5.0)}
start = {"s": "s"}
units = {"s": "mm"}
says = {"u": "the command", "s": "the stroke", "k": "the gain"}
hold_out = ["run 2"]

def slopes(t, x, u, c):
    return c.k * u.u - c.a * x.s
'''


def servo(rng: np.random.Generator, limit: float) -> Tables:
    """Three runs of a valve that opens no farther than at a command of some volts."""
    out, t = {}, np.arange(0, 30, 0.05)
    for k in range(3):
        u = 4.5 * wandering(rng, t, 0.9)
        x = marched(lambda at, x, u=u: (8 * np.clip(np.interp(at, t, u), -limit, limit) - 0.3 * x[0],), (0.0,), t, 6)
        out[f"run {k}"] = {"t": t, "u": u, "s": noisy(rng, x[0], 0.1)}
    return out


SLIDE = '''
"""A slide driven by a screw."""
time = "t"
inputs = {"f": ("f", "N")}
channels = {"v": ("v", "m/s")}
constants = {"m": (90.0, "kg", 20.0, 400.0), "d": (100.0, "N s/m", 5.0, 2000.0)}
start = {"v": "v"}
units = {"v": "m/s"}
says = {"v": "the speed", "f": "the force"}

def slopes(t, x, u, c):
    return (u.f - c.d * x.v) / c.m
'''


def slide(rng: np.random.Generator, dry: float, unequal: float) -> Tables:
    """Three runs against a friction that is larger in one direction."""
    out, t = {}, np.arange(0, 12, 0.02)
    for k in range(3):
        f = 90 * wandering(rng, t, 0.5)

        def slope(at: float, x: Floats, f: Floats = f) -> Sequence[float]:
            friction = dry * (np.tanh(x[0] / 4e-3) + unequal)
            return ((np.interp(at, t, f) - 200 * x[0] - friction) / 95,)

        out[f"run {k}"] = {"t": t, "f": f, "v": noisy(rng, marched(slope, (0.0,), t, 20)[0], 1e-3)}
    return out


ARM = '''
"""A motor with an arm."""
time = "t"
inputs = {"i": ("i", "A")}
channels = {"th": ("th", "rad")}
constants = {"k": (10.0, "rad/s^2/A", 1.0, 100.0), "b": (1.0, "1/s", 0.1, 10.0)}
start = {"th": "th", "w": (0.0, -50.0, 50.0)}
units = {"th": "rad", "w": "rad/s"}
says = {"th": "the angle", "w": "the speed", "i": "the current"}
hold_out = ["swing 3"]

def slopes(t, x, u, c):
    return x.w, c.k * u.i - c.b * x.w
'''


def arm(rng: np.random.Generator, gravity: float) -> Tables:
    """Four swings of an arm that has a weight."""
    out, t = {}, np.arange(0, 10, 0.02)
    for k in range(4):
        i = 0.6 * wandering(rng, t, 0.8)

        def slope(at: float, x: Floats, i: Floats = i) -> Sequence[float]:
            return x[1], 12 * np.interp(at, t, i) - 2.5 * x[1] - gravity * np.sin(x[0] - 0.4)

        out[f"swing {k}"] = {"t": t, "i": i, "th": noisy(rng, marched(slope, (0.4, 0.0), t, 4)[0], 5e-3)}
    return out


DRONE = '''
"""A drone that hovers."""
time = "t"
inputs = {"u": ("u", "1")}
channels = {"z": ("z", "m")}
constants = {"k": (12.0, "m/s^2", 5.0, 40.0), "d": (0.3, "1/s", 0.01, 3.0)}
start = {"z": "z", "v": (0.0, -3.0, 3.0)}
units = {"z": "m", "v": "m/s"}
says = {"z": "the height", "v": "the climb", "u": "the throttle", "k": "the thrust"}
hold_out = ["flight 2"]

def slopes(t, x, u, c):
    return x.v, c.k * u.u - 9.81 - c.d * x.v
'''


def drone(rng: np.random.Generator, near_ground: float) -> Tables:
    """Three flights by a controller; the thrust grows towards the ground."""
    out, t = {}, np.arange(0, 30, 0.05)
    for k in range(3):
        aim = 0.55 + 0.4 * np.sin(2 * np.pi * t / (9 + k)) + 0.1 * wandering(rng, t, 1.5)
        z, v, heights, throttles = 0.5, 0.0, [], []
        for one in aim:
            u = float(np.clip((9.81 + 4 * (one - z) - 3 * v) / 15, 0.2, 1.2))
            heights.append(z)
            throttles.append(u)
            for _ in range(40):
                thrust = 15 * u * (1 + near_ground * np.exp(-max(z, 0.0) / 0.2))
                v += (thrust - 9.81 - 0.5 * v) * 0.05 / 40
                z += v * 0.05 / 40
        out[f"flight {k}"] = {"t": t, "u": np.array(throttles), "z": noisy(rng, np.array(heights), 3e-3)}
    return out


def shuttle(rng: np.random.Generator, drag: float) -> Tables:
    """Three throws of a shuttlecock, slowed by the square of its speed against its direction."""
    out, t = {}, np.arange(0, 1.2, 1 / 60)
    for k in (1, 2, 3):
        begin = 0.0, 1.5, rng.uniform(5, 14), rng.uniform(3, 10)

        def slope(_: float, x: Floats) -> Sequence[float]:
            speed = np.hypot(x[2], x[3])
            return x[2], x[3], -drag * speed * x[2], -9.81 - drag * speed * x[3]

        x = marched(slope, begin, t, 4)
        out[f"throw {k}"] = {"t": t, "x": noisy(rng, x[0], 5e-3), "y": noisy(rng, x[1], 5e-3)}
    return out


CIRCUIT = '''
"""A capacitor behind a resistor."""
time = "t"
inputs = {"u": ("u", "V")}
channels = {"v": ("v", "V")}
constants = {"R": (900.0, "Ohm", 100.0, 9000.0)}
start = {"v": "v"}
units = {"v": "V"}
says = {"v": "the voltage", "u": "the source", "R": "the resistor"}
hold_out = ["run 2"]

def slopes(t, x, u, c):
    return (u.u - x.v) / (c.R * 1e-3)
'''


def circuit(rng: np.random.Generator, saturation_a: float) -> Tables:
    """Three runs with a diode beside the capacitor: its current grows exponentially with the voltage."""
    out, t = {}, np.arange(0, 8, 0.01)
    for k in range(3):
        u = 0.6 + 1.2 * wandering(rng, t, 0.6)

        def slope(at: float, x: Floats, u: Floats = u) -> Sequence[float]:
            return (((np.interp(at, t, u) - x[0]) / 1000 - saturation_a * (np.exp(x[0] / 0.06) - 1)) / 1e-3,)

        out[f"run {k}"] = {"t": t, "u": u, "v": noisy(rng, marched(slope, (0.0,), t, 40)[0], 4e-3)}
    return out
