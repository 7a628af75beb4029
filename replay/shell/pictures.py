"""Pictures of finite elements: the energy beside the reduced one, forces of the straight wall, and stress in it."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from straw.model.frustum import Frustum
from straw.model.shell.equilibria import Balance, straight_curve
from straw.model.shell.landscape import Landscape
from straw.model.shell.problem import Problem
from straw.model.shell.solve import Model, Point
from straw.model.shell.strain import Floats
from straw.model.shell.stress import stressed
from straw.replay.paper.landscape import PHI_LABEL, ZETA_LABEL, mark
from straw.replay.paper.style import STABLE, UNSTABLE, figure, label


def energy_map(land: Landscape, flat: Frustum, found: list[Balance], lower_m: float = 0.0) -> Figure:
    """Energy over (zeta, phi) by finite elements, beside equation 7's, and the difference of the two.

    ``lower_m`` is the height of a cell's lower frustum, which equation 7 takes to be rigid. Where the least stiffness
    by (zeta, phi) is zero, a state that a load has brought there ends: bifurcations under any load lie on that line.
    """
    zeta, phi = 1e3 * land.column("zeta_m"), land.column("phi_rad")
    energy, pressure = 1e3 * land.column("energy_j"), land.problem.pressure_pa
    reduced = 1e3 * flat.energy(zeta / 1e3 - lower_m, phi, pressure)
    if pressure:  # what the gas at rest has done is no energy of the walls: both count from the unloaded shape
        rest = int(np.argmin(np.abs(zeta - 1e3 * land.problem.profile.height_m) + 1e3 * phi))
        energy, reduced = energy - energy[rest], reduced - reduced[rest]
    barrier = _barrier_mj(flat)
    most = _up(1.8 * barrier if barrier > 0.01 * np.median(energy) else float(np.median(energy)))
    z, f = np.concatenate([zeta, zeta]), np.concatenate([phi, -phi])
    mesh = Triangulation(z, f)
    # triangles much longer than the rows' distance bridge unsolved points
    longest = 2.0 / min(len(np.unique(zeta)), 12)
    keep = np.hypot(*(np.ptp(x[mesh.triangles], axis=1) / np.ptp(x) for x in (z, f))) < longest
    mesh.set_mask(~keep)
    fig = figure(12.6, 3.9)
    axes = fig.subplots(1, 3, sharey=True)
    both, reduced = (np.concatenate([one, one]) for one in (energy, reduced))
    below = -float(min(both.min(), reduced.min()))
    low = -_up(below) if below > 0.01 * most else 0.0
    levels = np.linspace(low, most, 21)
    shade = axes[0].tricontourf(mesh, np.minimum(both, 1.2 * most), levels=levels, cmap="Blues_r", extend="max")
    axes[0].tricontour(mesh, np.minimum(both, 1.2 * most), levels=levels, colors="white", linewidths=0.35)
    across = ZETA_LABEL if not lower_m else "height of the cell / mm"
    label(axes[0], "(a) finite elements", across, PHI_LABEL)
    for b in found:
        for side in {1, -1} if b.point.phi_rad else {1}:
            mark(axes[0], 1e3 * b.point.zeta_m, side * b.point.phi_rad, b.stable)
    axes[1].tricontourf(mesh, np.minimum(reduced, 1.2 * most), levels=levels, cmap="Blues_r", extend="max")
    axes[1].tricontour(mesh, np.minimum(reduced, 1.2 * most), levels=levels, colors="white", linewidths=0.35)
    label(axes[1], "(b) equation 7" + (", lower frustum rigid" if lower_m else ""), across, "")
    for e in flat.equilibria(pressure):
        mark(axes[1], 1e3 * (e.zeta_m + lower_m), e.phi_rad, e.stable)
    r_i, stiff = flat.r_i, [land.column(name) for name in ("k_zeta_n_per_m", "k_mixed_n", "k_phi_n_m")]
    own = _least(stiff[0] * r_i**2, stiff[1] * r_i, stiff[2])
    K = np.array([flat.stiffness(a, b) for a, b in zip(zeta / 1e3 - lower_m, phi, strict=True)])
    for panel, least in ((axes[0], own), (axes[1], _least(K[:, 0, 0], K[:, 0, 1], K[:, 1, 1]))):
        panel.tricontour(
            mesh, np.concatenate([least, least]), levels=[0.0], colors=UNSTABLE, linewidths=0.9, linestyles="--"
        )
    off = np.where(both < most, both - reduced, np.nan)
    span = _up(float(np.nanpercentile(np.abs(off), 95)))
    shown = Triangulation(z, f, mesh.triangles, mask=~keep | np.isnan(off)[mesh.triangles].any(axis=1))
    drawn = axes[2].tricontourf(
        shown, np.clip(np.nan_to_num(off), -span, span), levels=np.linspace(-span, span, 21), cmap="RdBu_r"
    )
    label(axes[2], f"(c) difference, where energy < {most:.3g} mJ", across, "")
    ticks = np.linspace(-span, span, 5)
    fig.colorbar(drawn, ax=axes[2], label="finite elements minus equation 7 / mJ", pad=0.02, ticks=ticks)
    for name, stable in (("stable", True), ("unstable", False)):
        mark(axes[0], np.nan, np.nan, stable, name)
    axes[0].plot([], [], color=UNSTABLE, lw=0.9, ls="--", label="bifurcations")
    axes[0].legend(loc="upper left", frameon=True, framealpha=0.85, edgecolor="none")
    fig.colorbar(shade, ax=axes[:2], label="energy / mJ", pad=0.02)
    return fig


def _least(aa: Floats, ab: Floats, bb: Floats) -> Floats:
    """The lesser eigenvalue of [[aa, ab], [ab, bb]]."""
    return np.asarray((aa + bb) / 2 - np.hypot((aa - bb) / 2, ab))


def _up(value: float) -> float:
    """A positive number rounded up to two digits, for a scale."""
    step = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(step * np.ceil(value / step - 1e-9))


def _barrier_mj(flat: Frustum) -> float:
    return max(1e3 * float(flat.energy(np.array(e.zeta_m), np.array(e.phi_rad))) for e in flat.equilibria())


def straight_figure(problem: Problem, flat: Frustum) -> Figure:
    """Energy, force and both stiffnesses of the straight wall against its height, beside equation 7's."""
    z = np.linspace(-1.25, 1.25, 121) * abs(flat.zeta0)
    curve = straight_curve(problem, z)
    stiffness = np.array([flat.stiffness(float(x), 0.0) for x in z])
    reduced = (
        1e3 * flat.energy(z, np.zeros_like(z)),
        np.array([flat.force(float(x), 0.0)[0] for x in z]),
        stiffness[:, 0, 0] / flat.r_i**2 / 1e3,
        stiffness[:, 1, 1],
    )
    shown = (1e3 * curve[:, 0], curve[:, 1], curve[:, 2] / 1e3, curve[:, 3])
    names = ("energy / mJ", "axial force / N", "axial stiffness / (kN/m)", "bending stiffness / (N m/rad)")
    fig = figure(10, 5.4)
    for axes, one, other, name in zip(fig.subplots(2, 2).ravel(), shown, reduced, names, strict=True):
        axes.axhline(0, color="#bbbbbb", lw=0.7)
        axes.plot(1e3 * z, other, color=UNSTABLE, ls="--", label="equation 7")
        axes.plot(1e3 * z, one, color=STABLE, label="finite elements")
        label(axes, "", ZETA_LABEL, name)
    fig.axes[1].legend(loc="lower right")
    return fig


