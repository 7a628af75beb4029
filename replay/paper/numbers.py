"""Every number of the paper that the model can give, beside the paper's, and how the model's was obtained."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from straw.model.filling import ChannelRadius
from straw.model.frustum_table import frustum_of
from straw.model.geometry import Readings, identify_geometry
from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.model.snap import snap_pair
from straw.replay.paper.runs import RISE_PER_S, crossing_s

STRAW = StrawParameters()
READINGS = Readings(1.5e-3, 5.8e-3, -13.5e3, 22.5e3)


@dataclass(frozen=True)
class Number:
    """One number: the paper's, the model's, and the paper's rounding error, or the step of its reading.

    ``source`` is the place in the paper, ``how`` says how the model's number was obtained.
    """

    name: str
    source: str
    paper: float
    model: float
    unit: str
    rounding: float
    how: str

    @property
    def difference(self) -> float:
        """Model minus paper."""
        return self.model - self.paper

    @property
    def agrees(self) -> bool:
        """Whether the difference is within rounding."""
        return bool(abs(self.difference) <= self.rounding * (1 + 1e-9))


def numbers(radius: ChannelRadius, table: str, folding: Prediction, deployment: Prediction) -> list[Number]:
    """All of them, in the paper's order; ``table`` names where the filling tests come from."""
    return [*_identified(radius, table), *_snaps(), *_frustum(), *_runs(folding, deployment)]


def _identified(radius: ChannelRadius, table: str) -> Iterator[Number]:
    how = "counted: two for each frustum that moves"
    yield Number("coordinates, full form", "3.1", 36, STRAW.replace(form="full").coordinates, "", 0, how)
    yield Number("coordinates, odd frusta rigid", "3.1", 18, STRAW.coordinates, "", 0, how)
    how = f"equation 2 fitted to filling tests: {table}"
    yield Number("r_ch from filling tests", "3.1, S1", 0.52, radius.r_ch_m * 1e3, "mm", 0.005, how)
    found = identify_geometry(READINGS, STRAW)
    how = "solved for the cell lengths 1.5 and 5.8 mm and the snap pressures -13.5 and 22.5 kPa of cell 1 alone"
    yield Number("zeta_01", "3.1", 3.78, found.zeta01_m * 1e3, "mm", 0.005, how)
    yield Number("zeta_02", "3.1", -2.28, found.zeta02_m * 1e3, "mm", 0.005, how)
    yield Number("h", "3.1", 0.508, found.h_m * 1e3, "mm", 0.0005, how)
    yield Number("E", "3.1", 0.92, found.E_pa / 1e9, "GPa", 0.005, how)
    odd, even = STRAW.zeta0_m[0]
    how = "from the paper's zeta_01 and zeta_02"
    yield Number("zeta_01 / |zeta_02|", "3.1", 1.66, odd / -even, "", 0.005, how)
    yield Number("folded cell", "3.1", 1.5, (odd + even) * 1e3, "mm", 0.05, how)
    deployed = frustum_of(STRAW).equilibria()[0].zeta_m
    how = "zeta_01 and the deployed root of equation 6a without load"
    yield Number("deployed cell", "3.1", 5.8, (odd + deployed) * 1e3, "mm", 0.05, how)


def _snaps() -> Iterator[Number]:
    """Where cell 1 loses stability; the paper's may be off by half of the 0.5 kPa in which it raised the pressure."""
    singular = "where the static stiffness turns singular, under gravity, odd frusta rigid: "
    ways = (
        (True, "alone", singular + "that of the cell alone, its neighbours fixed as at rest without pressure"),
        (False, "in the straw", singular + "that of the whole straw, which follows the pressure"),
    )
    for held, which, how in ways:
        down, up = snap_pair(STRAW, 1, held=held)
        yield Number(f"cell 1 folds, {which}", "3.1", -13.5, down.pressure_pa / 1e3, "kPa", 0.25, how)
        yield Number(f"cell 1 deploys, {which}", "3.1", 22.5, up.pressure_pa / 1e3, "kPa", 0.25, how)


