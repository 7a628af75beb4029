"""An oscillator for the diagnosis in place of the straw: its records, its library of causes, its campaign.

m y'' + c y' + k y + (what may be missing) = (1 + gain) u(t - late): mass known, c and k the base model's own constants.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Any

import numba
import numpy as np

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown

RATE_HZ, FINE = 750.0, 8  # output rate; steps of the input and of the integration to one of the output
MASS_KG = 2.0
#: Noise of y: band-limited, 8e-3 mm, as in the benchmark.
SIGMA_M = 8e-6
#: A velocity (m/s) below which dry friction is not there yet; a few per cent of what occurs.
SLIDES_M_PER_S = 5e-3

TARGETS = (
    "base.c", "base.k", "cubic.k3", "quadratic_stiffness.k2", "quadratic_damping.c2", "friction.f",
    "branch.k1", "branch.tau", "bouc_wen.share", "bouc_wen.grow", "bouc_wen.turn", "input_gain.g", "clock_offset.t",
)  # fmt: skip


def _strength(target: str, scale: float, low: float = -8.0) -> Unknown:
    return Unknown(target, scale, sd=10.0, low=low, high=8.0)


def _shape(target: str, start: float, factor: float) -> Unknown:
    return Unknown(target, 1.0, start, "log", sd=1.0, low=-np.log(factor), high=np.log(factor))


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
    """One record: u (N) at RATE_HZ * FINE, y (m) at times (n,); ``tip`` is y by thirds, (3, n / 3): a judge's rows."""

    name: str
    force_n: np.ndarray
    time_s: np.ndarray
    y_m: np.ndarray
    snaps_s: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def tip(self) -> np.ndarray:
        return self.y_m.reshape(3, -1)


@dataclass(frozen=True, eq=False)
class Difference:
    """Prediction minus record, m, and the same in sigmas as one vector; no timing, as nothing snaps."""

    plain: np.ndarray

    @property
    def vector(self) -> np.ndarray:
        return np.append(self.plain / SIGMA_M, 0.0)


@numba.njit
def _slope(y: float, v: float, s: float, z: float, u: float, k: np.ndarray) -> tuple[float, float, float, float]:
    force = (
        k[0] * v
        + k[1] * ((1 - k[8]) * y + k[8] * z)
        + k[2] * y**3
        + k[3] * y**2
        + k[4] * abs(v) * v
        + k[5] * np.tanh(v / SLIDES_M_PER_S)
    )
    return v, (u - force - s) / MASS_KG, k[6] * v - s / k[7], v - k[9] * abs(v) * z - k[10] * v * abs(z)


@numba.njit(nogil=True)
def played(force_n: np.ndarray, k: np.ndarray, step_s: float) -> np.ndarray:
    """y (m) at every second sample of the force, from rest, by the classical Runge-Kutta rule."""
    out = np.zeros((len(force_n) + 1) // 2)
    y = v = s = z = 0.0
    for i in range(len(out) - 1):
        u0, u1, u2 = force_n[2 * i], force_n[2 * i + 1], force_n[2 * i + 2]
        h = step_s
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


def difference(record: Record, unknowns: Sequence[Unknown], at: np.ndarray) -> Difference | None:
    """How a model with the unknowns at u differs from a record; None where it cannot be followed."""
    constants = dict.fromkeys(TARGETS, 0.0) | {"branch.tau": 1.0}
    constants |= {k.target: k.value(float(u)) for k, u in zip(unknowns, at, strict=True)}
    k = np.array([constants[target] for target in TARGETS])
    y = played((1 + constants["input_gain.g"]) * record.force_n, k, 2 / (RATE_HZ * FINE))
    grid = np.arange(len(y)) * 2 / (RATE_HZ * FINE)
    seen = np.interp(record.time_s - constants["clock_offset.t"], grid, y)
    return Difference((seen - record.y_m).reshape(1, -1)) if np.abs(seen).max() < 1.0 else None


class Oscillators(Campaign):
    """A campaign of records, which `descend`, `looks`, `enter`, `finish` and `judge` take for one of straws."""

    def __init__(
        self,
        records: Sequence[Record],
        library: Sequence[str],
        pool: Executor,
        stop: Callable[[], bool] = lambda: False,
    ) -> None:
        super().__init__(records, None, pool, stop)  # type: ignore[arg-type]
        self.library = tuple(library)

    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        """Causes of this library together."""
        unknowns = tuple(u for name in names for u in LIBRARY[name][0])
        starts = (sum(parts, ()) for parts in itertools.product(*(LIBRARY[name][1] for name in names)))
        at = (tuple(k.at(s) for k, s in zip(unknowns, start, strict=True)) for start in starts)
        return Hypothesis(tuple(names), unknowns, tuple(at))

    def misfits(self, unknowns: Sequence[Unknown], points: Sequence[np.ndarray]) -> list[list[Difference | None]]:
        """Differences of every record at every point."""
        jobs = [[self.pool.submit(difference, o, tuple(unknowns), p) for o in self.observations] for p in points]
        found = [[job.result() for job in row] for row in jobs]
        self.tally["played"] += sum(map(len, found))
        self.tally["failed"] += sum(one is None for row in found for one in row)
        return found

    def residuals(self, unknowns: Sequence[Unknown], points: Sequence[np.ndarray]) -> list[np.ndarray]:
        """All differences of all records in sigmas as one vector for each point."""
        rows = self.misfits(unknowns, points)
        return [self.stacked([None if one is None else one.vector for one in row]) for row in rows]

    def _like(self, observations: Sequence[Record], how: Callable[..., Any]) -> Oscillators:
        out = Oscillators(observations, self.library, self.pool, self.stop)
        out.how, out.tally = how, self.tally
        return out