def deformed_figure(shapes: list[tuple[str, Model, Point]]) -> Figure:
    """Deformed walls in their stable states, coloured by von Mises' stress at the more stressed face."""
    walls = [(title, stressed(model, point)) for title, model, point in shapes]
    most = max(float(np.percentile(s, 99.5)) for _, parts in walls for _, s in parts) / 1e6
    norm, colours = Normalize(0, most or 1.0), colormaps["viridis"]
    fig = figure(3.4 * len(walls), 3.6)
    drawn = []
    for i, (title, parts) in enumerate(walls, 1):
        axes = fig.add_subplot(1, len(walls), i, projection="3d")
        for place, stress in parts:
            x, y, z = (1e3 * place[..., k] for k in range(3))
            faces = colours(norm(stress / 1e6))
            axes.plot_surface(x, y, z, facecolors=faces, rstride=1, cstride=1, linewidth=0, shade=False)
        axes.set_title(title)
        heights = np.concatenate([1e3 * place[..., 2].ravel() for place, _ in parts])
        middle = (heights.min() + heights.max()) / 2
        axes.set_zlim(middle - 5, middle + 5)
        axes.set_box_aspect((1, 1, 0.35), zoom=1.35)
        axes.set(xlabel="x / mm", ylabel="y / mm", zlabel="z / mm")
        axes.view_init(22, -60)
        drawn.append(axes)
    fig.colorbar(ScalarMappable(norm, colours), ax=drawn, label="von Mises stress / MPa", shrink=0.7, pad=0.06)
    return fig
