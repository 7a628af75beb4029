"""One frustum at rest whose energy is a table of finite elements; as `straw.model.frustum` for equation 7."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from straw.model.errors import ModelError
from straw.model.frustum import Frustum
from straw.model.parameters import StrawParameters
from straw.model.terms.shell_energy import SHARE, shell_energy, shell_force, shell_stiffness

Floats = NDArray[np.float64]

#: Heights at which a sign is looked for, between plus and minus this share of the table's end: 0.03 mm apart for the
#: paper's frustum, where equilibria are 0.3 mm apart or more.
HEIGHTS, REACH = 201, 0.85
#: Bending angles are looked for up to this height of the rim over the table's end.
LARGEST_TILT = 0.95


@dataclass(frozen=True)
class TableFrustum(Frustum):
    """A frustum with a row of `straw.model.terms.shell_energy` in place of equation 7, or for its share beside it."""

    numbers: tuple[float, ...] = ()

    @cached_property
    def row(self) -> Floats:
        """The row as an array."""
        return np.array(self.numbers)

    def energy(self, zeta_m: Floats, phi_rad: Floats, pressure_pa: float = 0.0) -> Floats:
        """Potential energy, J, zero at (zeta_0, 0) without pressure; arguments broadcast."""
        zeta, phi = np.broadcast_arrays(np.asarray(zeta_m, dtype=float), np.asarray(phi_rad, dtype=float))
        flat = [shell_energy(z, f, self.r_i, self.row) for z, f in zip(zeta.ravel(), phi.ravel(), strict=True)]
        shell = np.reshape(flat, zeta.shape) - shell_energy(self.zeta0, 0.0, self.r_i, self.row)
        share = self.row[SHARE]
        return np.asarray(share * shell + (1 - share) * super().energy(zeta, phi) - self.area_m2 * pressure_pa * zeta)

    def force(self, zeta_m: float, phi_rad: float, pressure_pa: float = 0.0) -> tuple[float, float]:
        """Axial force (N) and moment (N m) that hold the frustum there."""
        F, M = shell_force(float(zeta_m), float(phi_rad), self.r_i, self.row)
        share = self.row[SHARE]
        other, turning = super().force(zeta_m, phi_rad) if share != 1 else (0.0, 0.0)
        return -share * F + (1 - share) * other - self.area_m2 * pressure_pa, -share * M + (1 - share) * turning

    def stiffness(self, zeta_m: float, phi_rad: float) -> Floats:
        """Jacobian of (r_i F, M) by (zeta / r_i, phi), N m, shape (2, 2)."""
        zz, zf, ff = shell_stiffness(float(zeta_m), float(phi_rad), self.r_i, self.row)
        shell = np.array([[self.r_i**2 * zz, self.r_i * zf], [self.r_i * zf, ff]])
        return np.asarray(self.row[SHARE] * shell + (1 - self.row[SHARE]) * super().stiffness(zeta_m, phi_rad))

    def bent_angle(self, zeta_m: float) -> float:
        """|phi| at which the moment vanishes beside phi = 0, rad; 0 where there is none."""
        most = (LARGEST_TILT * self.row[0] - abs(zeta_m)) / self.r_i
        if most <= 0:
            return 0.0

        def leverage(phi: float) -> float:
            return self.force(zeta_m, phi)[1] / phi

        return _root(leverage, 1e-3, most) if leverage(1e-3) < 0 < leverage(most) else 0.0

    def _straight_heights(self, pressure_pa: float) -> list[float]:
        return _roots(lambda zeta: self.force(zeta, 0.0, pressure_pa)[0], self._heights)

    def _bent_heights(self, pressure_pa: float) -> list[float]:
        return _roots(lambda zeta: self._bent_force(zeta, pressure_pa), self._heights)

    @property
    def _heights(self) -> Floats:
        return np.asarray(np.linspace(1, -1, HEIGHTS) * REACH * self.row[0])

    def _bent_force(self, zeta: float, pressure_pa: float) -> float:
        phi = self.bent_angle(zeta)
        return self.force(zeta, phi, pressure_pa)[0] if phi > 0 else math.nan

    def bifurcation_pressures(self) -> tuple[float, float, float, float]:
        """The four pressures that part the five regions of Fig. 5, Pa, rising: extremes of p along each branch.

        Straight states of this energy snap straight before they tilt, so that theirs are extremes of p as well.
        """
        reach = abs(self.zeta0)

        def straight(zeta: float) -> float:
            return self.force(zeta, 0.0)[0] / self.area_m2

        def bent(zeta: float) -> float:
            return self.force(zeta, self.bent_angle(zeta))[0] / self.area_m2

        high = _extreme(straight, (-reach, -0.2 * reach), 1)
        low = _extreme(straight, (0.2 * reach, reach), -1)
        inner_high = _extreme(bent, (0.0, 0.45 * reach), 1)
        inner_low = _extreme(bent, (-0.45 * reach, 0.0), -1)
        return low, inner_low, inner_high, high


def frustum_of(straw: StrawParameters, cell: int = 1, *, sealed: bool = False) -> Frustum:
    """The even (active) frustum of a cell, alone or carrying the pull of the straw's sealed end."""
    if not 1 <= cell <= straw.cells:
        raise ModelError(f"frustum: cell {cell} is not in a straw of {straw.cells} cells")
    c, place = straw.constants(), (cell - 1, 1)
    area_m2 = float(c.S if sealed else c.C3)
    own = (float(c.C1[place]), float(c.C2[place]), float(c.r_i), float(c.zeta0[place]), area_m2)
    return TableFrustum(*own, tuple(c.wall[place].tolist())) if c.wall[place][0] > 0 else Frustum(*own)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    return float(brentq(function, low, high, xtol=1e-12))


def _roots(function: Callable[[float], float], points: Floats) -> list[float]:
    """Roots between neighbouring points, in their order; no number, no root."""
    values = np.array([function(float(x)) for x in points])
    return [
        _root(function, *sorted((float(points[i]), float(points[i + 1]))))
        for i in range(len(points) - 1)
        if values[i] * values[i + 1] < 0
    ]


def _extreme(function: Callable[[float], float], bounds: tuple[float, float], sign: int) -> float:
    """Largest (sign 1) or least (-1) value between bounds."""

    def turned(x: float) -> float:
        return -sign * function(float(x))

    best = minimize_scalar(turned, bounds=bounds, method="bounded", options={"xatol": 1e-9})
    return -sign * turned(float(best.x))