def _frustum() -> Iterator[Number]:
    frustum = frustum_of(STRAW)
    found = frustum.equilibria()
    bounds = frustum.bifurcation_pressures()
    sealed = frustum_of(STRAW, sealed=True).bifurcation_pressures()
    how = "all roots of equations 6a and 6b, stable where both eigenvalues of their Jacobian are positive"
    yield Number("equilibria of a frustum at 0 kPa", "3.2, Fig. 4", 9, len(found), "", 0, how)
    yield Number("of them stable", "3.2, Fig. 4", 4, sum(e.stable for e in found), "", 0, how)
    where = f"at {_kpa(bounds)} kPa on the frustum itself; with the sealed end's pull at {_kpa(sealed)} kPa"
    yield Number("bifurcation pressures", "3.2, Fig. 5", 4, len(set(bounds)), "", 0, f"where roots vanish: {where}")
    how += ", in the middle of each region"
    edges = [2 * bounds[0], *bounds, 2 * bounds[-1]]
    regions = zip(edges[:-1], edges[1:], (1, 2, 4, 2, 1), strict=True)
    for low, high, states in regions:
        counted = sum(e.stable for e in frustum.equilibria((low + high) / 2))
        ends = f"{low / 1e3:.1f} to {high / 1e3:.1f} kPa"
        outside = {edges[0]: f"below {high / 1e3:.1f} kPa", bounds[-1]: f"above {low / 1e3:.1f} kPa"}
        yield Number(f"stable states, {outside.get(low, ends)}", "3.2, Fig. 5", states, counted, "", 0, how)


def _runs(folding: Prediction, deployment: Prediction) -> Iterator[Number]:
    rise = 100 * (1 - math.exp(-RISE_PER_S * 0.070))
    yield Number("pressure reached after 70 ms", "3.3", 97, rise, "%", 0.5, "1 - exp(-50/s 70 ms)")
    how = "from the paper's radii"
    for r_ch_mm, share in ((0.43, 82.5), (0.315, 60.5)):
        # 0.52 mm stands for 0.515 to 0.525 mm, and the share is printed to half a percent
        rounding = 100 * r_ch_mm / 0.52 * 0.005 / 0.52 + 0.05
        yield Number(f"{r_ch_mm} mm over the calibrated r_ch", "3.3", share, 100 * r_ch_mm / 0.52, "%", rounding, how)
    for name, run, cells, sign in (("folding", folding, 0, -1), ("deployment", deployment, 9, 1)):
        how = f"simulated: the {name} with the constants of its figure"
        ended = int((run.zeta_m[-1, :, 1] > 0).sum())
        yield Number(f"cells deployed after the {name}", "3.3", cells, ended, "", 0, how)
        order = sorted((1, 4), key=lambda cell: crossing_s(run, cell))
        first = f"{how}; in the experiment it was cell 4, which is weaker (3.3)"
        yield Number(f"first cell to snap in the {name}", "3.3", 1, order[0], "", 0, first)
        bent = float(np.abs(run.frustum_phi_rad[:, 0, 1]).max())
        antisymmetric = next(e for e in frustum_of(STRAW).equilibria() if e.stable and e.phi_rad > 0).phi_rad
        through = 1 if sign < 0 else 0
        yield Number(
            f"cell 1 bends as far as the antisymmetric state in the {name} (1 yes)",
            f"3.3, Fig. {6 if sign < 0 else 7}",
            through,
            float(bent > 0.9 * antisymmetric),
            "",
            0,
            f"{how}; |phi| reaches {bent:.3f} rad of {antisymmetric:.3f}",
        )


def _kpa(pressures: tuple[float, ...]) -> str:
    return ", ".join(f"{p / 1e3:.2f}" for p in pressures)
