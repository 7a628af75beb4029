"""Rest states: where a straw stands still in a given configuration, under gravity and pressure, on its own branch."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from model.compiled import compiled
from model.constants import Constants
from model.errors import ModelError
from model.linear import factor, substitute
from model.parameters import StrawParameters
from model.straw import residual

Floats = NDArray[np.float64]

GRAVITY_STEPS = 12
NEWTON_LIMIT = 30


def rest_state(straw: StrawParameters, deployed: Collection[int], pressure_pa: float = 0.0) -> Floats:
    """Stable rest state with the given cells deployed and the others folded; q of shape (coordinates,).

    Pressure and gravity are turned on in a dozen equal steps from the unloaded state: a Newton search that jumps to
    the full load can land on another branch of a long deployed straw.
    Raises ModelError for a cell the straw does not have, and where no rest state exists on that branch.
    """
    for cell in deployed:
        if not 1 <= cell <= straw.cells:
            raise ModelError(f"configuration: cell {cell} is not in a straw of {straw.cells} cells")
    c = straw.constants()
    n = straw.coordinates
    q = np.zeros(n)
    even = straw.zeta0_m[:, 1].copy()
    for cell in deployed:
        even[cell - 1] = _unloaded_deployed(straw, cell - 1)
    if straw.form == "full":
        q[: straw.cells] = straw.zeta0_m[:, 0]
    q[n // 2 - straw.cells : n // 2] = even
    signs = np.sign(even)
    for step in range(GRAVITY_STEPS + 1):
        part = step / GRAVITY_STEPS
        if not _relax(c._replace(g=part * straw.g_m_per_s2), q, part * pressure_pa):
            raise ModelError(
                f"configuration {_text(deployed)}: no rest state at {pressure_pa / 1e3 + 0.0:.4g} kPa "
                f"(lost at {100 * part:.0f} % of the load); ask for a lower pressure or another configuration"
            )
        left = np.flatnonzero(np.sign(q[n // 2 - straw.cells : n // 2]) != signs)
        if left.size:
            raise ModelError(
                f"configuration {_text(deployed)}: cell {left[0] + 1} does not stay as asked at "
                f"{pressure_pa / 1e3 + 0.0:.4g} kPa; ask for a lower pressure or another configuration"
            )
    return q


def _text(deployed: Collection[int]) -> str:
    return "with cells " + ",".join(map(str, sorted(deployed))) + " deployed" if deployed else "all folded"


def _unloaded_deployed(straw: StrawParameters, i: int) -> float:
    """Deployed rest height of cell i's even frustum without load, m: the root of F beside zeta0 and the saddle.

    With phi = 0 equation 6a factors into (zeta - zeta0) (8 C1 zeta (zeta + zeta0) + 2 C2).
    """
    c = straw.constants()
    zeta0, ratio = c.zeta0[i, 1], c.C2[i, 1] / (4 * c.C1[i, 1])
    under = zeta0**2 - 4 * ratio
    if under <= 0:
        raise ModelError(f"straw: cell {i + 1} has no deployed state; its wall is too thick for its height")
    return float((-zeta0 + np.sqrt(under)) / 2)


@compiled
def stiffness_at(c: Constants, q: Floats, external_pa: float) -> Floats:
    """Minus the derivative of the static force by q, (coordinates, coordinates); central differences."""
    n = len(q)
    still, moved, K = np.zeros(n), q.copy(), np.empty((n, n))
    for j in range(n):
        step = 1e-8 if j < n // 2 else 1e-6
        moved[j] = q[j] + step
        up = residual(c, moved, still, still, external_pa)
        moved[j] = q[j] - step
        K[:, j] = (residual(c, moved, still, still, external_pa) - up) / (2 * step)
        moved[j] = q[j]
    return K


@compiled
def _relax(c: Constants, q: Floats, pressure_pa: float) -> bool:
    """Newton's method for a state of rest, from q, in place; False where it does not converge."""
    still = np.zeros_like(q)
    half = len(q) // 2
    order, dq = np.empty(len(q), np.int64), np.empty(len(q))
    for _ in range(NEWTON_LIMIT):
        force = residual(c, q, still, still, pressure_pa)
        K = stiffness_at(c, q, pressure_pa)
        factor(K, order)
        substitute(K, order, force, dq)
        # keep a step well inside a branch: states lie millimetres and tenths of a radian apart
        largest = max(np.abs(dq[:half]).max() / 2e-4, np.abs(dq[half:]).max() / 2e-2)
        if not np.isfinite(largest):
            return False
        q += dq / max(1.0, largest)
        if largest < 1e-9:
            return True
    return False
