"""Discrete wall: scikit-fem's elements along the meridian, harmonics around it, and energy summed over both.

A wall of revolution that bends in one plane is smooth around: place and director are written in Cartesian parts,

    x, z ~ sum_n,k N_n(s) cos(k theta) q,   y ~ sum_n,k N_n(s) sin(k theta) q,

with the total place as unknown, so that the unloaded cone, tilting and rigid rotation are exact from two harmonics on
and the rest converges exponentially; elements around the wall need a hundred times the unknowns for the same digits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from straw.model.errors import ModelError
from straw.model.shell.profile import Meridian, Profile
from straw.model.shell.strain import Floats, Wall, derivatives, energies, wall

#: Fields of a node: place x, y, z in m, then the director's parts; which of them go with sin(k theta).
FIELDS, SINES = 6, (1, 4)
#: Vectors a field is in, as rows of the five of `straw.model.shell.strain`, each with (derivative along s, around).
Rows = tuple[tuple[int, tuple[int, int]], ...]
_PLACE_ROWS: Rows
_DIRECTOR_ROWS: Rows
_PLACE_ROWS, _DIRECTOR_ROWS = ((0, (1, 0)), (1, (0, 1))), ((2, (0, 0)), (3, (1, 0)), (4, (0, 1)))


@dataclass(frozen=True)
class Mesh:
    """How finely a wall is cut: elements along each wall, their polynomial order, harmonics from 0 to ``harmonics``."""

    elements: int = 3
    order: int = 3
    harmonics: int = 8

    @property
    def around(self) -> int:
        """Points around half the wall: 2 K + 1 integrate the quartic exactly, fewer to all digits that count."""
        return 1 if self.harmonics == 1 else (3 * self.harmonics) // 2 + 2


class Shell:
    """A profile of one material, cut into a mesh; coefficients are one vector q (size,)."""

    def __init__(self, profile: Profile, E_pa: float, nu: float, mesh: Mesh, around: int | None = None) -> None:
        if not (np.isfinite(E_pa) and E_pa > 0):
            raise ModelError(f"shell: E_pa = {E_pa}, expected above zero")
        if not 0 <= nu < 0.5:
            raise ModelError(f"shell: nu = {nu}, expected 0 to below 0.5")
        self.profile, self.E_pa, self.nu, self.mesh = profile, E_pa, nu, mesh
        self.per_field = mesh.harmonics + 1
        self.nodes_of = mesh.elements * mesh.order + 1  # of one wall
        self.size = len(profile.walls) * self.nodes_of * FIELDS * self.per_field
        points = around or mesh.around
        theta = (np.arange(points) + 0.5) * np.pi / points
        # bodies that are the same all around need one point, off the axes so that cos and sin both count
        self.theta = np.array([np.pi / 4]) if points == 1 else theta
        self.around_weight = 2 * np.pi / points
        self.unloaded = np.zeros(self.size)
        self.parts = [_Part(self, number, meridian) for number, meridian in enumerate(profile.walls)]

    def dof(self, wall_number: int, node: int, field: int, harmonic: int) -> int:
        """Place of a coefficient in q; node -1 is the wall's last."""
        node %= self.nodes_of
        return ((wall_number * self.nodes_of + node) * FIELDS + field) * self.per_field + harmonic

    def coefficients(self, q: Floats, wall_number: int) -> Floats:
        """A wall's coefficients as (nodes, 6, harmonics)."""
        each = self.nodes_of * FIELDS * self.per_field
        return q[wall_number * each : (wall_number + 1) * each].reshape(self.nodes_of, FIELDS, self.per_field)

    def places(self, q: Floats) -> list[Floats]:
        """Where each wall's points are, (points along, points around, 3), m, from one base to the other."""
        out = []
        for part in self.parts:
            blocks = part.blocks(q)[:, :, :3]
            values = [
                np.einsum("enp,tk,enk->ept", part.functions[:, :, 0], around[:, 0], blocks[:, :, field])
                for field, around in enumerate((part.cosines, part.sines, part.cosines))
            ]
            out.append(np.stack(values, axis=-1).reshape(-1, len(self.theta), 3))
        return out

    def energy(self, q: Floats) -> tuple[float, float]:
        """Energy of stretching and of bending, J."""
        parts = [energies(part.wall, part.vectors(q)) for part in self.parts]
        return sum(stretching for stretching, _ in parts), sum(bending for _, bending in parts)

    def derivatives(self, q: Floats) -> tuple[float, Floats, Floats]:
        """Energy (J), gradient (size,) and Hessian (size, size) by the coefficients."""
        total, gradient, H = 0.0, np.zeros(self.size), np.zeros((self.size, self.size))
        for part in self.parts:
            total += part.add_derivatives(q, gradient, H)
        return total, gradient, H


