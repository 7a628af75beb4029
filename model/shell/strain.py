"""Energy of a director shell at a point of its wall, with exact gradient and Hessian.

A point x of the mid-surface carries a director d (not nearly a unit vector, but held to be one by the last strain).
With the tangents a1, a2 along meridian and circumference and the director's derivatives d1, d2, every strain is a
difference of products of these five vectors from the same product in the unloaded wall:

    stretching  a1.a1 / 2, a2.a2 / 2, a1.a2
    bending     a1.d1, a2.d2, a1.d2 + a2.d1
    shear       a1.d, a2.d
    thickness   d.d / 2

Linear in the thickness, St. Venant and Kirchhoff's material in plane stress: Reissner and Mindlin's shell at large
rotations (Simo and Fox, On a stress resultant geometrically exact shell model, 1989, with a director of three
components in place of a rotation). The energy is a quartic in the five vectors, so nothing is differenced.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STRAINS = 9
STRETCHING, BENDING, SHEAR, THICKNESS = slice(0, 3), slice(3, 6), slice(6, 8), 8
#: Transverse shear is not uniform over the thickness (Reissner 1945).
SHEAR_FACTOR = 5 / 6
#: Which products of the vectors (0 a1, 1 a2, 2 d, 3 d1, 4 d2) each strain is the sum of.
_PRODUCTS = (((0, 0),), ((1, 1),), ((0, 1),), ((0, 3),), ((1, 4),), ((0, 4), (1, 3)), ((0, 2),), ((1, 2),), ((2, 2),))


def _quadratic_forms() -> Floats:
    """P (9, 5, 5), symmetric, with strain_i = sum P_ijk a_j.a_k / 2."""
    P = np.zeros((STRAINS, 5, 5))
    for i, products in enumerate(_PRODUCTS):
        for j, k in products:
            P[i, j, k] = P[i, k, j] = 1.0
    return P


FORMS = _quadratic_forms()


@dataclass(frozen=True)
class Wall:
    """Elastic constants and the unloaded shape at points of a wall; ``area`` (points,) is what each stands for, m^2.

    ``unloaded`` (points, 9) are the products of the unloaded wall, ``scale`` (points, 9) makes strains per length of
    them; ``stretching`` and ``bending`` (points, 9, 9) are what half their product with two strains stores, J/m^2.
    """

    unloaded: Floats
    scale: Floats
    stretching: Floats
    bending: Floats
    area: Floats

    @property
    def stiffness(self) -> Floats:
        """Both parts together, (points, 9, 9), N/m by strains as scaled."""
        return self.stretching + self.bending


def wall(vectors: Floats, area: Floats, E_pa: float, nu: float, h_m: Floats) -> Wall:
    """The wall that is unloaded where its vectors are ``vectors`` (points, 5, 3); thickness h_m (points,)."""
    along, around = (np.linalg.norm(vectors[:, i], axis=1) for i in (0, 1))
    one = np.ones_like(along)
    plane = [1 / along**2, 1 / around**2, 1 / (along * around)]
    scale = np.column_stack([*plane, *plane, 1 / along, 1 / around, one])
    C = E_pa / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    G = E_pa / (2 * (1 + nu))
    stretching = np.zeros((len(vectors), STRAINS, STRAINS))
    bending = np.zeros_like(stretching)
    stretching[:, STRETCHING, STRETCHING] = h_m[:, None, None] * C
    stretching[:, 6, 6] = stretching[:, 7, 7] = SHEAR_FACTOR * G * h_m
    stretching[:, THICKNESS, THICKNESS] = E_pa * h_m  # keeps the director a unit vector; its energy is negligible
    bending[:, BENDING, BENDING] = (h_m**3 / 12)[:, None, None] * C
    return Wall(products(vectors), scale, stretching, bending, area)


def products(vectors: Floats) -> Floats:
    """The nine sums of products of vectors (points, 5, 3), as (points, 9)."""
    gram = vectors @ vectors.transpose(0, 2, 1)
    return np.asarray(np.einsum("ijk,pjk->pi", FORMS, gram) / 2)


def strains(w: Wall, vectors: Floats) -> Floats:
    """Strains (points, 9): stretching and shear as numbers, bending in 1/m."""
    return np.asarray((products(vectors) - w.unloaded) * w.scale)


def energies(w: Wall, vectors: Floats) -> tuple[float, float]:
    """Energy stored by stretching (with shear) and by bending, J."""
    e = strains(w, vectors)
    parts = (0.5 * np.einsum("p,pi,pij,pj->", w.area, e, C, e, optimize=True) for C in (w.stretching, w.bending))
    stretching, bending = (float(part) for part in parts)
    return stretching, bending


def derivatives(w: Wall, vectors: Floats, hessian: bool = True) -> tuple[float, Floats, Floats]:
    """Energy in J, its gradient (points, 15) and Hessian (points, 15, 15) by the five vectors at each point."""
    count = len(vectors)
    e = strains(w, vectors)
    stress = np.einsum("pij,pj->pi", w.stiffness, e) * w.area[:, None]
    energy = 0.5 * float(np.sum(stress * e))
    stress = stress * w.scale
    # each strain's slope by the vectors, (points, 9, 15)
    slope = np.einsum("ijk,pkc->pijc", FORMS, vectors).reshape(count, STRAINS, 15)
    gradient = np.einsum("pi,pij->pj", stress, slope)
    if not hessian:
        return energy, gradient, np.empty((0, 15, 15))
    C = w.stiffness * (w.scale[:, :, None] * w.scale[:, None, :] * w.area[:, None, None])
    H = slope.transpose(0, 2, 1) @ (C @ slope)
    curved = np.einsum("pi,ijk->pjk", stress, FORMS)
    for c in range(3):
        H[:, c::3, c::3] += curved
    return energy, gradient, H
