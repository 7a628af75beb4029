"""How a shell is held: bases dictated over (zeta, phi), rims tied, free or elastic, creases; both readings of phi.

The paper's finite elements dictate "the displacement of the small base along z", and its equation 1 gives each
material point the height zeta - r_i phi cos(theta), whatever its radius has become: that is the reading "material".
In the reading "plane" the deformed points lie in the plane z = zeta - (x - mean x) tan(phi). Radial freedom of the
bases is not stated in the paper; held bases have barriers of 60 to 320 mJ against the 22 mJ of its Fig. 4, so "free"
must be meant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from straw.model.errors import ModelError
from straw.model.shell.mesh import SINES, Shell
from straw.model.shell.strain import Floats

READINGS = ("material", "plane")
X, Y, Z = 0, 1, 2


@dataclass(frozen=True)
class Hold:
    """How bases and rims are held.

    ``rims``: of a cell, the two large bases in the plane: "tied", "free", or a stiffness in N/m per m of rim.
    ``bases``: the small bases' radial freedom (of a frustum both bases'): "free", "held", or such a stiffness.
    """

    reading: str = "material"
    rims: str | float = "tied"
    bases: str | float = "free"

    def __post_init__(self) -> None:
        if self.reading not in READINGS:
            raise ModelError(f"shell: reading of phi {self.reading!r}, expected one of {', '.join(READINGS)}")
        for name, words in (("rims", ("tied", "free")), ("bases", ("free", "held"))):
            value = getattr(self, name)
            good = value in words if isinstance(value, str) else math.isfinite(value) and value >= 0
            if not good:
                raise ModelError(f"shell: {name} {value!r}, expected {' or '.join(words)} or a stiffness in N/m per m")


class Held:
    """Coefficients q = c(zeta, phi) + T(phi) y of a shell that is held, with y (free,) free to find equilibrium."""

    def __init__(self, shell: Shell, hold: Hold) -> None:
        self.shell, self.hold = shell, hold
        self.harmonics = range(shell.per_field)
        self.top = len(shell.profile.walls) - 1
        self.r_i = shell.profile.r_i_m
        self._follows: dict[int, tuple[int, float]] = {}
        self._fixed: dict[int, float] = {}
        self._by_phi: list[int] = []  # places that take -tan(phi) of x in the reading "plane"
        self._springs: list[tuple[int, int | None, float]] = []
        self._bottom()
        self._small_base()
        if self.top:
            self._rims()
        self._symmetric()
        self._assemble()

    def _symmetric(self) -> None:
        """sin(0 theta) is nothing; in a shell that stays the same all around, x goes with cos and y with sin alike."""
        shell = self.shell
        for number in range(self.top + 1):
            for node in range(shell.nodes_of):
                for field in SINES:
                    self._fixed.setdefault(shell.dof(number, node, field, 0), 0.0)
                if shell.per_field > 2:
                    continue
                for field in (0, 3):
                    x, y = shell.dof(number, node, field, 1), shell.dof(number, node, field + 1, 1)
                    if x in self._follows:  # tied to the other rim's
                        self._follows[y] = self._follows[x]
                    elif x in self._fixed:
                        self._fixed[y] = self._fixed[x]
                    else:
                        self._follows[y] = (x, 1.0)
                    self._fixed[shell.dof(number, node, field, 0)] = 0.0
                    self._fixed.setdefault(shell.dof(number, node, field + 2, 1), 0.0)

    def _bottom(self) -> None:
        """The lower base in the plane z = 0, its middle on the axis."""
        for k in self.harmonics:
            self._fixed[self.shell.dof(0, 0, Z, k)] = 0.0
        self._fixed[self.shell.dof(0, 0, X, 0)] = 0.0
        self._radial(0, 0)

    def _small_base(self) -> None:
        for k in self.harmonics:
            place = self.shell.dof(self.top, -1, Z, k)
            if k > 0 and self.hold.reading == "plane" and self.shell.per_field > 2:
                self._by_phi.append(k)
            else:
                self._fixed[place] = 0.0
        self._radial(self.top, -1)

    def _radial(self, number: int, node: int) -> None:
        """Radial freedom of a base."""
        if self.hold.bases == "free":
            return
        for k in self.harmonics:
            for field in (X, Y):
                place = self.shell.dof(number, node, field, k)
                if self.hold.bases == "held":
                    self._fixed[place] = float(self.shell.unloaded[place])
                else:
                    self._springs.append((place, None, float(self.hold.bases) * self._per_radian(number, node, k)))

    def _per_radian(self, number: int, node: int, k: int) -> float:
        """Integral of cos^2(k theta) r around the circle, m."""
        r = float(self.shell.unloaded[self.shell.dof(number, node, X, 1)])
        return (2 if k == 0 else 1) * math.pi * r

    def _rims(self) -> None:
        """The upper wall's rim (node 0 of wall 1) follows the lower's (last node of wall 0)."""
        for k in self.harmonics:
            for field in (X, Y, Z):
                lower, upper = self.shell.dof(0, -1, field, k), self.shell.dof(1, 0, field, k)
                if field == Z or self.hold.rims == "tied" or (field == X and k == 0):
                    self._follows[upper] = (lower, 1.0)
                elif not isinstance(self.hold.rims, str):
                    self._springs.append((lower, upper, self.hold.rims * self._per_radian(0, -1, k)))

    def _assemble(self) -> None:
        size = self.shell.size
        self.constant = np.zeros(size)
        for place, value in self._fixed.items():
            self.constant[place] = value
        held = {self.shell.dof(self.top, -1, Z, k) for k in self._by_phi}
        free = [i for i in range(size) if i not in self._follows and i not in self._fixed and i not in held]
        column = {place: j for j, place in enumerate(free)}
        rows, columns, values = list(free), list(range(len(free))), [1.0] * len(free)
        for place, (leader, share) in self._follows.items():
            # a leader that is fixed leaves nothing to follow but its value, which is zero for all that can be tied
            if leader in column:
                rows.append(place)
                columns.append(column[leader])
                values.append(share)
        self.T = sp.csr_array((values, (rows, columns)), shape=(size, len(free)))
        tilt = [(self.shell.dof(self.top, -1, Z, k), column[self.shell.dof(self.top, -1, X, k)]) for k in self._by_phi]
        self.tilt = sp.csr_array(
            ([1.0] * len(tilt), ([r for r, _ in tilt], [c for _, c in tilt])), shape=(size, len(free))
        )
        self.by_zeta = np.zeros(size)
        self.by_zeta[self.shell.dof(self.top, -1, Z, 0)] = 1.0
        self.by_phi = np.zeros(size)
        if self.hold.reading == "material" and self.shell.per_field > 2:
            self.by_phi[self.shell.dof(self.top, -1, Z, 1)] = -self.r_i
        self.springs = _spring_matrix(self._springs, size)
        self.start = self.shell.unloaded[free]

    def place(self, y: Floats, zeta_m: float, phi_rad: float) -> Floats:
        """Coefficients (size,)."""
        q = self.constant + self.T @ y + zeta_m * self.by_zeta + phi_rad * self.by_phi
        return q - math.tan(phi_rad) * (self.tilt @ y) if self._by_phi else q

    def moving(self, y: Floats, phi_rad: float) -> tuple[sp.csr_array, sp.csr_array | None, Floats, Floats]:
        """dq/dy, d2q/dy dphi (None for zero), dq/dphi and d2q/dphi2."""
        if not self._by_phi:
            return self.T, None, self.by_phi, np.zeros_like(self.by_phi)
        t = math.tan(phi_rad)
        first, second = -(1 + t**2), -2 * t * (1 + t**2)
        tilted = np.asarray(self.tilt @ y)
        turned, turning = sp.csr_array(self.T - t * self.tilt), sp.csr_array(first * self.tilt)
        return turned, turning, self.by_phi + first * tilted, second * tilted


def _spring_matrix(springs: list[tuple[int, int | None, float]], size: int) -> sp.csr_array:
    """S with energy (q - unloaded) S (q - unloaded) / 2 of springs between two coefficients, or one and its place."""
    rows, columns, values = [], [], []
    for one, other, stiffness in springs:
        pairs = [(one, one, 1.0)]
        if other is not None:
            pairs += [(other, other, 1.0), (one, other, -1.0), (other, one, -1.0)]
        for row, column, sign in pairs:
            rows.append(row)
            columns.append(column)
            values.append(sign * stiffness)
    return sp.csr_array((values, (rows, columns)), shape=(size, size))
