"""Figs. 6 and 7, the model's side: the tip in a validation run, and all frusta on their energy and in time."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from straw.model.frustum_table import frustum_of
from straw.model.simulate import Prediction
from straw.replay.paper.landscape import PHI_LABEL, ZETA_LABEL, branches, draw_energy
from straw.replay.paper.runs import ValidationRun
from straw.replay.paper.style import CELLS, QUIET, figure, label

#: Energy between contours in (d), mJ.
CONTOUR_MJ = 6.0


def motion(run: ValidationRun, moved: Prediction) -> Figure:
    """Tip against time (a, b, c), frusta on the energy under the steady pressure (d), zeta and phi in time (e, f).

    Dashed in (d): the antisymmetric equilibria of Fig. 5, of all pressures. The energy there includes the pull of the
    sealed end, which every frustum of a straw carries.
    """
    fig = figure(10.5, 6.4)
    panels = fig.subplots(2, 3)
    t = moved.time_s
    tip = (
        (moved.x_m * 1e3, "(a) horizontal", r"$X_\mathrm{tip}$ / mm"),
        (moved.z_m * 1e3, "(b) vertical", r"$Z_\mathrm{tip}$ / mm"),
        (np.degrees(moved.phi_rad), "(c) orientation", r"$\Phi_\mathrm{tip}$ / deg"),
    )
    for axes, (values, title, name) in zip(panels[0], tip, strict=True):
        axes.plot(t, values, color="#222222")
        label(axes, title, "t / s", name)
    landscape, *in_time = panels[1]
    frustum = frustum_of(run.straw, sealed=True)
    draw_energy(landscape, frustum, run.steady_pa, CONTOUR_MJ)
    label(landscape, f"(d) on the energy, every {CONTOUR_MJ:g} mJ", ZETA_LABEL, PHI_LABEL)
    for _, zeta, phi, _ in branches(frustum, np.inf)[1:]:
        landscape.plot(1e3 * zeta, phi, color="black", lw=0.7, ls=(0, (5, 3)), label="_")
    landscape.text(0, -0.235, "antisymmetric states", ha="center", va="top", fontsize=7.5, color="white")
    for cell in sorted(range(1, run.straw.cells + 1), key=lambda cell: cell in run.snapping):
        _one_cell(landscape, in_time, moved, cell, cell in run.snapping)
    label(in_time[0], "(e) axisymmetric", "t / s", ZETA_LABEL)
    label(in_time[1], "(f) antisymmetric", "t / s", PHI_LABEL)
    in_time[0].legend(loc="center right")
    for axes in (*panels[0], *in_time):
        axes.set_xlim(t[0], t[-1])
    fig.suptitle(
        f"{run.name}: {run.steady_pa / 1e3:g} kPa, cells {' and '.join(map(str, run.snapping))} snap",
        x=0.01, ha="left", fontsize=11, weight="bold",
    )  # fmt: skip
    return fig


def _one_cell(landscape: Axes, in_time: list[Axes], moved: Prediction, cell: int, snaps: bool) -> None:
    zeta, phi = 1e3 * moved.zeta_m[:, cell - 1, 1], moved.frustum_phi_rad[:, cell - 1, 1]
    colour, width, order = (CELLS[cell], 1.4, 4) if snaps else (QUIET, 0.7, 3)
    name = f"cell {cell}" if snaps else "others" if cell == 2 else None
    for axes, values in zip(in_time, (zeta, phi), strict=True):
        axes.plot(moved.time_s, values, color=colour, lw=width, zorder=order, label=name)
    landscape.plot(zeta, phi, color=colour, lw=width, zorder=order)
    if snaps:
        landscape.plot(zeta[0], phi[0], "s", color=colour, mec="white", ms=6, zorder=6)
