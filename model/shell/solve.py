"""Equilibrium of a held shell at dictated (zeta, phi): Newton's method, each step put in through the tangent."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve, eigvalsh, lu_factor, lu_solve

from straw.model.errors import ModelError
from straw.model.shell.creases import Creases
from straw.model.shell.hold import Held, Hold
from straw.model.shell.mesh import Mesh, Shell
from straw.model.shell.pressure import Enclosed
from straw.model.shell.profile import Profile
from straw.model.shell.strain import Floats

#: Newton has arrived when its step is this small against the wall's own length: it squares its error.
CLOSE = 1e-9
NEWTON_LIMIT = 12
#: Longest step of the small base put in at once, as height at the rim over the wall's height and length; halved
#: where Newton does not arrive, this often.
LONGEST_STEP, HALVINGS = 0.12, 6


@dataclass(frozen=True)
class Point:
    """A shell in balance at (zeta, phi); SI. With pressure, energy and forces are those of U - p V.

    ``stiffness`` is the Hessian of the energy by (zeta, phi): N/m, N, N m. ``stable`` says whether every displacement
    of the wall between its bases, even about the bending plane, is pushed back.
    """

    zeta_m: float
    phi_rad: float
    energy_j: float
    force_n: float
    moment_n_m: float
    stiffness: Floats
    stretching_j: float
    bending_j: float
    volume_m3: float
    volume_slope: Floats  # dV by (zeta, phi), the wall following
    base_area_m2: float  # of the small base, as its rim has moved
    stable: bool
    y: Floats
    tangent: Floats  # dy by (zeta, phi)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Energy, force, moment, the three stiffnesses and the parts of the energy."""
        (zz, zf), (_, ff) = self.stiffness
        return self.energy_j, self.force_n, self.moment_n_m, zz, zf, ff, self.stretching_j, self.bending_j


class NotFoundError(ModelError):
    """No equilibrium was found at a point; the message says where."""


