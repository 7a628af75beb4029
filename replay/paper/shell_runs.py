"""The effects of the shell's energy: E and h refitted, Figs. 6 and 7, and whether it explains more of the paper."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from straw.model.geometry import Geometry, identify_geometry
from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.replay.paper.numbers import READINGS
from straw.replay.paper.runs import DEPLOYMENT, FOLDING, ValidationRun, crossing_s
from straw.replay.paper.style import STABLE, UNSTABLE, figure, label
from straw.replay.shell.table import Row

#: The delay that brings the model's first snap of Fig. 7 to the measured one, s (section 3.3).
DELAY_S = 0.77


@dataclass(frozen=True)
class Elastic:
    """The two validation runs with one elasticity."""

    name: str
    straw: StrawParameters
    folding: Prediction
    deployment: Prediction


def refitted() -> Geometry:
    """zeta_01, zeta_02, h and E from the lengths and snap pressures of section 3.1, by finite elements' energy."""
    return identify_geometry(READINGS, StrawParameters(elasticity="shell"))


def elastic_runs(geometry: Geometry) -> list[Elastic]:
    """Figs. 6 and 7 by equation 7, by finite elements, and by these with the constants refitted."""
    fitted = geometry.straw
    own = {"zeta0_m": fitted.zeta0_m[0], "h_m": fitted.h_m[0], "E_pa": fitted.E_pa[0]}
    made = []
    elasticities: tuple[tuple[str, dict[str, Any]], ...] = (
        ("equation 7", {}),
        ("finite elements, the paper's E and h", {"elasticity": "shell"}),
        ("finite elements, refitted", {"elasticity": "shell", **own}),
    )
    for name, changes in elasticities:
        runs = [_run(run, changes) for run in (FOLDING, DEPLOYMENT)]
        made.append(Elastic(name, FOLDING.straw.replace(**changes), *runs))
    return made


def _run(run: ValidationRun, changes: dict[str, Any]) -> Prediction:
    return replace(run, straw=run.straw.replace(**changes)).simulate()


def verdict(runs: list[Elastic]) -> list[str]:
    """The effect of finite elements on the paper's open questions: delay, run-to-run constants, bent states."""
    base, _, fitted = runs
    lines = []
    for one in runs:
        first, fourth = (crossing_s(one.deployment, cell) for cell in (1, 4))
        fold = [crossing_s(one.folding, cell) for cell in (1, 4)]
        bent = [float(np.abs(p.frustum_phi_rad[:, 0, 1]).max()) for p in (one.folding, one.deployment)]
        lines.append(
            f"{one.name}: deployment {first:.3f} and {fourth:.3f} s, {fourth - first:.3f} s apart; "
            f"folding {fold[0]:.3f} and {fold[1]:.3f} s; cell 1 bends to {bent[0]:.3f} rad folding, "
            f"{bent[1]:.3f} deploying"
        )
    wanted = crossing_s(base.deployment, 1) + DELAY_S
    moved = crossing_s(fitted.deployment, 1) - crossing_s(base.deployment, 1)
    better = moved > DELAY_S / 4
    lines.append(
        f"the first snap of Fig. 7 was measured {DELAY_S:g} s later than by equation 7 (at {wanted:.2f} s); "
        f"finite elements move it by {moved:+.2f} s: {'part of' if better else 'not'} what is missing"
    )
    apart = [crossing_s(one.folding, 4) - crossing_s(one.folding, 1) for one in (base, fitted)]
    lines.append(
        f"the snaps of Fig. 6, which equation 7 meets with c_zeta = 620 and r_ch = 0.43 mm, come {apart[0]:.2f} s "
        f"apart by it and {apart[1]:.2f} s by finite elements refitted: these constants would have to be refitted, "
        "again per run"
    )
    lines.append(
        "so finite elements' walls explain the paper "
        + ("better" if better else "no better: neither the delay nor one set of constants for both runs; ")
        + "the folding still passes the bent state, the deployment still does not"
    )
    return lines


def draw_runs(runs: list[Elastic]) -> Figure:
    """Tip orientation and height in both runs, by each elasticity."""
    fig = figure(10, 5.2)
    panels = fig.subplots(2, 2, sharex="col")
    for one, colour, dash in zip(runs, ("#e08a1e", "#888888", STABLE), ("--", ":", "-"), strict=True):
        for column, p in enumerate((one.folding, one.deployment)):
            panels[0, column].plot(p.time_s, 1e3 * p.z_m, color=colour, ls=dash, lw=1.1, label=one.name)
            panels[1, column].plot(p.time_s, np.degrees(p.phi_rad), color=colour, ls=dash, lw=1.1)
    measured = crossing_s(runs[0].deployment, 1) + DELAY_S
    for axes in panels[:, 1]:
        axes.axvline(measured, color=UNSTABLE, lw=0.8)
    label(panels[0, 0], "folding, Fig. 6", "", r"$Z_\mathrm{tip}$ / mm")
    label(panels[0, 1], "deployment, Fig. 7; red: first snap as measured", "", r"$Z_\mathrm{tip}$ / mm")
    for axes in panels[1]:
        label(axes, "", "t / s", r"$\Phi_\mathrm{tip}$ / deg")
    panels[0, 0].legend(loc="best")
    return fig


def snap_rows(geometry: Geometry) -> list[Row]:
    """Section 3.1's constants, by equation 7 and by finite elements."""
    paper = StrawParameters()
    pairs = (
        ("zeta_01 refitted", "mm", 1e3 * paper.zeta0_m[0, 0], 1e3 * geometry.zeta01_m),
        ("zeta_02 refitted", "mm", 1e3 * paper.zeta0_m[0, 1], 1e3 * geometry.zeta02_m),
        ("h refitted", "mm", 1e3 * paper.h_m[0, 1], 1e3 * geometry.h_m),
        ("E refitted", "GPa", paper.E_pa[0, 1] / 1e9, geometry.E_pa / 1e9),
    )
    return [Row(name, unit, float(a), float(b)) for name, unit, a, b in pairs]
