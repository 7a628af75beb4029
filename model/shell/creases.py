"""Creases: springs against folding where walls meet and where a frustum meets its neighbour, by the directors' angle.

In the meridian's plane at theta a director has the angle arg(d_r + i d_z). A rim's crease resists the change of the
angle between the two directors; a base's crease, shared with a neighbour that deforms as the mirror image in the base,
that of twice the director's turn against the base, which tilts by -phi cos(theta) in that plane.
"""

from __future__ import annotations

import numpy as np

from straw.model.shell.mesh import Shell
from straw.model.shell.strain import Floats


class Creases:
    """All creases of a shell with one stiffness, N m per rad and m of length; nothing where that is zero."""

    def __init__(self, shell: Shell) -> None:
        self.shell = shell
        stiffness, top = shell.profile.crease_n, len(shell.profile.walls) - 1
        points = max(len(shell.theta), 1)
        theta = shell.theta
        k = np.arange(shell.per_field)
        cosines, sines = np.cos(np.outer(theta, k)), np.sin(np.outer(theta, k))
        self._across = [(cosines, sines)]
        # (wall, node) and sign of each director in the angle, how base tilt enters, and weights (points,)
        self.joints: list[tuple[list[tuple[int, int, float]], float, Floats]] = []
        if stiffness == 0:
            return
        for nodes, tilts, share in (
            ([(0, 0, 1.0)], 0.0, 2.0),
            ([(top, -1, 1.0)], 1.0, 2.0),
            *([([(1, 0, 1.0), (0, -1, -1.0)], 0.0, 1.0)] if top else []),
        ):
            r = float(shell.unloaded[shell.dof(nodes[0][0], nodes[0][1], 0, 1)])
            weight = np.full(points, share * stiffness * r * shell.around_weight)
            self.joints.append((nodes, tilts, weight))
        self.cos, self.sin, self.cos_theta, self.sin_theta = cosines, sines, np.cos(theta), np.sin(theta)
        self.rest = [self._angles(nodes, shell.unloaded)[0] for nodes, _, _ in self.joints]

    def _angles(self, nodes: list[tuple[int, int, float]], q: Floats) -> tuple[Floats, Floats, Floats]:
        """The signed sum of directors' angles (points,), its gradient (points, size) and second-order parts.

        The last is (points, directors, 2, 2), the Hessian of each angle by (d_r, d_z).
        """
        total, curved = np.zeros(len(self.cos)), []
        slope = np.zeros((len(self.cos), self.shell.size))
        for wall, node, sign in nodes:
            rows = self._rows(wall, node)
            d_r, d_z = (row @ q for row in rows)
            square = d_r**2 + d_z**2
            total += sign * np.arctan2(d_z, d_r)
            slope += sign * ((-d_z / square)[:, None] * rows[0] + (d_r / square)[:, None] * rows[1])
            off = (d_z**2 - d_r**2) / square**2
            both = 2 * d_r * d_z / square**2
            curved.append(sign * np.stack([np.stack([both, off], -1), np.stack([off, -both], -1)], -2))
        return total, slope, np.stack(curved, 1)

    def _rows(self, wall: int, node: int) -> tuple[Floats, Floats]:
        """Rows (points, size) that give d_r and d_z from q."""
        out_r, out_z = (np.zeros((len(self.cos), self.shell.size)) for _ in range(2))
        for k in range(self.shell.per_field):
            out_r[:, self.shell.dof(wall, node, 3, k)] = self.cos[:, k] * self.cos_theta
            out_r[:, self.shell.dof(wall, node, 4, k)] = self.sin[:, k] * self.sin_theta
            out_z[:, self.shell.dof(wall, node, 5, k)] = self.cos[:, k]
        return out_r, out_z

    def add(self, q: Floats, phi_rad: float, g: Floats, H: Floats) -> tuple[float, float, float, Floats]:
        """Add to gradient and Hessian; returns energy (J), its first and second derivative by phi and the mixed one."""
        energy = by_phi = by_phi2 = 0.0
        mixed = np.zeros_like(g)
        for (nodes, tilts, weight), rest in zip(self.joints, self.rest, strict=True):
            angle, slope, curved = self._angles(nodes, q)
            lean = tilts * self.cos_theta
            beta = np.angle(np.exp(1j * (angle - rest))) + lean * phi_rad
            energy += 0.5 * float(weight @ beta**2)
            by_phi += float(weight @ (beta * lean))
            by_phi2 += float(weight @ lean**2)
            mixed += slope.T @ (weight * lean)
            g += slope.T @ (weight * beta)
            H += slope.T @ (weight[:, None] * slope)
            for at, (wall, node, _) in enumerate(nodes):
                rows = self._rows(wall, node)
                for i in range(2):
                    for j in range(2):
                        H += rows[i].T @ ((weight * beta * curved[:, at, i, j])[:, None] * rows[j])
        return energy, by_phi, by_phi2, mixed