class Model:
    """A shell, how it is held, and what loads it; ``at`` finds equilibria."""

    def __init__(
        self,
        profile: Profile,
        E_pa: float,
        nu: float,
        mesh: Mesh | None = None,
        hold: Hold | None = None,
        pressure_pa: float = 0.0,
    ) -> None:
        if not np.isfinite(pressure_pa):
            raise ModelError(f"shell: pressure_pa = {pressure_pa}, expected a number")
        self.shell = Shell(profile, E_pa, nu, mesh or Mesh())
        self.held = Held(self.shell, hold or Hold())
        self.creases = Creases(self.shell)
        self.enclosed = Enclosed(self.shell)
        self.pressure_pa = pressure_pa
        self.length_m = sum(w.length_m for w in profile.walls) / len(profile.walls)
        # what makes unknowns comparable: places in units of the wall's length, directors as they are
        field = (np.arange(self.shell.size) // self.shell.per_field) % 6
        scale = np.where(field < 3, self.length_m, 1.0)
        weights = abs(self.held.T).T
        self.scale: Floats = np.asarray(weights @ scale) / np.asarray(weights @ np.ones(self.shell.size))

    def under(self, pressure_pa: float) -> Model:
        """The same shell under another pressure."""
        other = copy.copy(self)
        other.pressure_pa = pressure_pa
        return other

    def derivatives(self, q: Floats, phi_rad: float) -> tuple[float, Floats, Floats, float, float, Floats]:
        """Energy, gradient and Hessian by q; the energy's own first, second and mixed derivative by phi."""
        energy, g, H = self.shell.derivatives(q)
        by_phi = by_phi2 = 0.0
        mixed = np.zeros_like(g)
        if self.creases.joints:
            more, by_phi, by_phi2, mixed = self.creases.add(q, phi_rad, g, H)
            energy += more
        if self.held.springs.nnz:
            pull = self.held.springs @ (q - self.shell.unloaded)
            energy += 0.5 * float((q - self.shell.unloaded) @ pull)
            g += pull
            H += self.held.springs.toarray()
        if self.pressure_pa:
            energy -= self.pressure_pa * self.enclosed.add(q, -self.pressure_pa, g, H)
        return energy, g, H, by_phi, by_phi2, mixed

    def at(self, zeta_m: float, phi_rad: float, near: Point | None = None) -> Point:
        """Equilibrium at (zeta, phi), reached from a known one or from the unloaded shape in steps.

        Raises NotFoundError where Newton's method does not arrive, naming the point.
        """
        point = near or self._point(self.held.start, self.shell.profile.height_m, 0.0)
        begin = np.array([point.zeta_m, point.phi_rad])
        way = np.array([zeta_m, phi_rad]) - begin
        reach = (abs(way[0]) + self.held.r_i * abs(way[1])) / self.length_m
        share, done, halvings = 1 / max(1, math.ceil(reach / LONGEST_STEP)), 0.0, 0
        while done < 1:
            to = 1.0 if done + share > 1 - 1e-9 else done + share
            zeta, phi = (zeta_m, phi_rad) if to == 1 else begin + way * to
            found = self._newton(point, float(zeta), float(phi))
            if found is not None:
                point, done = found, to
                continue
            halvings, share = halvings + 1, share / 2
            if halvings > HALVINGS:
                raise NotFoundError(
                    f"shell: no equilibrium found at zeta = {zeta * 1e3:.3f} mm, phi = {phi:.4f} rad; "
                    "the wall may be stretched beyond its length there"
                )
        return point

    def _newton(self, near: Point, zeta: float, phi: float) -> Point | None:
        """Equilibrium at (zeta, phi), begun along the tangent of a near one; None where it does not arrive."""
        y = near.y + near.tangent @ np.array([zeta - near.zeta_m, phi - near.phi_rad])
        for _ in range(NEWTON_LIMIT):
            q = self.held.place(y, zeta, phi)
            _, g, H, *_ = self.derivatives(q, phi)
            T, *_ = self.held.moving(y, phi)
            factored = _factor(_times(_times(H, T).T, T))
            if factored is None:
                return None
            step = _solve(factored, T.T @ g)
            size = float(np.abs(step / self.scale).max())
            if not size < 1.0:
                return None
            y = y - step
            if size < CLOSE**0.5:  # what is left after this step is about its square
                return self._point(y, zeta, phi)
        return None

    def _point(self, y: Floats, zeta: float, phi: float) -> Point:
        q = self.held.place(y, zeta, phi)
        energy, g, H, own, own2, mixed = self.derivatives(q, phi)
        volume, volume_g = self.enclosed.slope(q)
        T, turning, by_phi, by_phi2 = self.held.moving(y, phi)
        HT = _times(H, T)
        K = _times(HT.T, T)
        factored = _factor(K)
        C = np.column_stack([self.held.by_zeta, by_phi])
        L_cc = C.T @ (H @ C)
        L_yc = HT.T @ C
        L_yc[:, 1] += T.T @ mixed
        L_cc[1, 1] += g @ by_phi2 + own2 + 2 * float(mixed @ by_phi)
        L_cc[0, 1] += mixed @ self.held.by_zeta
        L_cc[1, 0] = L_cc[0, 1]
        if turning is not None:
            L_yc[:, 1] += turning.T @ g
        tangent = -_solve(factored, L_yc) if factored else np.full_like(L_yc, np.nan)
        stiffness = L_cc + L_yc.T @ tangent
        stretching, bending = self.shell.energy(q)
        return Point(
            zeta,
            phi,
            energy,
            float(g @ self.held.by_zeta),
            float(g @ by_phi) + own,
            stiffness,
            stretching,
            bending,
            volume,
            volume_g @ C + (T.T @ volume_g) @ tangent,
            self.enclosed.base_area(q),
            bool(factored and factored[0] == "cholesky"),
            y,
            tangent,
        )

    def softest(self, point: Point, count: int = 3) -> Floats:
        """Least eigenvalues of the held wall's stiffness, in units of its scaled unknowns, J: its own buckling."""
        q = self.held.place(point.y, point.zeta_m, point.phi_rad)
        H = self.derivatives(q, point.phi_rad)[2]
        T = self.held.moving(point.y, point.phi_rad)[0]
        K = _times(_times(H, T).T, T) * self.scale * self.scale[:, None]
        return np.asarray(eigvalsh(K, subset_by_index=(0, count - 1)))


Factored = tuple[str, Any]


def _times(A: Floats, T: object) -> Floats:
    """A T for a dense A and sparse T."""
    return np.ascontiguousarray((T.T @ A.T).T)  # type: ignore[attr-defined]


def _factor(K: Floats) -> Factored | None:
    """Cholesky's factors where K is positive definite, LU's where the wall itself gives way, None where singular."""
    try:
        return "cholesky", cho_factor(K, check_finite=False)
    except LinAlgError:
        pass
    if not np.all(np.isfinite(K)):
        return None
    factors = lu_factor(K, check_finite=False)
    return ("lu", factors) if np.all(np.diag(factors[0]) != 0) else None


def _solve(factored: Factored, b: Floats) -> Floats:
    kind, factors = factored
    return np.asarray((cho_solve if kind == "cholesky" else lu_solve)(factors, b, check_finite=False))