class _Part:
    """One wall: values of its functions at its points, and the sums over them."""

    def __init__(self, shell: Shell, number: int, meridian: Meridian) -> None:
        import skfem

        mesh, self.shell, self.number, self.meridian = shell.mesh, shell, number, meridian
        length = meridian.length_m
        line = skfem.MeshLine(np.linspace(0.0, length, mesh.elements + 1))
        basis = skfem.Basis(line, skfem.ElementLinePp(mesh.order), intorder=2 * mesh.order)
        along = _in_order(basis, mesh.elements, mesh.order)  # (elements, nodes of one, 2, points along)
        self.functions = along
        self.s_m = np.asarray(basis.global_coordinates())[0]  # (elements, points along)
        self.weight_along = np.asarray(basis.dx)
        k = np.arange(shell.per_field)
        angle = np.outer(shell.theta, k)
        # (points around, derivative, harmonic)
        self.cosines = np.stack([np.cos(angle), -k * np.sin(angle)], axis=1)
        self.sines = np.stack([np.sin(angle), k * np.cos(angle)], axis=1)
        self.tables = {
            (rows, sine): self._table(rows, self.sines if sine else self.cosines)
            for rows in (_PLACE_ROWS, _DIRECTOR_ROWS)
            for sine in (False, True)
        }
        self._set_unloaded(basis, mesh)

    def _table(self, rows: Rows, around: Floats) -> Floats:
        """Values of a field's functions: (elements, points, rows, nodes of an element * harmonics)."""
        made = []
        for _, (ds, dt) in rows:
            product = np.einsum("enp,tk->eptnk", self.functions[:, :, ds], around[:, dt])
            made.append(product.reshape(len(product), -1, product.shape[3] * product.shape[4]))
        return np.ascontiguousarray(np.stack(made, axis=2))

    def _set_unloaded(self, basis: object, mesh: Mesh) -> None:
        """Coefficients of the unloaded wall, by least squares at the points, and the wall's elastic constants."""
        place, normal, h = self.meridian.at(self.s_m)
        ends, ends_normal, _ = self.meridian.at(np.array([0.0, self.meridian.length_m]))
        nodes = mesh.elements * mesh.order + 1
        A = np.zeros((self.s_m.size, nodes))
        for e, values in enumerate(self.functions[:, :, 0]):
            rows = slice(e * values.shape[1], (e + 1) * values.shape[1])
            A[rows, e * mesh.order : (e + 1) * mesh.order + 1] = values.T
        wanted = np.concatenate([place, normal], axis=-1).reshape(-1, 4)
        end = np.concatenate([ends, ends_normal], axis=-1)
        # the ends exactly, as they are what is held; a vertex function is 1 at its vertex, inner ones 0
        inner = np.linalg.lstsq(
            A[:, 1:-1], wanted - np.outer(A[:, 0], end[0]) - np.outer(A[:, -1], end[1]), rcond=None
        )[0]
        r, z, n_r, n_z = np.vstack([end[:1], inner, end[1:]]).T
        c = self.shell.coefficients(self.shell.unloaded, self.number)
        c[:, 0, 1] = c[:, 1, 1] = r
        c[:, 2, 0] = z
        c[:, 3, 1] = c[:, 4, 1] = n_r
        c[:, 5, 0] = n_z
        vectors = self.vectors(self.shell.unloaded)
        points = len(self.shell.theta)
        per_area = np.linalg.norm(np.cross(vectors[:, 0], vectors[:, 1]), axis=1)
        area = np.repeat(self.weight_along.ravel(), points) * self.shell.around_weight * per_area
        # half a wall by symmetry: theta from 0 to pi counts twice, which `around_weight` holds
        self.wall: Wall = wall(vectors, area, self.shell.E_pa, self.shell.nu, np.repeat(h.ravel(), points))

    def blocks(self, q: Floats) -> Floats:
        """Coefficients by element, (elements, nodes of one, 6, harmonics)."""
        c, p = self.shell.coefficients(q, self.number), self.shell.mesh.order
        return np.stack([c[e * p : (e + 1) * p + 1] for e in range(self.shell.mesh.elements)])

    def vectors(self, q: Floats) -> Floats:
        """The five vectors at all points, (points, 5, 3)."""
        blocks = self.blocks(q)
        elements = len(blocks)
        points = self.functions.shape[3] * len(self.shell.theta)
        out = np.empty((elements, points, 5, 3))
        for field in range(FIELDS):
            rows = _PLACE_ROWS if field < 3 else _DIRECTOR_ROWS
            values = self.tables[rows, field in SINES] @ blocks[:, None, :, field].reshape(elements, 1, -1, 1)
            out[:, :, [row for row, _ in rows], field % 3] = values[..., 0]
        return out.reshape(-1, 5, 3)

    def add_derivatives(self, q: Floats, gradient: Floats, H: Floats) -> float:
        """Add this wall's gradient and Hessian to those of the whole; returns its energy."""
        shell, p = self.shell, self.shell.mesh.order
        energy, g, h = derivatives(self.wall, self.vectors(q))
        elements, nodes = len(self.functions), p + 1
        points = len(g) // elements
        g = g.reshape(elements, points, 5, 3)
        h = h.reshape(elements, points, 5, 3, 5, 3)
        K = np.empty((elements, nodes, FIELDS, shell.per_field, nodes, FIELDS, shell.per_field))
        G = np.empty((elements, nodes, FIELDS, shell.per_field))
        flat: list[tuple[list[int], Floats, Floats]] = []
        for field in range(FIELDS):
            rows = _PLACE_ROWS if field < 3 else _DIRECTOR_ROWS
            table = self.tables[rows, field in SINES]
            flat.append(([row for row, _ in rows], table, table.reshape(elements, -1, table.shape[-1])))
        for field, (own, _, table) in enumerate(flat):
            part = g[:, :, own, field % 3].reshape(elements, 1, -1)
            G[:, :, field] = (part @ table).reshape(elements, nodes, -1)
            for other, (columns, whole, _) in enumerate(flat[: field + 1]):
                between = h[:, :, own, field % 3][..., columns, other % 3]
                HB = (between @ whole).reshape(elements, -1, whole.shape[-1])
                block = (table.transpose(0, 2, 1) @ HB).reshape(
                    elements, nodes, shell.per_field, nodes, shell.per_field
                )
                K[:, :, field, :, :, other] = block
                if other != field:
                    K[:, :, other, :, :, field] = block.transpose(0, 3, 4, 1, 2)
        each = FIELDS * shell.per_field
        width = nodes * each
        for e in range(elements):
            at = slice(
                (self.number * shell.nodes_of + e * p) * each, (self.number * shell.nodes_of + e * p) * each + width
            )
            gradient[at] += G[e].reshape(width)
            H[at, at] += K[e].reshape(width, width)
        return energy


def _in_order(basis: object, elements: int, order: int) -> Floats:
    """Values and slopes of elements' functions, first end, inner ones, last end: (elements, nodes, 2, points)."""
    made = np.stack([np.stack([np.asarray(f[0]), f[0].grad[0]]) for f in basis.basis])  # type: ignore[attr-defined]
    local = [0, *range(2, order + 1), 1]
    return np.ascontiguousarray(made[local].transpose(2, 0, 1, 3))
