"""A straw as numbers: the paper's constants, the specimen's scatter, and the strengths of the concealed laws."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import log, pi

import numpy as np

from . import layout as at
from .integrator import integrate, rest
from .walls import table

RIGID = 1e4  # odd frusta stiffer than the paper's by this factor move the tip by less than 1 um at 35 kPa
DEPLOYED_M = 0.0020248  # where an unloaded active frustum rests

BASE = {
    "R_I": 0.0111, "R_O": 0.01465, "RHO": 1000.0, "GRAVITY": 9.795, "BASE_ANGLE": 0.5 * pi,
    "M_TIP": 0.01345, "I_TIP": 2.98691e-6, "R_CH": 0.40e-3,
    "COHESION_REACH": 0.3e-3, "FILM_GAP": 0.2e-3, "FILM_POWER": 3.0, "VISCOUS_FLOW": 2e-6, "VISCOUS_POWER": 0.85,
    "BUMP_WIDTH": 2e-3, "TAU_1": 0.1, "TAU_2": 1.0, "TAU_3": 10.0, "FRICTION_STATIC": 1.3, "FRICTION_STIFFNESS": 5e4,
    "FRICTION_SPEED": 2e-3, "DRAG_SPEED": 0.05, "PUSH_SPEED": 0.3,
}  # fmt: skip


@dataclass(frozen=True)
class Straw:
    """One specimen: ``laws`` by name of layout.NAMES; ``weaker`` factors on E of the active frusta, base first."""

    c_zeta: float = 20.0
    c_phi: float = 2e-3
    young_pa: float = 0.92e9
    thickness_m: float = 0.508e-3
    zeta_odd_m: float = 3.78e-3
    zeta_even_m: float = -2.28e-3
    odd_stiffness: float = RIGID
    weaker: tuple[float, ...] = (1.0,) * at.CELLS
    lean_rad: tuple[float, ...] = (0.0,) * at.CELLS
    stop_m: tuple[float, ...] = (1.0,) * at.CELLS
    laws: dict[str, float] = field(default_factory=dict, hash=False)

    def with_laws(self, **laws: float) -> Straw:
        return replace(self, laws={**self.laws, **laws})

    def numbers(self) -> tuple[np.ndarray, np.ndarray]:
        """The constants (len(layout.NAMES),) and the frusta's table (18, 8) of the compiled physics."""
        said = {**BASE, **self.laws}
        P = np.array([said.get(name, 0.0) for name in at.NAMES])
        wide, ratio = said["R_O"] - said["R_I"], log(said["R_O"] / said["R_I"])
        c1 = pi * self.young_pa * self.thickness_m / (8 * wide**3)
        c1 *= 0.5 * (said["R_O"] + said["R_I"]) - wide / ratio
        c2 = pi * self.young_pa * self.thickness_m**3 * ratio / (12 * wide**2)
        F = np.zeros((2 * at.CELLS, len(at.COLUMNS)))
        stiff = np.concatenate([np.full(at.CELLS, self.odd_stiffness), self.weaker])
        F[:, at.C1], F[:, at.C2] = c1 * stiff, c2 * stiff
        F[: at.CELLS, at.ZETA_0], F[at.CELLS :, at.ZETA_0] = self.zeta_odd_m, self.zeta_even_m
        F[at.CELLS :, at.PHI_SHIFT], F[at.CELLS :, at.STOP] = self.lean_rad, self.stop_m
        F[:, at.C_ZETA], F[:, at.C_PHI] = self.c_zeta, self.c_phi
        F[:, at.YOUNG] = self.young_pa * stiff
        if P[at.SHELL]:
            P = np.concatenate([P, table(self.zeta_even_m, self.thickness_m).ravel()])
        return P, F


@dataclass(frozen=True)
class Motion:
    """A run without instruments: tip (x, z, phi) at steps with its rates, inside pressure, energies, coordinates."""

    time_s: np.ndarray
    tip: np.ndarray
    tip_rate: np.ndarray
    pressure_pa: np.ndarray
    kinetic_j: np.ndarray
    power_pressure_w: np.ndarray
    power_damping_w: np.ndarray
    flow_m3_s: np.ndarray
    q: np.ndarray

    def at(self, time_s: np.ndarray) -> np.ndarray:
        """Tip (n, 3) at other times, by cubics through values and rates."""
        t = np.clip(time_s, self.time_s[0], self.time_s[-1])
        i = np.clip(np.searchsorted(self.time_s, t, side="right") - 1, 0, len(self.time_s) - 2)
        h = (self.time_s[i + 1] - self.time_s[i])[:, None]
        u = (t - self.time_s[i])[:, None] / h
        a, b = self.tip[i], self.tip[i + 1]
        va, vb = self.tip_rate[i] * h, self.tip_rate[i + 1] * h
        return a + u * (va + u * (3 * (b - a) - 2 * va - vb + u * (2 * (a - b) + va + vb)))


def rest_state(
    straw: Straw, deployed: tuple[int, ...], pressure_pa: float = 0.0, clock_zero_s: float = 0.0
) -> np.ndarray:
    """The 36 coordinates at rest with these cells (from 1) deployed and the others folded."""
    P, F = straw.numbers()
    q = np.zeros(at.COORDINATES)
    q[: at.CELLS] = straw.zeta_odd_m
    open_ = np.array([n + 1 in deployed for n in range(at.CELLS)])
    q[at.CELLS : 2 * at.CELLS] = np.where(open_, DEPLOYED_M * straw.zeta_even_m / -2.28e-3, straw.zeta_even_m)
    q[at.CELLS : 2 * at.CELLS] = np.minimum(q[at.CELLS : 2 * at.CELLS], straw.stop_m)
    P[at.CLOCK] = clock_zero_s
    if not rest(q, pressure_pa, P, F):
        raise RuntimeError(f"no rest state near {deployed} deployed")
    return q


def move(
    straw: Straw,
    deployed: tuple[int, ...],
    seconds: float,
    pressure_pa: np.ndarray,
    step_s: float = 1e-3,
    tolerance_m: float = 5e-8,
    clock_zero_s: float = 0.0,
) -> Motion:
    """Run from rest under a pressure (Pa) sampled every ``step_s`` from time 0; ``clock_zero_s`` ages the wall."""
    P, F = straw.numbers()
    q = rest_state(straw, deployed, float(pressure_pa[0]), clock_zero_s)
    drive = np.ascontiguousarray(pressure_pa, dtype=np.float64)
    rows, path, done = integrate(q, seconds, 0.0, step_s, drive, tolerance_m, 5e-3, P, F, clock_zero_s)
    if not done:
        raise RuntimeError(f"the straw could not be followed beyond {rows[-1, 0]:.3f} s")
    return Motion(rows[:, 0], rows[:, 1:4], rows[:, 4:7], *rows[:, 7:].T, path)
