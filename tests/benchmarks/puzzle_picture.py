"""The puzzle's picture: each run measured, base and improved model with one set; constants of each run's own fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.systems.straw.observation import Observation
from straw.replay.diagnose.systems.straw.simulated import simulated
from straw.replay.paper.style import figure

from .puzzle_fits import DELAY, Number

MEASURED, BASE, IMPROVED = "#1b1f24", "#d55e00", "#0072b2"
#: Curves of a run: title, factor.
CURVES = (("X / mm", 1e3), ("Phi / deg", 180 / np.pi))
#: Constants as drawn: target, title, factor, whether its axis is logarithmic.
DRAWN = (
    ("straw.c_zeta_n_s_per_m", "c_zeta / N s/m", 1.0, True),
    ("straw.c_phi_n_m_s_per_rad", "c_phi / mN m s", 1e3, True),
    ("straw.r_ch_m", "r_ch / mm", 1e3, False),
    (DELAY, "delay / ms", 1e3, False),
)


def draw(
    path: Path,
    observations: Sequence[Observation],
    fitted: Sequence[str],
    straws: Sequence[StrawParameters],
    alone: Mapping[str, tuple[Mapping[str, Number], Mapping[str, Number]]],
    common: tuple[Mapping[str, Number], Mapping[str, Number]],
) -> None:
    """Save as the path's suffix says. ``alone`` has for each fitted run its own constants by base and improved model,
    ``common`` the one set of each.
    """
    fig = figure(12.0, 2.0 * len(observations) + 3.2)
    rows = fig.subplots(len(observations) + 1, 1, height_ratios=[1.0] * len(observations) + [1.5])
    for place in rows:
        place.remove()
    grid = rows[0].get_gridspec()
    for k, o in enumerate(observations):
        panels = [fig.add_subplot(part) for part in grid[k].subgridspec(1, 2)]
        for panel, values, (name, factor) in zip(panels, o.tip[[0, 2]], CURVES, strict=True):
            panel.plot(o.time_s, factor * values, color=MEASURED, lw=2.4, alpha=0.55, label="measured")
            panel.set_ylabel(name)
            panel.set_xlim(0, o.end_s)
        for straw, color, label in zip(straws, (BASE, IMPROVED), ("base, one set", "improved, one set"), strict=True):
            seen = simulated(o, straw, (), np.empty(0)).prediction
            for panel, values, (_, factor) in zip(panels, (seen.x_m, seen.phi_rad), CURVES, strict=True):
                panel.plot(seen.time_s, factor * values, color=color, lw=0.9, label=label)
        panels[0].set_title(o.name + ("" if o.name in fitted else " (not fitted)"), loc="left")
        if k == 0:
            panels[0].legend(loc="lower right")
        if k == len(observations) - 1:
            for panel in panels:
                panel.set_xlabel("time since the run's zero / s")
    for part, (target, title, factor, logarithmic) in zip(grid[-1].subgridspec(1, len(DRAWN)), DRAWN, strict=True):
        panel = fig.add_subplot(part)
        for which, color in enumerate((BASE, IMPROVED)):
            found = [alone[name][which][target] for name in fitted]
            panel.errorbar(
                np.arange(len(fitted)) + 0.2 * (which - 0.5),
                [factor * n.value for n in found],
                [factor * n.sigma for n in found],
                fmt="o", ms=4, color=color, capsize=2,
            )  # fmt: skip
            one = common[which].get(target)
            panel.axhline(factor * one.value if one else 0.0, color=color, lw=0.8, ls="--")
        if logarithmic:
            panel.set_yscale("log")
            panel.yaxis.set_major_formatter("{x:g}")
            low, high = panel.get_ylim()
            panel.yaxis.set_minor_formatter("{x:g}" if high < 30 * low else "")
            panel.tick_params(axis="y", which="minor", labelsize=6)
        panel.set_title(title, loc="left")
        panel.set_xticks(range(len(fitted)), fitted, rotation=30, ha="right", fontsize=7)
    fig.suptitle("below: constants of each run's own fit, with one sigma; dashed: the one set", fontsize=10)
    part = path.with_name(path.name + ".part")
    fig.savefig(part, format=path.suffix.lstrip(".").lower() or "png", dpi=110)
    part.replace(path)
