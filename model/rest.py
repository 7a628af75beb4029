"""Rest states: where a straw stands still in a given configuration, under gravity and pressure, on its own branch."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from straw.model.configuration import Bent, text, unloaded
from straw.model.continuation import Branch, follow
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters

Floats = NDArray[np.float64]

NONE_BENT: Bent = {}


#: A state this near (zeta / r_i, phi) to a known one of a slightly different straw is on the same branch.
NEAR = 0.03


def rest_state(
    straw: StrawParameters,
    deployed: Collection[int],
    pressure_pa: float = 0.0,
    bent: Bent = NONE_BENT,
    *,
    near: Floats | None = None,
) -> Floats:
    """Stable rest state with the given cells deployed or bent and the others folded; q of shape (coordinates,).

    ``bent`` names cells in one of their two antisymmetric states: +1 turns the tip towards growing Phi, -1 against.
    The straw is let go slowly from its unloaded shape while the pressure is turned up: a Newton search that jumps to
    the full load can land on another branch of a long deployed straw. ``near``, the rest state of a slightly different
    straw, saves this continuation where a stable state is close to it. Raises ModelError for a cell the straw does not
    have, and where the state does not exist, naming the cell that does not hold.
    """
    if near is not None and len(near) == straw.coordinates:
        branch = Branch(straw, near, pressure_pa)
        if (found := branch.settled(NEAR)) is not None:
            return found
    start = unloaded(straw, deployed, bent)
    end = follow(Branch(straw, start, pressure_pa, held_start=True))
    if end.share is not None:
        cell = int(end.share.argmax()) + 1
        raise ModelError(
            f"configuration {text(deployed, bent)}: no rest state at {pressure_pa / 1e3 + 0.0:.4g} kPa: cell {cell} "
            f"gives way at {100 * end.load:.0f} % of the load; ask for a lower pressure or another configuration"
        )
    return end.q
