"""Pressure inside as a follower load: minus the pressure times the volume that wall and base enclose.

Volume is the integral of x.n / 3 over wall and small base; a base in the plane z = 0 adds nothing. The wall's part is
-x.(a1 x a2) / 3, the base's that of the cone from the rim to the rim's mean point. Both are products of three vectors,
so that gradient and Hessian are exact.
"""

from __future__ import annotations

import numpy as np

from straw.model.shell.mesh import SINES, Shell
from straw.model.shell.strain import Floats

#: Where in q, tables (points, 3, width) of three vectors, and the points' weights.
Products = tuple[slice, list[Floats], Floats]


class Enclosed:
    """The volume a shell encloses, with derivatives, as a signed sum: it grows with zeta in every state."""

    def __init__(self, shell: Shell) -> None:
        self.shell = shell
        self.sets: list[Products] = []
        for part in shell.parts:
            for e in range(shell.mesh.elements):
                self.sets.append(self._element(part, e))
        self.sets.append(self._base())

    def _element(self, part: object, e: int) -> Products:
        """Tables of x, a1, a2 at an element's points, (points, 3, width), and the points' weights."""
        shell, p = self.shell, self.shell.mesh.order
        each = 6 * shell.per_field
        first = (part.number * shell.nodes_of + e * p) * each  # type: ignore[attr-defined]
        tables = []
        for ds, dt in ((0, 0), (1, 0), (0, 1)):
            table = np.zeros((part.functions.shape[3], len(shell.theta), 3, p + 1, 6, shell.per_field))  # type: ignore[attr-defined]
            for field in range(3):
                around = (part.sines if field in SINES else part.cosines)[:, dt]  # type: ignore[attr-defined]
                table[:, :, field, :, field] = np.einsum("np,tk->ptnk", part.functions[e, :, ds], around)  # type: ignore[attr-defined]
            tables.append(table.reshape(-1, 3, (p + 1) * each))
        weight = np.repeat(part.weight_along[e], len(shell.theta)) * shell.around_weight / -3  # type: ignore[attr-defined]
        return slice(first, first + (p + 1) * each), tables, weight

    def _base(self) -> Products:
        shell = self.shell
        each, top = 6 * shell.per_field, len(shell.profile.walls) - 1
        first = shell.dof(top, -1, 0, 0)
        k = np.arange(shell.per_field)
        angle = np.outer(shell.theta, k)
        middle, place, slope = (np.zeros((len(shell.theta), 3, 6, shell.per_field)) for _ in range(3))
        for field in (0, 2):
            middle[:, field, field, 0] = 1.0
        for field in range(3):
            sine = field in SINES
            place[:, field, field] = np.sin(angle) if sine else np.cos(angle)
            slope[:, field, field] = k * np.cos(angle) if sine else -k * np.sin(angle)
        tables = [table.reshape(-1, 3, each) for table in (middle, place, slope)]
        return slice(first, first + each), tables, np.full(len(shell.theta), shell.around_weight / 6)

    def slope(self, q: Floats) -> tuple[float, Floats]:
        """Volume in m^3 and its gradient (size,)."""
        total, g = 0.0, np.zeros(self.shell.size)
        for at, tables, weight in self.sets:
            u = [table @ q[at] for table in tables]
            slopes = [np.cross(u[(i + 1) % 3], u[(i + 2) % 3]) for i in range(3)]
            total += float(weight @ np.einsum("pi,pi->p", u[0], slopes[0]))
            for table, part in zip(tables, slopes, strict=True):
                g[at] += np.tensordot(weight[:, None] * part, table, 2)
        return total, g

    def base_area(self, q: Floats) -> float:
        """Area of the small base as seen along z, m^2."""
        at, (_, place, around), weight = self.sets[-1]
        a, b = place @ q[at], around @ q[at]
        return 3 * float(weight @ (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))

    def add(self, q: Floats, factor: float, g: Floats, H: Floats) -> float:
        """Add ``factor`` times the volume's gradient and Hessian; returns the volume."""
        total = 0.0
        for at, tables, weight in self.sets:
            u = [table @ q[at] for table in tables]
            slopes = [np.cross(u[(i + 1) % 3], u[(i + 2) % 3]) for i in range(3)]
            total += float(weight @ np.einsum("pi,pi->p", u[0], slopes[0]))
            for i in range(3):
                g[at] += factor * np.einsum("p,pi,pin->n", weight, slopes[i], tables[i], optimize=True)
                # x.(y x z): the pair (i, i + 1) has the cross product with the third between them
                third = u[(i + 2) % 3] * (factor * weight)[:, None]
                crossed = np.cross(tables[(i + 1) % 3].transpose(0, 2, 1), third[:, None, :])  # (p, n, 3)
                width = crossed.shape[1]
                block = tables[i].reshape(-1, width).T @ crossed.transpose(0, 2, 1).reshape(-1, width)
                H[at, at] += block + block.T
        return total
