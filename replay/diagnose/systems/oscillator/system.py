"""An oscillator as a system: its records, its library of causes, its simulation.

m y'' + c y' + k y + (what may be missing) = (1 + gain) u(t - late): mass known, c and k the base model's own constants.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import compiled
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown, in_order
from straw.replay.diagnose.numerical import jacobian
from straw.replay.diagnose.recording import Channel, Stretch
from straw.replay.diagnose.system import Differences, Level, System

Floats = NDArray[np.float64]

RATE_HZ, FINE = 750.0, 8  # output rate; steps of the input and of the integration to one of the output
#: Mass of the benchmark's oscillator (Noel and Schoukens 2016), kg.
MASS_KG = 2.0
#: Noise of y: band-limited, 8e-3 mm, as in the benchmark.
SIGMA_M = 8e-6
#: Velocity (m/s) over which dry friction sets in; a few per cent of the usual ones.
SLIDES_M_PER_S = 5e-3

TARGETS = (
    "base.c", "base.k", "cubic.k3", "quadratic_stiffness.k2", "quadratic_damping.c2", "friction.f",
    "branch.k1", "branch.tau", "bouc_wen.share", "bouc_wen.grow", "bouc_wen.turn", "input_gain.g", "clock_offset.t",
)  # fmt: skip


def _strength(target: str, scale: float, low: float = -8.0) -> Unknown:
    return Unknown(target, scale, sd=10.0, low=low, high=8.0)


def _shape(target: str, start: float, factor: float) -> Unknown:
    return Unknown(target, 1.0, start, "log", sd=1.0, low=-np.log(factor), high=np.log(factor))


#: Damping (N s/m) and stiffness (N/m) of the base; both start at twice the benchmark's.
BASE = (Unknown("base.c", 1.0, 20.0, "log", sd=2.0), Unknown("base.k", 0.3, 1e5, "log", sd=2.0))
#: Unknowns and starts of every cause, small effects first. Units are such that one is well seen.
LIBRARY: dict[str, tuple[tuple[Unknown, ...], tuple[tuple[float, ...], ...]]] = {
    "cubic_stiffness": ((_strength("cubic.k3", 3e9),), ((0.3,), (-0.3,), (3.0,), (-3.0,))),
    "quadratic_stiffness": ((_strength("quadratic_stiffness.k2", 3e6),), ((0.3,), (-0.3,))),
    "quadratic_damping": ((_strength("quadratic_damping.c2", 50.0, 0.0),), ((0.3,), (3.0,))),
    "dry_friction": ((_strength("friction.f", 1.0, 0.0),), ((0.3,), (3.0,))),
    "viscoelasticity": (
        (_strength("branch.k1", 5e3, 0.0), _shape("branch.tau", 5e-3, 100.0)),
        ((0.3, 0.0), (3.0, 0.0), (1.0, -2.0), (1.0, 2.0)),
    ),
    # a share of the stiffness acts through z, z' = y' - grow |y'| z - turn y' |z| (Bouc-Wen, normalised, nu = 1)
    "hysteresis": (
        (Unknown("bouc_wen.share", 0.1, sd=10.0, low=0.0, high=3.0), _shape("bouc_wen.grow", 1000.0, 10.0),
         Unknown("bouc_wen.turn", 500.0, kind="linear", sd=10.0, low=-8.0, high=8.0)),
        ((0.3, 0.0, 0.0), (4.0, 0.0, 0.0), (4.0, 0.0, 2.0), (4.0, 0.0, -2.0)),
    ),
    "input_gain": ((_strength("input_gain.g", 0.02),), ((0.5,), (-0.5,))),
    "clock_offset": ((_strength("clock_offset.t", 3e-4),), ((0.5,), (-0.5,))),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Record:
    """One record: u (N) at RATE_HZ * FINE, y (m) at times (n,)."""

    name: str
    force_n: Floats
    time_s: Floats
    y_m: Floats

    @property
    def seen(self) -> Floats:
        """y as the one channel, (1, n)."""
        return self.y_m[None, :]

    @property
    def events_s(self) -> Floats:
        """Nothing snaps."""
        return np.empty(0)

    @property
    def kind(self) -> str:
        """Every record is of its own kind."""
        return self.name

    def sigma(self) -> Floats:
        """Noise, (1, n)."""
        return np.full(self.seen.shape, SIGMA_M)

    def floor(self) -> Floats:
        """Noise, (1, n)."""
        return self.sigma()

    def stretches(self) -> list[Stretch]:
        """The whole record."""
        return [Stretch("the record", float(self.time_s[0]), float(self.time_s[-1]))]

    def conditions(self) -> Mapping[str, float]:
        """The amplitude of the force."""
        return {"the size of the force": float(np.std(self.force_n))}


@compiled
def _slope(y: float, v: float, s: float, z: float, u: float, k: Floats) -> tuple[float, float, float, float]:
    force = (
        k[0] * v
        + k[1] * ((1 - k[8]) * y + k[8] * z)
        + k[2] * y**3
        + k[3] * y**2
        + k[4] * abs(v) * v
        + k[5] * np.tanh(v / SLIDES_M_PER_S)
    )
    return v, (u - force - s) / MASS_KG, k[6] * v - s / k[7], v - k[9] * abs(v) * z - k[10] * v * abs(z)


@compiled
def played(force_n: Floats, k: Floats, step_s: float) -> Floats:
    """y (m) at every second sample of the force, from rest, by the classical Runge-Kutta rule."""
    out = np.zeros((len(force_n) + 1) // 2)
    y, v, s, z, h = 0.0, 0.0, 0.0, 0.0, step_s
    for i in range(len(out) - 1):
        u0, u1, u2 = force_n[2 * i], force_n[2 * i + 1], force_n[2 * i + 2]
        a0, a1, a2, a3 = _slope(y, v, s, z, u0, k)
        b0, b1, b2, b3 = _slope(y + h / 2 * a0, v + h / 2 * a1, s + h / 2 * a2, z + h / 2 * a3, u1, k)
        c0, c1, c2, c3 = _slope(y + h / 2 * b0, v + h / 2 * b1, s + h / 2 * b2, z + h / 2 * b3, u1, k)
        d0, d1, d2, d3 = _slope(y + h * c0, v + h * c1, s + h * c2, z + h * c3, u2, k)
        y += h / 6 * (a0 + 2 * b0 + 2 * c0 + d0)
        v += h / 6 * (a1 + 2 * b1 + 2 * c1 + d1)
        s += h / 6 * (a2 + 2 * b2 + 2 * c2 + d2)
        z += h / 6 * (a3 + 2 * b3 + 2 * c3 + d3)
        out[i + 1] = y
    return out


#: Units of the constants.
UNITS = {
    "base.c": "N s/m", "base.k": "N/m", "cubic.k3": "N/m^3", "quadratic_stiffness.k2": "N/m^2",
    "quadratic_damping.c2": "N s^2/m^2", "friction.f": "N", "branch.k1": "N/m", "branch.tau": "s",
    "bouc_wen.grow": "1/m", "bouc_wen.turn": "1/m", "clock_offset.t": "s",
}  # fmt: skip
#: An oscillator that swings farther than this, m, counts as diverged.
FARTHEST_M = 1.0


@dataclass(frozen=True, eq=False)
class OscillatorSystem(System):
    """The oscillator with some causes; derivatives by central differences."""

    library: tuple[str, ...] = tuple(LIBRARY)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The displacement."""
        return (Channel("y_m", "y", "mm", 1e3),)

    @property
    def base(self) -> tuple[Unknown, ...]:
        """Damping and stiffness."""
        return BASE

    @property
    def causes(self) -> tuple[str, ...]:
        """The library's."""
        return self.library

    @property
    def faults(self) -> frozenset[str]:
        """Of the recording."""
        return frozenset(("input_gain", "clock_offset"))

    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        """Causes of the library together."""
        unknowns = tuple(u for name in names for u in LIBRARY[name][0])
        starts = (sum(parts, ()) for parts in itertools.product(*(LIBRARY[name][1] for name in names)))
        at = (tuple(k.at(s) for k, s in zip(unknowns, start, strict=True)) for start in starts)
        return Hypothesis(in_order(names, self.faults), unknowns, tuple(at), self.faults)

    def misfit(
        self,
        recording: Record,
        unknowns: Sequence[Unknown],
        u: Floats,
        *,
        level: Level = Level.FINE,
        derivatives: bool = False,
    ) -> Differences | None:
        """Differences of a record, all samples; None where the oscillator diverges."""

        def in_sigmas(at: Floats) -> Floats | None:
            y = _seen(recording, unknowns, at)
            return None if y is None else np.append((y - recording.y_m) / SIGMA_M, 0.0)

        vector = in_sigmas(u)
        if vector is None:
            return None
        slopes = jacobian(in_sigmas, unknowns, u, vector) if derivatives else np.empty((0, 0))
        played_times = 1 + 2 * len(unknowns) * derivatives
        return Differences(vector, slopes, vector[None, :-1] * SIGMA_M, played_times * len(recording.force_n) // 2)

    def size(self, recording: Record, level: Level) -> int:
        """All samples, and one for events, of which there are none."""
        return len(recording.y_m) + 1

    def named(self, unknown: Unknown) -> tuple[str, str, str]:
        """Cause, constant and unit of an unknown."""
        cause = next((name for name, (known, _) in LIBRARY.items() if unknown in known), "base")
        return cause, unknown.target.partition(".")[2], UNITS.get(unknown.target, "1")

    def equation(self, unknown: Unknown) -> tuple[str, str] | None:
        """Damping and stiffness stand in the one equation there is."""
        words = {"base.c": ("dissipation", "damping c"), "base.k": ("restoring force", "stiffness k")}
        return words.get(unknown.target)


def _seen(record: Record, unknowns: Sequence[Unknown], at: Floats) -> Floats | None:
    """y (n,) at the record's times with the unknowns at u; None where it cannot be followed."""
    constants = dict.fromkeys(TARGETS, 0.0) | {"branch.tau": 1.0}
    constants |= {k.target: k.value(float(u)) for k, u in zip(unknowns, at, strict=True)}
    y = played(
        (1 + constants["input_gain.g"]) * record.force_n,
        np.array([constants[target] for target in TARGETS]),
        2 / (RATE_HZ * FINE),
    )
    grid = np.arange(len(y)) * 2 / (RATE_HZ * FINE)
    seen = np.interp(record.time_s - constants["clock_offset.t"], grid, y)
    return seen if np.abs(seen).max() < FARTHEST_M else None
