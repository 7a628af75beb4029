"""Simulated systems with a planted law that their base models leave out, and some from which nothing is missing."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.measured.cases import Effect

Floats = NDArray[np.float64]
Tables = dict[str, dict[str, Floats]]


@dataclass(frozen=True)
class Planted:
    """A system: the text of its base model, recordings by a generator, and the planted laws; none where nothing is.

    ``noise`` is the RMS that the truth itself would leave.
    """

    name: str
    text: str
    made: Callable[[np.random.Generator], Tables]
    noise: float
    effects: tuple[Effect, ...] = ()


def marched(
    slope: Callable[[float, Floats], Sequence[float]], x0: Sequence[float], t: Floats, parts: int = 20
) -> Floats:
    """States (states, n) at t by the classical Runge-Kutta rule in fine steps."""
    out = [np.array(x0, dtype=np.float64)]
    for a, b in itertools.pairwise(t):
        x, h = out[-1], (b - a) / parts
        for k in range(parts):
            at = a + k * h
            k1 = np.array(slope(at, x))
            k2 = np.array(slope(at + h / 2, x + h / 2 * k1))
            k3 = np.array(slope(at + h / 2, x + h / 2 * k2))
            k4 = np.array(slope(at + h, x + h * k3))
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        out.append(x)
    return np.array(out).T


def noisy(rng: np.random.Generator, y: Floats, sigma: float, memory: float = 0.0) -> Floats:
    """Readings with noise of one deviation sigma, of which each sample keeps a share ``memory`` of the one before."""
    e = rng.normal(0, sigma * np.sqrt(1 - memory**2), len(y))
    e[0] /= np.sqrt(1 - memory**2)
    for k in range(1, len(y)):
        e[k] += memory * e[k - 1]
    return y + e


def wandering(rng: np.random.Generator, t: Floats, slow_s: float) -> Floats:
    """A smooth random signal of about unit size over t (n,)."""
    knots = np.arange(t[0] - 3 * slow_s, t[-1] + 4 * slow_s, slow_s)
    values = rng.normal(size=len(knots))
    weight = np.exp(-(((t[:, None] - knots) / slow_s) ** 2))
    return np.asarray(weight @ values / np.sqrt((weight**2).sum(axis=1)))


def held(knots: Sequence[float], values: Sequence[float], t: Floats) -> Floats:
    """Steps that begin at knots, at t (n,)."""
    return np.asarray(values)[np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(values) - 1)]


PENDULUM = '''
"""A pendulum in air."""
import numpy as np
time = "t"
channels = {"a": ("a", "rad")}
constants = {"c": (0.05, "1/s", 0.001, 2.0), "k": (9.0, "1/s^2", 3.0, 30.0)}
start = {"a": "a", "w": (0.0, -1.0, 1.0)}
units = {"w": "rad/s"}
says = {"a": "the angle", "w": "the turning speed", "c": "the bearing's damping"}
hold_out = ["release 1"]

def slopes(t, x, u, c):
    return x.w, -c.c * x.w - c.k * np.sin(x.a)
'''


def pendulum(rng: np.random.Generator, drag: float) -> Tables:
    """Releases from three angles; drag in 1/rad beside 0.04 1/s."""
    out, t = {}, np.arange(0, 25, 0.08)
    for k, angle in enumerate((1.5, 1.0, 0.5)):
        x = marched(lambda _, x: (x[1], -0.04 * x[1] - drag * abs(x[1]) * x[1] - 11 * np.sin(x[0])), (angle, 0.0), t, 4)
        out[f"release {k}"] = {"t": t, "a": noisy(rng, x[0], 5e-3)}
    return out


HEATER = '''
"""A block with a heater, cooled in proportion."""
time = 0.5
inputs = {"p": ("p", "W")}
channels = {"T": ("T", "K")}
constants = {"b": (0.01, "K/J", 0.001, 0.1), "h": (0.01, "1/s", 0.001, 0.1)}
start = {"T": "T"}
says = {"T": "the excess temperature", "p": "the power", "h": "the cooling"}

def slopes(t, x, u, c):
    return c.b * u.p - c.h * x.T
'''


def heater(rng: np.random.Generator, convection: float) -> Tables:
    """One long recording in steps of power; slow disturbances beside noise."""
    t = np.arange(900) / 0.5
    p = held(np.arange(0, 1800, 150), rng.uniform(0, 60, 12), t)
    x = marched(lambda at, x: (0.02 * p[int(at * 0.5 + 1e-9)] - 0.006 * x[0] - convection * x[0] ** 2,), (5.0,), t, 4)
    return {"day": {"p": p, "T": noisy(rng, x[0], 0.3, 0.8)}}


MOTOR = '''
"""A motor that runs without friction but its viscous one."""
time = "t"
inputs = {"V": ("V", "V")}
channels = {"w": ("w", "rad/s")}
constants = {"b": (30.0, "rad/s^2/V", 5.0, 200.0), "a": (2.0, "1/s", 0.2, 20.0)}
start = {"w": "w"}
says = {"w": "the speed", "V": "the voltage", "a": "the viscous friction"}

def slopes(t, x, u, c):
    return c.b * u.V - c.a * x.w
'''


def motor(rng: np.random.Generator, dry: float) -> Tables:
    """Four recordings of changing voltages with reversals."""
    out, t = {}, np.arange(0, 8, 0.02)
    for k in range(4):
        V = 4 * wandering(rng, t, 0.5)
        x = marched(lambda at, x, V=V: (45 * np.interp(at, t, V) - 3 * x[0] - dry * np.tanh(x[0] / 0.6),), (0.0,), t, 6)
        out[f"run {k}"] = {"t": t, "V": V, "w": noisy(rng, x[0], 0.4)}
    return out


PIPE = '''
"""A mixing vessel behind a dosing pipe."""
time = "t"
inputs = {"u": ("u", "g/l")}
channels = {"c": ("c", "g/l")}
constants = {"tau": (3.0, "s", 0.5, 50.0)}
start = {"c": "c"}
units = {"c": "g/l"}
says = {"u": "the dose", "c": "the concentration", "tau": "the mixing time"}

def slopes(t, x, u, c):
    return (u.u - x.c) / c.tau
'''


def pipe(rng: np.random.Generator, delay_s: float, crowded: float) -> Tables:
    """Thirty short steps of a dose, of a few samples each; the mixing slows with the concentration."""
    out = {}
    for k in range(30):
        t = np.append(0.0, np.cumsum(rng.uniform(0.7, 1.3, 26)) * np.linspace(0.7, 1.4, 26))
        first, last = rng.uniform(0, 3), rng.uniform(3, 9)
        fine = np.linspace(-delay_s - 1, 50, 3000)
        dose = first + (last - first) * (1 - np.exp(-np.maximum(fine, 0) / 4))

        def slope(at: float, x: Floats, fine: Floats = fine, dose: Floats = dose) -> Sequence[float]:
            return ((np.interp(at - delay_s, fine, dose) - x[0]) / 5.0 / (1 + crowded * x[0]),)

        x = marched(slope, (first,), t, 12)
        out[f"step {k}"] = {"t": t, "u": np.interp(t, fine, dose), "c": noisy(rng, x[0], 0.03)}
    return out


BATTERY = '''
"""A battery with one resistance."""
time = 1.0
inputs = {"I": ("I", "A")}
channels = {"U": ("U", "V")}
constants = {"E": (3.5, "V", 2.5, 4.5), "R": (0.05, "ohm", 0.005, 0.5)}
says = {"I": "the current", "U": "the voltage", "R": "the resistance"}

def shown(t, x, u, c):
    return c.E - c.R * u.I
'''


def battery(rng: np.random.Generator) -> Tables:
    """Pulses of current; a polarisation follows them with a lag of 40 s."""
    out = {}
    for k in range(3):
        t = np.arange(700.0)
        current = held(np.arange(0, 700, 35), rng.uniform(-1, 5, 20), t)
        lag = np.zeros_like(t) + current[0]
        for n in range(1, len(t)):
            lag[n] = current[n - 1] + (lag[n - 1] - current[n - 1]) * np.exp(-1 / 40)
        out[f"pulse {k}"] = {"I": current, "U": noisy(rng, 3.7 - 0.03 * current - 0.02 * lag, 2e-3)}
    return out


GAUGE = '''
"""A force gauge."""
time = 10.0
inputs = {"F": ("F", "N"), "T": ("T", "K")}
channels = {"y": ("y", "mV")}
constants = {"a": (1.0, "mV/N", 0.1, 10.0), "y0": (0.0, "mV", -10.0, 10.0)}
says = {"F": "the load", "T": "the temperature", "y": "the output", "a": "the gain"}

def shown(t, x, u, c):
    return c.a * u.F + c.y0
'''


def gauge(rng: np.random.Generator, saturates: float, drift: float) -> Tables:
    """Loads and temperatures that move on their own; the gain saturates, or the output drifts with temperature."""
    out, t = {}, np.arange(400) / 10
    for k in range(3):
        F, T = 10 + 4.5 * wandering(rng, t, 2.0), 20 + 6 * wandering(rng, t, 5.0)
        F = np.clip(F, 0.0, None)
        y = 2 * F / (1 + F * saturates) + 0.4 + drift * (T - 20) ** 2
        out[f"load {k}"] = {"F": F, "T": T, "y": noisy(rng, y, 0.05, 0.5)}
    return out
