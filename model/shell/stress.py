"""Stress in a deformed wall: von Mises' at the more stressed of its two faces, over the whole wall."""

from __future__ import annotations

import numpy as np

from straw.model.shell.mesh import Shell
from straw.model.shell.solve import Model, Point
from straw.model.shell.strain import BENDING, STRETCHING, Floats, strains

#: Points around half a wall for looking at it.
AROUND = 48


def stressed(model: Model, point: Point) -> list[tuple[Floats, Floats]]:
    """Each wall's places (along, around, 3) in m and stress (along, around) in Pa; all around, closed.

    The wall is in plane stress: faces at half the thickness either side, sigma = E / (1 - nu^2) (eps +- h kappa / 2).
    """
    shell = model.shell
    fine = Shell(shell.profile, shell.E_pa, shell.nu, shell.mesh, AROUND)
    q = model.held.place(point.y, point.zeta_m, point.phi_rad)
    C = np.array([[1, shell.nu, 0], [shell.nu, 1, 0], [0, 0, (1 - shell.nu) / 2]]) * shell.E_pa / (1 - shell.nu**2)
    out = []
    for part, place in zip(fine.parts, fine.places(q), strict=True):
        e = strains(part.wall, part.vectors(q))
        h = part.meridian.at(part.s_m)[2].ravel().repeat(AROUND)[:, None]
        faces = [_von_mises((e[:, STRETCHING] + side * h / 2 * e[:, BENDING]) @ C) for side in (1, -1)]
        stress = np.maximum(*faces).reshape(place.shape[:2])
        mirrored = place[:, ::-1] * [1.0, -1.0, 1.0]
        around = np.concatenate([place, mirrored, place[:, :1]], axis=1)
        out.append((around, np.concatenate([stress, stress[:, ::-1], stress[:, :1]], axis=1)))
    return out


def _von_mises(s: Floats) -> Floats:
    return np.asarray(np.sqrt(s[:, 0] ** 2 - s[:, 0] * s[:, 1] + s[:, 1] ** 2 + 3 * s[:, 2] ** 2))
