"""Derivatives for systems without their own: central differences in u, one-sided at a bound."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.settings import STEP_U

Floats = NDArray[np.float64]


def jacobian(
    of: Callable[[Floats], Floats | None],
    unknowns: Sequence[Unknown],
    u: Floats,
    at: Floats,
    *,
    central: bool = True,
) -> Floats:
    """Derivatives (m, unknowns) of ``of``, which is ``at`` (m,) at u; a side that cannot be computed is left out.

    Without ``central`` one side is used where possible: its error, half a step times the curvature, does not matter to
    a search, at half of the cost.
    """
    columns = []
    for k, unknown in enumerate(unknowns):
        sides: list[tuple[float, Floats]] = []
        for step in (STEP_U, -STEP_U):
            if not central and sides and sides[0][0] != u[k]:
                sides.append((float(u[k]), at))
                break
            there = u.copy()
            there[k] = np.clip(u[k] + step, unknown.low, unknown.high)
            value = of(there) if there[k] != u[k] else None
            sides.append((there[k], value) if value is not None else (u[k], at))
        (high, above), (low, below) = sides
        columns.append((above - below) / (high - low) if high != low else np.zeros_like(at))
    return np.stack(columns, axis=1) if columns else np.zeros((len(at), 0))
