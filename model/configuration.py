"""Configurations: which of its four stable shapes each cell is in, and where that puts the unloaded straw."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.frustum import Equilibrium, Frustum
from straw.model.frustum_table import frustum_of
from straw.model.parameters import StrawParameters

Floats = NDArray[np.float64]

#: Cells bent (the antisymmetric states): +1 turns the tip towards growing Phi (a horizontal straw down), -1 against it.
Bent = Mapping[int, int]


def unloaded(straw: StrawParameters, deployed: Collection[int], bent: Bent) -> Floats:
    """Coordinates (coordinates,) of a configuration whose frusta carry no load; cells not named are folded.

    ModelError names a cell the straw does not have, one that is asked for twice, and one without such a state.
    """
    for cell in (*deployed, *bent):
        if not 1 <= cell <= straw.cells:
            raise ModelError(f"configuration: cell {cell} is not in a straw of {straw.cells} cells")
    for cell, side in bent.items():
        if cell in deployed:
            raise ModelError(f"configuration: cell {cell} is to be both deployed and bent; name it once")
        if side not in (1, -1):
            raise ModelError(f"configuration: cell {cell} bent {side!r}; expected 1 (growing Phi) or -1")
    q = np.zeros(straw.coordinates)
    zeta, phi = even(straw, q)
    if straw.form == "full":
        q[: straw.cells] = straw.zeta0_m[:, 0]
    zeta[:] = straw.zeta0_m[:, 1]
    known: dict[tuple[Frustum, bool], list[Equilibrium]] = {}  # cells are mostly alike
    for cell in {*deployed, *bent}:
        frustum, side = frustum_of(straw, cell), bent.get(cell, 0)
        if (frustum, side != 0) not in known:
            found = frustum.bent() if side else frustum.straight()
            known[frustum, side != 0] = [e for e in found if e.stable and e.zeta_m > frustum.zeta0 * (1 - 1e-6)]
        fitting = [e for e in known[frustum, side != 0] if np.sign(e.phi_rad) == side]
        if not fitting:
            what = "bent" if side else "deployed"
            raise ModelError(f"straw: cell {cell} has no {what} state; its wall is too thick for its height")
        zeta[cell - 1], phi[cell - 1] = fitting[0].zeta_m, fitting[0].phi_rad
    return q


def even(straw: StrawParameters, q: Floats) -> tuple[Floats, Floats]:
    """Views on zeta and phi of the even frusta in coordinates (coordinates,), each (cells,)."""
    n, half = straw.cells, straw.coordinates // 2
    return q[half - n : half], q[2 * half - n :]


def text(deployed: Collection[int], bent: Bent) -> str:
    """A configuration in words."""
    parts = [
        f"{_ranges(cells)} {what}"
        for what, cells in (
            ("deployed", deployed),
            ("bent to growing Phi", [cell for cell, side in bent.items() if side > 0]),
            ("bent to falling Phi", [cell for cell, side in bent.items() if side < 0]),
        )
        if cells
    ]
    return "with cells " + " and ".join(parts) if parts else "all folded"


def _ranges(cells: Collection[int]) -> str:
    """Cells as 1,4 or 2-9."""
    runs: list[list[int]] = []
    for cell in sorted(cells):
        if runs and cell == runs[-1][-1] + 1:
            runs[-1].append(cell)
        else:
            runs.append([cell])
    return ",".join(f"{run[0]}-{run[-1]}" if len(run) > 2 else ",".join(map(str, run)) for run in runs)
