"""Pictures of the finite-element energy beside the reduced model's: frustum, cell, under pressure, with one state."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("skfem")

from straw.model.shell.landscape import grid_for, landscape
from straw.model.shell.mesh import Mesh
from straw.model.shell.problem import Problem
from straw.model.shell.profile import cell, frustum
from straw.replay.shell.pictures import energy_map
from straw.replay.shell.table import reduced_frustum

CONE = frustum(11.1e-3, 14.65e-3, -2.28e-3, 0.508e-3)
CELL = cell(11.1e-3, 14.65e-3, (3.78e-3, -2.28e-3), (0.508e-3, 0.508e-3))
THICK = frustum(11.1e-3, 14.65e-3, -0.4e-3, 0.9e-3)


@pytest.mark.parametrize(
    ("problem", "lower_m"),
    [
        (Problem(CONE, 0.92e9, mesh=Mesh(1, 3, 3)), 0.0),
        (Problem(CONE, 0.92e9, mesh=Mesh(1, 3, 3), pressure_pa=10e3), 0.0),
        (Problem(CELL, 0.92e9, mesh=Mesh(1, 3, 3)), 3.78e-3),
        (Problem(THICK, 0.92e9, mesh=Mesh(1, 3, 3)), 0.0),
    ],
    ids=["frustum", "under pressure", "cell", "one state only"],
)
def test_the_energy_is_drawn_beside_the_reduced_one_from_the_same_level(problem: Problem, lower_m: float) -> None:
    land = landscape(problem, grid_for(problem, 40, 4))
    flat = reduced_frustum(problem, sealed=problem.pressure_pa != 0)
    shell, reduced, off, *_ = energy_map(land, flat, [], lower_m).axes
    assert "rigid" in reduced.get_title(loc="left") + reduced.get_title() or lower_m == 0
    assert shell.collections[0].get_clim() == reduced.collections[0].get_clim()
    span = off.collections[0].get_clim()[1]
    # the energy of a coarse mesh is off by a tenth, the formula by a third; a wrong zero level would exceed that
    assert span < 0.7 * np.ptp(shell.collections[0].get_clim())
