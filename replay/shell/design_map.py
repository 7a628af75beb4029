"""The map of a design search: every design swept by what it gives, and the chosen ones; and an order of snaps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from straw.model.design import Design
from straw.model.parameters import StrawParameters
from straw.model.wish import Wish
from straw.replay.paper.style import STABLE, UNSTABLE, figure, label

NAMES = {
    "deploy_kpa": "deploys at / kPa",
    "fold_kpa": "folds at / kPa",
    "folded_length_mm": "folded cell / mm",
    "deployed_length_mm": "deployed cell / mm",
    "r_i_mm": "inner radius / mm",
    "r_o_mm": "outer radius / mm",
    "zeta01_mm": r"$\zeta_{0,1}$ / mm",
    "zeta02_mm": r"$\zeta_{0,2}$ / mm",
    "h_mm": "thickness / mm",
    "E_gpa": "modulus / GPa",
}


def design_map(wish: Wish, designs: Sequence[Design], best: Sequence[Design]) -> Figure:
    """Snap pressures of all designs, and the distance of each from the wish over the two most influential constants."""
    fig = figure(10, 4.3)
    left, right = fig.subplots(1, 2)
    cost = np.log10([d.cost + 1e-2 for d in designs])
    bounds = {"vmin": np.percentile(cost, 1), "vmax": np.percentile(cost, 90)}
    fold, deploy = ([d.gives[k] for d in designs] for k in ("fold_kpa", "deploy_kpa"))
    left.scatter(fold, deploy, c=cost, s=7, cmap="viridis_r", **bounds)
    if {"fold_kpa", "deploy_kpa"} & set(wish.wanted):
        if "fold_kpa" in wish.wanted:
            left.axvline(wish.wanted["fold_kpa"], color=UNSTABLE, lw=0.8)
        if "deploy_kpa" in wish.wanted:
            left.axhline(wish.wanted["deploy_kpa"], color=UNSTABLE, lw=0.8)
    left.set_xlim(np.nanpercentile(fold, 3), 0)
    left.set_ylim(0, np.nanpercentile(deploy, 97))
    label(left, "(a) snap pressures, sealed end", NAMES["fold_kpa"], NAMES["deploy_kpa"])
    names = _most_telling(wish, designs, best)
    x, y = ([d.varied[name] for d in designs] for name in names)
    dots = right.scatter(x, y, c=cost, s=7, cmap="viridis_r", **bounds)
    label(right, "(b) geometry", NAMES[names[0]], NAMES[names[1]])
    for number, design in enumerate(best, 1):
        for axes, place in (
            (left, (design.gives["fold_kpa"], design.gives["deploy_kpa"])),
            (right, (design.varied[names[0]], design.varied[names[1]])),
        ):
            axes.plot(*place, "o", ms=9, mfc="none", mec=UNSTABLE, mew=1.4)
            axes.annotate(str(number), place, xytext=(6, 4), textcoords="offset points", color=UNSTABLE)
    fig.colorbar(dots, ax=[left, right], label="distance from the wish, log10 of squares", pad=0.02)
    return fig


def _most_telling(wish: Wish, designs: Sequence[Design], best: Sequence[Design]) -> list[str]:
    """The varied constant in which the best tenth of designs is narrowest, and the one in which the chosen differ
    most."""
    names = list(wish.vary)
    if len(names) == 1:
        return names * 2
    near = sorted(designs, key=lambda d: d.cost)[: max(5, len(designs) // 10)]

    def spread(some: Sequence[Design], name: str) -> float:
        return float(np.std([d.varied[name] for d in some])) / (wish.vary[name][1] - wish.vary[name][0])

    first = min(names, key=lambda n: spread(near, n))
    return [first, max((n for n in names if n != first), key=lambda n: spread(best, n))]


def order_figure(
    wish: Wish, straw: StrawParameters, seen: Sequence[tuple[int, float]], shell_pa: Sequence[float] = ()
) -> Figure:
    """The pressure at which each cell snaps quasi-statically, by finite elements too; even frusta's thickness."""
    fig = figure(8, 3.6)
    left, right = fig.subplots(1, 2)
    cells, pressures = [c for c, _ in seen], [p / 1e3 for _, p in seen]
    left.step([0, *pressures], range(len(seen) + 1), where="post", color=STABLE)
    for k, (cell, pressure) in enumerate(zip(cells, pressures, strict=True)):
        left.annotate(f"cell {cell}", (pressure, k + 1), xytext=(-4, 2), textcoords="offset points", ha="right")
        left.plot(wish.first_kpa + k * wish.apart_kpa, k + 1, "x", color=UNSTABLE)
    at = [p / 1e3 for p in shell_pa]
    left.plot(at, range(1, len(at) + 1), "o", mfc="none", color="#888888")
    circles = "; circles: with finite elements" if np.any(np.isfinite(at)) else ""
    label(left, f"(a) snaps; crosses: wanted{circles}", "pressure / kPa", "cells that have snapped")
    right.bar(range(1, straw.cells + 1), 1e3 * straw.h_m[:, 1], color=STABLE)
    right.set_xticks(range(1, straw.cells + 1))
    label(right, "(b) thickness of the even frusta", "cell", "h / mm")
    return fig
