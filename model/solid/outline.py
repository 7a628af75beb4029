"""Outline: the closed meridian section of a straw's body: walls, collar at the base, the board's flange."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters

Floats = NDArray[np.float64]

#: The paper's checkerboard, side in m, which a flange has to carry.
BOARD_M = 38.5e-3
#: How far above a folded last cell's rim the flange lies, m.
NECK_M = 2e-3


@dataclass(frozen=True)
class Flange:
    """A disk that closes the tip and carries the board: radius and thickness, and the collar at the open base, m."""

    radius_m: float = BOARD_M / math.sqrt(2) + 1e-3
    thickness_m: float = 2.0e-3
    collar_m: float = 6.0e-3

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0):
                raise ModelError(f"solid: {name} = {value}, expected above zero")


def section(straw: StrawParameters, flange: Flange | None = None, folded: bool = False) -> Floats:
    """Corners (n, 2) of r and z in m of the body's section, in order with the body to the left; z up from the base.

    The odd frusta are as unloaded, the even ones their mirror image, deployed: so a body is moulded or printed. Its
    even frusta are then unloaded when deployed, unless they are folded and set. ``folded`` draws the unloaded shape
    itself, for which thick walls leave no room. Raises ModelError where a wall is too thick to bend round a crease.
    """
    made = flange or Flange()
    middle = [(straw.r_i_m, 0.0)]
    z = made.collar_m
    middle.append((straw.r_i_m, z))
    thickness = [float(straw.h_m[0, 0])]
    for n in range(straw.cells):
        odd, even = (float(x) for x in straw.zeta0_m[n])
        for radius, rise, h in (
            (straw.r_o_m, odd, float(straw.h_m[n, 0])),
            (straw.r_i_m, even if folded else -even, float(straw.h_m[n, 1])),
        ):
            z += rise
            middle.append((radius, z))
            thickness.append(h)
    if folded:  # the last frustum lies inside its cell: a neck brings the flange above the rim
        z += float(-straw.zeta0_m[-1, 1]) + NECK_M
        middle.append((straw.r_i_m, z))
        thickness.append(float(straw.h_m[-1, 1]))
    if made.radius_m <= straw.r_o_m:
        raise ModelError(f"solid: flange of {made.radius_m * 1e3:.4g} mm radius, expected above r_o_m = {straw.r_o_m}")
    inner, outer = (_offset(np.array(middle), np.array(thickness), side) for side in (-1, 1))
    top = float(middle[-1][1])
    inner[-1] = _at_height(inner[-2], inner[-1], top)
    outer[-1] = _at_height(outer[-2], outer[-1], top)
    if np.any(inner[:, 0] <= 0):
        raise ModelError("solid: the walls meet on the axis; make them thinner")
    lid = [
        (made.radius_m, top),
        (made.radius_m, top + made.thickness_m),
        (0.0, top + made.thickness_m),
        (0.0, top),
    ]
    corners = np.vstack([outer, lid, inner[::-1]])
    _check_simple(corners)
    return corners


def _offset(middle: Floats, thickness: Floats, side: int) -> Floats:
    """The line half a wall's thickness beside a polyline, walls (n - 1,), met at the corners; side 1 is outside."""
    tangent = np.diff(middle, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]]) * side * thickness[:, None] / 2
    out = np.empty_like(middle)
    out[0], out[-1] = middle[0] + normal[0], middle[-1] + normal[-1]
    for i in range(1, len(middle) - 1):
        A = np.column_stack([tangent[i - 1], -tangent[i]])
        b = (middle[i] + normal[i]) - (middle[i] + normal[i - 1])
        out[i] = middle[i] + normal[i - 1] + np.linalg.solve(A, b)[0] * tangent[i - 1]
    return out


def _at_height(a: Floats, b: Floats, z: float) -> Floats:
    return np.asarray(a + (b - a) * (z - a[1]) / (b[1] - a[1]))


def _check_simple(corners: Floats) -> None:
    """Raise ModelError where the section crosses itself: walls too thick for their folds."""
    a, b = corners, np.roll(corners, -1, axis=0)
    n = len(corners)
    for i in range(n):
        for j in range(i + 2, n - (i == 0)):
            if _cross(a[i], b[i], a[j], b[j]):
                raise ModelError(
                    f"solid: neighbouring walls meet at r = {a[i][0] * 1e3:.4g} mm, z = {a[i][1] * 1e3:.4g} mm; "
                    "make them thinner, or draw the straw deployed"
                )


def _cross(a: Floats, b: Floats, c: Floats, d: Floats) -> bool:
    def side(p: Floats, q: Floats, r: Floats) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0


def volume_m3(corners: Floats) -> float:
    """Volume of the body of revolution, m^3, by Pappus."""
    r, z = corners.T
    r1, z1 = np.roll(r, -1), np.roll(z, -1)
    return float(abs(np.pi / 3 * np.sum((r**2 + r * r1 + r1**2) * (z1 - z))))
