"""Snap pressures: how far pressure can be turned, slowly, before a cell gives way, and which cell that is."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np

from straw.model.configuration import Bent, even, text
from straw.model.continuation import Branch, follow
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.rest import NONE_BENT, rest_state

#: Pressures beyond this are not searched unless asked, Pa; the paper's straw snaps below 30 kPa.
LIMIT_PA = 300e3


@dataclass(frozen=True)
class Snap:
    """A cell gives way: at what external pressure, which state it loses ("folded", "deployed" or "bent"), and where.

    ``zeta_m`` and ``phi_rad`` are its even frustum's at that moment; ``before`` are the cells that snapped earlier.
    """

    cell: int
    pressure_pa: float
    lost: str
    zeta_m: float
    phi_rad: float
    before: tuple[int, ...] = ()


def next_snap(
    straw: StrawParameters,
    deployed: Collection[int],
    towards_pa: float,
    bent: Bent = NONE_BENT,
    *,
    held_but: int | None = None,
) -> Snap | None:
    """First cell to give way as pressure goes slowly from 0 towards a limit; None where all hold.

    It is the point where the static stiffness of the straw turns singular, good to 1 Pa. With ``held_but`` all
    coordinates but that cell's stay as they rest without pressure, which asks for its own 2 x 2 Jacobian alone.
    Raises ModelError where the configuration has no rest state to begin with.
    """
    start = rest_state(straw, deployed, 0.0, bent)
    free = None if held_but is None else np.arange(held_but - 1, straw.coordinates, straw.cells)
    end = follow(Branch(straw, start, towards_pa, free=free))
    if end.share is None:
        return None
    cell = int(end.share.argmax()) + 1
    zeta, phi = even(straw, end.q)
    lost = "deployed" if cell in deployed else "bent" if cell in bent else "folded"
    return Snap(cell, end.load * towards_pa, lost, float(zeta[cell - 1]), float(phi[cell - 1]))


def snaps(straw: StrawParameters, deployed: Collection[int], towards_pa: float) -> Iterator[Snap]:
    """All snaps in order as pressure goes slowly from 0 towards a limit.

    A cell that has snapped is taken to be in the opposite axisymmetric state: where one loses its folded or deployed
    state, the antisymmetric states are long gone (Fig. 5). A cell that the last snap leaves beyond its own limit
    follows at the same pressure.
    """
    now, reached_pa = set(deployed), 0.0
    before: list[int] = []
    falling = "deployed" if towards_pa < 0 else "folded"
    while (snap := next_snap(straw, now, towards_pa)) is not None:
        reached_pa = max(reached_pa, snap.pressure_pa, key=abs)
        yield replace(snap, pressure_pa=reached_pa, before=tuple(before))
        if snap.lost != falling:
            return  # bent over by its load rather than snapped by pressure: statics does not determine where it goes
        now ^= {snap.cell}
        before.append(snap.cell)


def snap_of(
    straw: StrawParameters, deployed: Collection[int], cell: int, *, held: bool = False, limit_pa: float = LIMIT_PA
) -> Snap:
    """Snap of one cell of a configuration: down (pressure below zero) if it is deployed, up if it is folded.

    Cells that give way before it have snapped by then and are named in ``before``. With ``held`` the other cells stay
    as they rest without pressure, so that only the cell's own 2 x 2 Jacobian decides, as in section 3.1 of the paper.
    Raises ModelError for a cell that does not snap within the limit, naming it.
    """
    if not 1 <= cell <= straw.cells:
        raise ModelError(f"snap: cell {cell} is not in a straw of {straw.cells} cells")
    towards_pa = -limit_pa if cell in deployed else limit_pa
    if held:
        snap = next_snap(straw, deployed, towards_pa, held_but=cell)
    else:
        snap = next((s for s in snaps(straw, deployed, towards_pa) if s.cell == cell), None)
    if snap is None:
        raise ModelError(
            f"snap: cell {cell} of the straw {text(deployed, NONE_BENT)} does not snap between 0 and "
            f"{towards_pa / 1e3:.4g} kPa; search further or check the straw's constants"
        )
    return snap


def snap_pair(
    straw: StrawParameters, cell: int, *, held: bool = False, limit_pa: float = LIMIT_PA
) -> tuple[Snap, Snap]:
    """Snaps (down, up) of a cell as section 3.1 measures them: alone deployed, and alone folded."""
    others = [other for other in range(1, straw.cells + 1) if other != cell]
    down, up = (snap_of(straw, deployed, cell, held=held, limit_pa=limit_pa) for deployed in ([cell], others))
    return down, up
