"""One elastic frustum at rest (equations 6 and 7): energy, forces, all equilibria and where pressure makes them vanish.

Everything is in closed form. With phi = 0 equation 6a is one cubic in zeta; with phi != 0 equation 6b gives
3 r_i^2 phi^2 = 4 zeta_0^2 - 12 zeta^2 - C2 / C1, which turns 6a into another. Other terms of a straw are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Equilibrium:
    """A frustum in balance; ``stiffness`` holds the eigenvalues of the Jacobian of 6a, 6b by (zeta / r_i, phi), N m."""

    zeta_m: float
    phi_rad: float
    stiffness: tuple[float, float]

    @property
    def stable(self) -> bool:
        """Whether every small displacement is pushed back."""
        return min(self.stiffness) > 0


@dataclass(frozen=True)
class Frustum:
    """Constants of one frustum; ``area_m2`` is what pressure pushes on: axial force area_m2 times p on zeta.

    C3 is the frustum's own face (equation 6a, Fig. 5). In a straight sealed straw the end pulls as well, with
    pi r_i^2 p, and the sum is dV/dzeta.
    """

    C1: float
    C2: float
    r_i: float
    zeta0: float
    area_m2: float

    def energy(self, zeta_m: Floats, phi_rad: Floats, pressure_pa: float = 0.0) -> Floats:
        """Potential energy, J (equation 7), zero at (zeta_0, 0) without pressure; arguments broadcast."""
        r2, k = self.r_i**2, self.C2 - 4 * self.C1 * self.zeta0**2
        here = (
            _bending(self.C1, k, r2, zeta_m, phi_rad) - (2 * self.C2 * self.zeta0 + self.area_m2 * pressure_pa) * zeta_m
        )
        there = _bending(self.C1, k, r2, np.asarray(self.zeta0), np.asarray(0.0)) - 2 * self.C2 * self.zeta0**2
        return np.asarray(here - there)

    def force(self, zeta_m: float, phi_rad: float, pressure_pa: float = 0.0) -> tuple[float, float]:
        """Axial force (N) and moment (N m) that hold the frustum there (equations 6a, 6b)."""
        z, r2f2, C1, C2, z0 = zeta_m, (self.r_i * phi_rad) ** 2, self.C1, self.C2, self.zeta0
        F = 4 * C1 * z * (2 * z**2 - 2 * z0**2 + 3 * r2f2) + 2 * C2 * (z - z0) - self.area_m2 * pressure_pa
        return F, self.r_i**2 * phi_rad * (C1 * (12 * z**2 - 4 * z0**2 + 3 * r2f2) + C2)

    def stiffness(self, zeta_m: float, phi_rad: float) -> Floats:
        """Jacobian of (r_i F, M) by (zeta / r_i, phi), N m, shape (2, 2); it is symmetric."""
        z, r, f, C1, C2, z0 = zeta_m, self.r_i, phi_rad, self.C1, self.C2, self.zeta0
        both = 24 * C1 * r**3 * z * f
        axial = r**2 * (24 * C1 * z**2 - 8 * C1 * z0**2 + 12 * C1 * (r * f) ** 2 + 2 * C2)
        bending = r**2 * (C1 * (12 * z**2 - 4 * z0**2 + 9 * (r * f) ** 2) + C2)
        return np.array([[axial, both], [both, bending]])

    def equilibria(self, pressure_pa: float = 0.0) -> list[Equilibrium]:
        """Every equilibrium at a pressure: first phi = 0, then pairs +-phi; each from the largest zeta down."""
        return self.straight(pressure_pa) + self.bent(pressure_pa)

    def straight(self, pressure_pa: float = 0.0) -> list[Equilibrium]:
        """Every equilibrium with phi = 0, from the largest zeta down."""
        found = self._straight_heights(pressure_pa)
        return [Equilibrium(z, 0.0, _eigenvalues(self.stiffness(z, 0.0))) for z in found]

    def bent(self, pressure_pa: float = 0.0) -> list[Equilibrium]:
        """Every other equilibrium, in pairs +-phi, from the largest zeta down."""
        pairs = [(z, phi) for z in self._bent_heights(pressure_pa) if (phi := self.bent_angle(z)) > 0]
        found = [(z, sign * phi) for z, phi in pairs for sign in (1, -1)]
        return [Equilibrium(z, phi, _eigenvalues(self.stiffness(z, phi))) for z, phi in found]

    def _straight_heights(self, pressure_pa: float) -> list[float]:
        C1, C2, z0 = self.C1, self.C2, self.zeta0
        push = 2 * C2 * z0 + self.area_m2 * pressure_pa
        return _real_roots([8 * C1, 0.0, 2 * C2 - 8 * C1 * z0**2, -push])

    def _bent_heights(self, pressure_pa: float) -> list[float]:
        C1, C2, z0 = self.C1, self.C2, self.zeta0
        push = 2 * C2 * z0 + self.area_m2 * pressure_pa
        return _real_roots([-40 * C1, 0.0, 8 * C1 * z0**2 - 2 * C2, -push])

    def bent_angle(self, zeta_m: float) -> float:
        """|phi| at which equation 6b vanishes beside phi = 0, rad; 0 where there is none."""
        square = (4 * self.zeta0**2 - 12 * zeta_m**2 - self.C2 / self.C1) / 3
        return math.sqrt(square) / self.r_i if square > 0 else 0.0

    def pressure_at(self, zeta_m: float, phi_rad: float) -> float:
        """Pressure under which nothing but pressure is needed to hold the frustum at this zeta, Pa (F = 0 in 6a)."""
        return self.force(zeta_m, phi_rad)[0] / self.area_m2

    def bifurcation_pressures(self) -> tuple[float, float, float, float]:
        """The four pressures that part the five regions of Fig. 5, Pa, rising.

        Outer two: the axisymmetric states lose stability, at 12 zeta^2 = 4 zeta_0^2 - C2 / C1 to bending and to
        compression at once (there F' = 2 r_i^-2 M'). Inner two: the antisymmetric states turn unstable, where the
        second cubic has its extremes, at 60 zeta^2 = 4 zeta_0^2 - C2 / C1.
        """
        width = 4 * self.zeta0**2 - self.C2 / self.C1
        if width <= 0:
            raise ModelError(f"frustum: zeta0 = {self.zeta0} m is too flat for its thickness; it has one state only")
        axisymmetric, bent = math.sqrt(width / 12), math.sqrt(width / 60)
        pressures = [self.pressure_at(z, 0.0) for z in (axisymmetric, -axisymmetric)]
        pressures += [self.pressure_at(z, self.bent_angle(z)) for z in (bent, -bent)]
        low, inner_low, inner_high, high = sorted(pressures)
        return low, inner_low, inner_high, high


def _bending(C1: float, k: float, r2: float, zeta: Floats, phi: Floats) -> Floats:
    """Equation 7 without its part linear in zeta, J."""
    zeta2, r2f2 = np.square(zeta), r2 * np.square(phi)
    return np.asarray(2 * C1 * zeta2**2 + k * zeta2 + 0.75 * C1 * r2f2**2 + k / 2 * r2f2 + 6 * C1 * zeta2 * r2f2)


def _real_roots(coefficients: list[float]) -> list[float]:
    """Real roots of a cubic, from the largest down."""
    roots = np.roots(coefficients)
    return sorted((float(z.real) for z in roots if abs(z.imag) <= 1e-9 * abs(z)), reverse=True)


def _eigenvalues(K: Floats) -> tuple[float, float]:
    low, high = np.linalg.eigvalsh(K)
    return float(low), float(high)
