"""Fig. 3: the straw at rest without pressure, in three of its stable states."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from straw.model.configuration import even
from straw.model.kinematics import tip_pose
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.replay.paper.style import figure, label

Floats = NDArray[np.float64]

#: Cells deployed and cells bent (+1 down, -1 up) of each panel; the paper does not say which its photographs show.
STATES: tuple[tuple[str, tuple[int, ...], dict[int, int]], ...] = (
    ("all cells deployed", tuple(range(1, 10)), {}),
    ("deployed; 2, 5, 8 bent up", (1, 3, 4, 6, 7, 9), {2: -1, 5: -1, 8: -1}),
    ("folded; 3-5 bent down, 7-8 deployed", (7, 8), {3: 1, 4: 1, 5: 1}),
)


def outline_m(straw: StrawParameters, q: Floats) -> tuple[Floats, Floats]:
    """Walls above and below the axis, each (2 cells + 1, 2) in X, Z: bases at r_i and middle surfaces at r_o in turn.

    For the truncated form: the odd frustum of a cell is rigid, so its base and its middle surface are parallel.
    """
    zeta, phi = even(straw, q)
    place, angle = np.zeros(2), straw.phi_0_rad
    upper, lower = [], []

    def ring(centre: Floats, normal: float, radius: float) -> None:
        across = radius * np.array([-np.cos(normal), np.sin(normal)])
        upper.append(centre + across)
        lower.append(centre - across)

    ring(place, angle, straw.r_i_m)
    for n in range(straw.cells):
        along = np.array([np.sin(angle), np.cos(angle)])
        ring(place + straw.zeta0_m[n, 0] * along, angle, straw.r_o_m)
        place = place + (straw.zeta0_m[n, 0] + zeta[n]) * along
        angle += phi[n]
        ring(place, angle, straw.r_i_m)
    return np.array(upper), np.array(lower)


def shapes() -> Figure:
    """Fig. 3 (b, d, f): the predicted shapes, to one scale."""
    straw = StrawParameters()
    fig = figure(10, 3.6)
    panels = fig.subplots(1, len(STATES), sharey=True)
    for letter, axes, (title, deployed, bent) in zip("bdf", panels, STATES, strict=True):
        q = rest_state(straw, deployed, 0.0, bent)
        _draw(axes, straw, q)
        x, z, angle = tip_pose(straw.constants(), q)
        label(axes, f"({letter}) {title}", "X / mm", "Z / mm" if letter == "b" else "")
        axes.text(
            0.98, 0.02, f"tip {x * 1e3:.1f}, {z * 1e3:.1f} mm, {np.degrees(angle):.1f}°",
            transform=axes.transAxes, ha="right", va="bottom", fontsize=8,
        )  # fmt: skip
    return fig


def _draw(axes: Axes, straw: StrawParameters, q: Floats) -> None:
    upper, lower = (1e3 * wall for wall in outline_m(straw, q))
    body = np.vstack([upper, lower[::-1]])
    axes.fill(body[:, 0], body[:, 1], color="#dbe9f6", zorder=1)
    for n in range(len(upper)):
        inner = n % 2 == 0
        axes.plot(*np.array([upper[n], lower[n]]).T, color="#7d99b5", lw=0.5 if inner else 0.9, zorder=2)
    for wall in (upper, lower):
        axes.plot(wall[:, 0], wall[:, 1], color="#1d3c5a", lw=1.3, zorder=3, solid_joinstyle="round")
    axes.plot(*np.array([upper[-1], lower[-1]]).T, color="#333333", lw=4, solid_capstyle="butt", zorder=4)
    axes.axvspan(-4, 0, color="#cccccc", zorder=0)  # the clamp
    axes.set(aspect="equal", xlim=(-4, 66), ylim=(-32, 32))
