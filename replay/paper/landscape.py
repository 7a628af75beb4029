"""Figs. 4 and 5: one active frustum's energy, its equilibria, and the effect of pressure on them."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from straw.model.frustum import Equilibrium, Frustum
from straw.model.frustum_table import frustum_of
from straw.model.parameters import StrawParameters
from straw.replay.paper.style import STABLE, UNSTABLE, figure, label

Floats = NDArray[np.float64]

#: Ranges of the panels, m and rad.
ZETA_M, PHI_RAD = (-3.4e-3, 3.2e-3), (-0.34, 0.34)
ZETA_LABEL, PHI_LABEL = r"$\zeta_{n,2}$ / mm", r"$\varphi_{n,2}$ / rad"


def draw_energy(axes: Axes, frustum: Frustum, pressure_pa: float = 0.0, step_mj: float = 2.0) -> ContourSet:
    """Energy in mJ above the deepest state, a white contour every ``step_mj``, with the equilibria."""
    zeta, phi = np.meshgrid(np.linspace(*ZETA_M, 321), np.linspace(*PHI_RAD, 281))
    found = frustum.equilibria(pressure_pa)
    deepest = min(_energy_mj(frustum, e, pressure_pa) for e in found)
    energy = 1e3 * frustum.energy(zeta, phi, pressure_pa) - deepest
    levels = step_mj * np.arange(27)
    shade = axes.contourf(1e3 * zeta, phi, energy, levels=levels, cmap="Blues_r", extend="max")
    axes.contour(1e3 * zeta, phi, energy, levels=levels, colors="white", linewidths=0.35)
    for e in found:
        mark(axes, 1e3 * e.zeta_m, e.phi_rad, e.stable)
    axes.set(xlim=(1e3 * ZETA_M[0], 1e3 * ZETA_M[1]), ylim=PHI_RAD)
    return shade


def mark(axes: Axes, x: float, y: float, stable: bool, name: str | None = None) -> None:
    """The mark of an equilibrium."""
    shape, colour = ("o", STABLE) if stable else ("X", UNSTABLE)
    axes.plot(x, y, shape, color=colour, mec="white", mew=0.9, ms=7, zorder=5, ls="none", label=name)


def _energy_mj(frustum: Frustum, e: Equilibrium, pressure_pa: float = 0.0) -> float:
    return 1e3 * float(frustum.energy(np.array(e.zeta_m), np.array(e.phi_rad), pressure_pa))


def energy_surface() -> Figure:
    """Fig. 4: the energy at zero gauge pressure (a) and its cuts through the stable states (b, c)."""
    frustum = frustum_of(StrawParameters())
    fig = figure(10, 4.2)
    grid = fig.add_gridspec(2, 2, width_ratios=(1.45, 1))
    surface = fig.add_subplot(grid[:, 0])
    shade = draw_energy(surface, frustum)
    fig.colorbar(shade, ax=surface, label="potential energy / mJ", pad=0.02, ticks=MaxNLocator(7))
    label(surface, "(a) energy of one active frustum, 0 kPa", ZETA_LABEL, PHI_LABEL)
    for stable, name in ((True, "stable"), (False, "unstable")):
        mark(surface, np.nan, np.nan, stable, name)
    surface.legend(loc="upper left", frameon=True, framealpha=0.85, edgecolor="none")
    bent = next(e.zeta_m for e in frustum.equilibria() if e.stable and e.phi_rad > 0)
    surface.axhline(0, color="#e08a1e", ls="--", lw=1)
    surface.axvline(1e3 * bent, color="#e08a1e", ls="--", lw=1)
    zeta, phi = np.linspace(*ZETA_M, 500), np.linspace(*PHI_RAD, 500)
    cuts = (
        (1e3 * zeta, frustum.energy(zeta, np.zeros(500)), "(b) along φ = 0", ZETA_LABEL),
        (phi, frustum.energy(np.full(500, bent), phi), f"(c) along ζ = {1e3 * bent:.2f} mm", PHI_LABEL),
    )
    for row, (x, energy, title, name) in enumerate(cuts):
        axes = fig.add_subplot(grid[row, 1])
        axes.plot(x, 1e3 * energy, color="#e08a1e")
        label(axes, title, name, "energy / mJ")
        axes.set(xlim=(x[0], x[-1]), ylim=(-2, 40))
        for e in frustum.equilibria():
            if (e.phi_rad == 0) if row == 0 else abs(e.zeta_m - bent) < 1e-9:
                mark(axes, 1e3 * e.zeta_m if row == 0 else e.phi_rad, _energy_mj(frustum, e), e.stable)
    return fig


def branches(frustum: Frustum, most_pa: float) -> list[tuple[Floats, Floats, Floats, NDArray[np.bool_]]]:
    """Branches of equilibria up to a pressure: pressure, zeta, phi and stability, each (points,), in closed form."""
    out = []
    reach = abs(frustum.zeta0) * 1.6
    zeta = np.linspace(-reach, reach, 4001)
    width = np.sqrt((4 * frustum.zeta0**2 - frustum.C2 / frustum.C1) / 12)
    inner = width * np.cos(np.linspace(np.pi, 0, 2001))  # dense where phi meets the axis
    for z, side in ((zeta, 0), (inner, 1), (inner, -1)):
        phi = np.array([side * frustum.bent_angle(x) for x in z])
        pressure = np.array([frustum.pressure_at(x, f) for x, f in zip(z, phi, strict=True)])
        softest = [np.linalg.eigvalsh(frustum.stiffness(x, f))[0] for x, f in zip(z, phi, strict=True)]
        seen = np.abs(pressure) <= most_pa
        out.append((np.where(seen, pressure, np.nan), z, phi, np.array(softest) > 0))
    return out


def bifurcations() -> Figure:
    """Fig. 5: equilibria of a frustum against the pressure on it, in three views."""
    frustum = frustum_of(StrawParameters())
    bounds = frustum.bifurcation_pressures()
    most_pa = 1.3 * bounds[-1]
    fig = figure(10, 4.0)
    panels = fig.subplots(1, 3, width_ratios=(1.25, 1.25, 1))
    for pressure, zeta, phi, stable in branches(frustum, most_pa):
        # unstable dashed on top: in (b) and (c) the axisymmetric states lie on one line
        for part, colour, dash in ((stable, STABLE, "-"), (np.logical_not(stable), UNSTABLE, (0, (4, 2)))):
            p, z, f = (np.where(part & np.isfinite(pressure), x, np.nan) for x in (1e-3 * pressure, 1e3 * zeta, phi))
            panels[0].plot(p, z, color=colour, ls=dash, lw=1.8)
            panels[1].plot(p, f, color=colour, ls=dash, lw=1.8)
            panels[2].plot(z, f, color=colour, ls=dash, lw=1.8)
    edges = [-1e-3 * most_pa, *(1e-3 * b for b in bounds), 1e-3 * most_pa]
    for axes in panels[:2]:
        for bound in bounds:
            axes.axvline(1e-3 * bound, color="#888888", lw=0.7, ls=":")
        axes.set(xlim=(edges[0], edges[-1]))
    for i, states in enumerate((1, 2, 4, 2, 1)):
        middle = (edges[i] + edges[i + 1]) / 2
        panels[0].text(middle, 3.05, f"{states}", ha="center", color="#444444", fontsize=9, weight="bold")
    panels[0].text(edges[0], 3.4, "stable states:", ha="left", va="bottom", color="#444444", fontsize=8)
    for bound in bounds:
        panels[1].text(
            1e-3 * bound,
            -0.293,
            f"{1e-3 * bound:.1f}",
            rotation=90,
            ha="right",
            va="bottom",
            fontsize=8,
            color="#444444",
        )
    panels[0].set(ylim=(-3.5, 3.9))
    panels[1].set(ylim=(-0.3, 0.3))
    label(panels[0], "(a)", "pressure on the frustum / kPa", ZETA_LABEL)
    label(panels[1], "(b)", "pressure on the frustum / kPa", PHI_LABEL)
    label(panels[2], "(c)", ZETA_LABEL, PHI_LABEL)
    panels[2].set(xlim=(-3.5, 3.5), ylim=(-0.3, 0.3))
    panels[2].plot([], [], color=STABLE, label="stable")
    panels[2].plot([], [], color=UNSTABLE, ls=(0, (4, 2)), label="unstable")
    panels[2].legend(loc="upper right")
    return fig
