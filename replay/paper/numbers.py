"""Every number of the paper that the model can give, beside the paper's, and what to make of a difference."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from straw.model.filling import ChannelRadius
from straw.model.frustum import Frustum
from straw.model.geometry import Readings, identify_geometry
from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.model.snap import snap_pair
from straw.replay.paper.runs import RISE_PER_S, crossing_s

STRAW = StrawParameters()
READINGS = Readings(1.5e-3, 5.8e-3, -13.5e3, 22.5e3)


@dataclass(frozen=True)
class Number:
    """One number: the paper's, the model's, and how far the paper's may be off by rounding or the step it was read in.

    ``source`` is the place in the paper, or "check" for a number derived independently from the paper's equations.
    """

    name: str
    source: str
    paper: float
    model: float
    unit: str
    rounding: float
    note: str = ""

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
    return [*_identified(radius, table), *_snaps(), *_frustum(), *_runs(folding, deployment), *_checks(deployment)]


def _identified(radius: ChannelRadius, table: str) -> Iterator[Number]:
    yield Number("coordinates, full form", "3.1", 36, STRAW.replace(form="full").coordinates, "", 0)
    yield Number("coordinates, odd frusta rigid", "3.1", 18, STRAW.coordinates, "", 0)
    yield Number("r_ch from filling tests", "3.1, S1", 0.52, radius.r_ch_m * 1e3, "mm", 0.005, f"from {table}")
    found = identify_geometry(READINGS, STRAW)
    how = "from 1.5 mm, 5.8 mm, -13.5 kPa, 22.5 kPa"
    yield Number("zeta_01", "3.1", 3.78, found.zeta01_m * 1e3, "mm", 0.005, how)
    yield Number("zeta_02", "3.1", -2.28, found.zeta02_m * 1e3, "mm", 0.005, how)
    yield Number("h", "3.1", 0.508, found.h_m * 1e3, "mm", 0.0005, how)
    yield Number("E", "3.1", 0.92, found.E_pa / 1e9, "GPa", 0.005, how)
    odd, even = STRAW.zeta0_m[0]
    yield Number("zeta_01 / |zeta_02|", "3.1", 1.66, odd / -even, "", 0.005)
    yield Number("folded cell", "3.1", 1.5, (odd + even) * 1e3, "mm", 0.05)
    deployed = Frustum.of(STRAW).equilibria()[0].zeta_m
    yield Number("deployed cell", "3.1", 5.8, (odd + deployed) * 1e3, "mm", 0.05)


def _snaps() -> Iterator[Number]:
    ways = (
        (True, "own 2 x 2 Jacobian, neighbours as they rest without pressure; the paper read steps of 0.5 kPa"),
        (False, "whole straw follows the pressure; the paper read steps of 0.5 kPa"),
    )
    for held, how in ways:
        down, up = snap_pair(STRAW, 1, held=held)
        which = "alone" if held else "in the straw"
        yield Number(f"cell 1 folds, {which}", "3.1", -13.5, down.pressure_pa / 1e3, "kPa", 0.25, how)
        yield Number(f"cell 1 deploys, {which}", "3.1", 22.5, up.pressure_pa / 1e3, "kPa", 0.25, how)


def _frustum() -> Iterator[Number]:
    frustum = Frustum.of(STRAW)
    found = frustum.equilibria()
    bounds = frustum.bifurcation_pressures()
    sealed = Frustum.of(STRAW, sealed=True).bifurcation_pressures()
    note = f"at {_kpa(bounds)} kPa on the frustum itself; with the sealed end's pull at {_kpa(sealed)} kPa"
    yield Number("equilibria of a frustum at 0 kPa", "3.2, Fig. 4", 9, len(found), "", 0)
    yield Number("of them stable", "3.2, Fig. 4", 4, sum(e.stable for e in found), "", 0)
    yield Number("bifurcation pressures", "3.2, Fig. 5", 4, len(set(bounds)), "", 0, note)
    edges = [2 * bounds[0], *bounds, 2 * bounds[-1]]
    regions = zip(edges[:-1], edges[1:], (1, 2, 4, 2, 1), strict=True)
    for low, high, states in regions:
        counted = sum(e.stable for e in frustum.equilibria((low + high) / 2))
        ends = f"{low / 1e3:.1f} to {high / 1e3:.1f} kPa"
        outside = {edges[0]: f"below {high / 1e3:.1f} kPa", bounds[-1]: f"above {low / 1e3:.1f} kPa"}
        yield Number(f"stable states, {outside.get(low, ends)}", "3.2, Fig. 5", states, counted, "", 0)


def _runs(folding: Prediction, deployment: Prediction) -> Iterator[Number]:
    rise = 100 * (1 - math.exp(-RISE_PER_S * 0.070))
    yield Number("pressure reached after 70 ms", "3.3", 97, rise, "%", 0.5)
    for r_ch_mm, share in ((0.43, 82.5), (0.315, 60.5)):
        # 0.52 mm stands for 0.515 to 0.525 mm, and the share is printed to half a percent
        rounding = 100 * r_ch_mm / 0.52 * 0.005 / 0.52 + 0.05
        yield Number(f"{r_ch_mm} mm of the calibrated r_ch", "3.3", share, 100 * r_ch_mm / 0.52, "%", rounding)
    for name, run, cells, sign in (("folding", folding, 0, -1), ("deployment", deployment, 9, 1)):
        ended = int((run.zeta_m[-1, :, 1] > 0).sum())
        yield Number(f"cells deployed after the {name}", "3.3", cells, ended, "", 0)
        order = sorted((1, 4), key=lambda cell: crossing_s(run, cell))
        note = "in the experiment it was cell 4, which is weaker (3.3)"
        yield Number(f"first cell to snap in the {name}", "3.3", 1, order[0], "", 0, note)
        bent = float(np.abs(run.frustum_phi_rad[:, 0, 1]).max())
        antisymmetric = next(e for e in Frustum.of(STRAW).equilibria() if e.stable and e.phi_rad > 0).phi_rad
        through = 1 if sign < 0 else 0
        yield Number(
            f"cell 1 bends as far as the antisymmetric state in the {name} (1 yes)",
            f"3.3, Fig. {6 if sign < 0 else 7}",
            through,
            float(bent > 0.9 * antisymmetric),
            "",
            0,
            f"|phi| reaches {bent:.3f} rad of {antisymmetric:.3f}",
        )


def _checks(deployment: Prediction) -> Iterator[Number]:
    c = STRAW.constants()
    yield Number("C1", "check", 3.36335e8, float(c.C1[0, 1]), "N/m^3", 0.5e3)
    yield Number("C2", "check", 695.26, float(c.C2[0, 1]), "N/m", 0.005)
    yield Number("C3", "check", 1.36992e-4, c.C3, "m^2", 0.5e-9)
    yield Number("dV/dzeta", "check", 5.24067e-4, c.S, "m^2", 0.5e-9)
    want = [(2.0248, 0.0), (0.2552, 0.0), (-2.28, 0.0), (1.075, 0.1147), (-0.2735, 0.2196), (-0.8014, 0.1727)]
    for (zeta, phi), e in zip(want, (e for e in Frustum.of(STRAW).equilibria() if e.phi_rad >= 0), strict=True):
        kind = "stable" if e.stable else "unstable"
        yield Number(f"{kind} equilibrium, zeta", "check", zeta, e.zeta_m * 1e3, "mm", 0.5e-4)
        if phi:
            yield Number(f"{kind} equilibrium, |phi|", "check", phi, e.phi_rad, "rad", 0.5e-4)
    down, up = snap_pair(STRAW, 1)
    why = (
        "the literal equations lose their balance, and slow ramps of the dynamics snap, at the model's pressures; the "
        "check's are what gravity with x_bar of the other sign gives (-13.54, 22.27 kPa)"
    )
    yield Number("cell 1 folds, in the straw", "check", -13.55, down.pressure_pa / 1e3, "kPa", 0.05, why)
    yield Number("cell 1 deploys, in the straw", "check", 22.25, up.pressure_pa / 1e3, "kPa", 0.05, why)
    for cell, time_s in ((1, 1.19), (4, 2.35)):
        name = f"cell {cell} crosses zeta = 0 in the deployment"
        yield Number(name, "check", time_s, crossing_s(deployment, cell), "s", 0.005)


def _kpa(pressures: tuple[float, ...]) -> str:
    return ", ".join(f"{p / 1e3:.2f}" for p in pressures)
