"""Static stiffness: how the straw's force of rest changes with its shape and with pressure; what decides stability."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import compiled
from straw.model.constants import Constants
from straw.model.parameters import StrawParameters
from straw.model.straw import residual

Floats = NDArray[np.float64]

#: Steps of the central differences. States lie millimetres and tenths of a radian apart, and the elastic force is a
#: cubic, so that these are off by 1e-8 of the stiffness; rounding adds as much again.
ZETA_STEP_M, PHI_STEP_RAD, PRESSURE_STEP_PA = 1e-7, 1e-5, 100.0


@compiled
def rest_force(c: Constants, q: Floats, external_pa: float) -> Floats:
    """Generalised force on a straw that stands still, (coordinates,): N on zeta, N m on phi; all terms."""
    still = np.zeros_like(q)
    return residual(c, q, still, still, external_pa)


@compiled
def stiffness_matrix(c: Constants, q: Floats, external_pa: float) -> Floats:
    """K = -d(rest_force)/dq, (coordinates, coordinates).

    Not symmetric: the pressure on the sealed end follows the tip, so that in a straight straw it turns inner frusta
    when an outer one bends and not the other way round.
    """
    n = len(q)
    K = np.empty((n, n))
    moved = q.copy()
    for j in range(n):
        step = ZETA_STEP_M if j < n // 2 else PHI_STEP_RAD
        moved[j] = q[j] + step
        up = rest_force(c, moved, external_pa)
        moved[j] = q[j] - step
        K[:, j] = (rest_force(c, moved, external_pa) - up) / (2 * step)
        moved[j] = q[j]
    return K


@compiled
def pressure_force(c: Constants, q: Floats, external_pa: float) -> Floats:
    """Derivative of rest_force by the external pressure, (coordinates,)."""
    up = rest_force(c, q, external_pa + PRESSURE_STEP_PA)
    return (up - rest_force(c, q, external_pa - PRESSURE_STEP_PA)) / (2 * PRESSURE_STEP_PA)


def length_scale(straw: StrawParameters) -> Floats:
    """What makes coordinates comparable, (coordinates,): zeta counts in units of r_i, phi in radians."""
    half = straw.coordinates // 2
    return np.repeat([straw.r_i_m, 1.0], half)


def stability(straw: StrawParameters, q: Floats, pressure_pa: float = 0.0) -> NDArray[np.complex128]:
    """Eigenvalues of the static stiffness by (zeta / r_i, phi), N m, by rising real part; at rest: stable if all > 0.

    They are those of K itself, not of its symmetric part: with a follower force the latter can turn indefinite while
    the straw still stands. A real eigenvalue passes through zero exactly where the rest state ends or branches.
    """
    scale = length_scale(straw)
    K = stiffness_matrix(straw.constants(), np.ascontiguousarray(q, dtype=np.float64), float(pressure_pa))
    eigenvalues = np.linalg.eigvals(K * scale * scale[:, None]).astype(np.complex128)
    return eigenvalues[np.argsort(eigenvalues.real)]
