"""Profile: the meridian of a wall of revolution, (r, z, thickness), smooth between creases; checked once when made."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters

Floats = NDArray[np.float64]

#: Thickness over the least length of a wall beyond which a shell's lines across the wall mean little: shear and
#: squeezing of the wall, which a shell leaves out, are of the order of its square.
THICKEST = 1 / 3
COLUMNS = ("r_m", "z_m", "thickness_m")
#: Two walls meet whose ends are this near: less than a micrometre is rounding.
TOUCHING_M = 1e-6
#: A radius beyond this is millimetres in the column of metres.
LARGEST_M = 1.0


@dataclass(frozen=True)
class Meridian:
    """One smooth stretch of wall between creases: points (n, 2) of r and z in m, thickness (n,) in m.

    The points run from the side of the lower base to that of the upper; between them a cubic spline over the length.
    """

    points_m: Floats
    thickness_m: Floats

    def __post_init__(self) -> None:
        step = np.linalg.norm(np.diff(self.points_m, axis=0), axis=1)
        object.__setattr__(self, "_s", np.concatenate([[0.0], np.cumsum(step)]))

    @property
    def length_m(self) -> float:
        """Length of the meridian, m."""
        return float(self._s[-1])  # type: ignore[attr-defined]

    def at(self, s_m: Floats) -> tuple[Floats, Floats, Floats]:
        """r, z (..., 2), the unit normal (..., 2) and the thickness (...) at lengths s_m."""
        s = self._s  # type: ignore[attr-defined]
        if len(s) == 2:
            place = self.points_m[0] + s_m[..., None] / s[-1] * (self.points_m[1] - self.points_m[0])
            slope = np.broadcast_to((self.points_m[1] - self.points_m[0]) / s[-1], place.shape)
        else:
            spline = CubicSpline(s, self.points_m, bc_type="natural")
            place, slope = spline(s_m), spline(s_m, 1)
        slope = slope / np.linalg.norm(slope, axis=-1, keepdims=True)
        normal = np.stack([-slope[..., 1], slope[..., 0]], axis=-1)
        return np.asarray(place), normal, np.interp(s_m, s, self.thickness_m)


@dataclass(frozen=True)
class Profile:
    """Walls joined at creases, from the lower base to the upper, with the stiffness of the creases between them.

    ``crease_n`` is what a crease resists folding with, N m per rad and m of its length; 0 is a hinge. A frustum is one
    wall, a cell two. Raises ModelError for what is not such a wall.
    """

    walls: tuple[Meridian, ...]
    crease_n: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.crease_n) or self.crease_n < 0:
            raise ModelError(f"profile: crease stiffness {self.crease_n} N, expected zero or above")
        if not 1 <= len(self.walls) <= 2:
            raise ModelError(
                f"profile: {len(self.walls)} walls; a frustum is one, a cell two that meet at the crease of the rim"
            )
        for number, wall in enumerate(self.walls, 1):
            _check_wall(wall, f"profile: wall {number}")
        for lower, upper in pairwise(self.walls):
            if np.linalg.norm(upper.points_m[0] - lower.points_m[-1]) > TOUCHING_M:
                ends = [f"({1e3 * r:.4g}, {1e3 * z:.4g}) mm" for r, z in (lower.points_m[-1], upper.points_m[0])]
                raise ModelError(
                    f"profile: the first wall ends at {ends[0]}, the second begins at {ends[1]}; both must have the "
                    "point of the crease in which they meet"
                )
        _check_crossing(np.vstack([w.points_m for w in self.walls]))

    @property
    def height_m(self) -> float:
        """Distance of the bases in the unloaded shape, m."""
        return float(self.walls[-1].points_m[-1, 1] - self.walls[0].points_m[0, 1])

    @property
    def r_i_m(self) -> float:
        """Radius of the upper base, on which the bending angle is measured, m."""
        return float(self.walls[-1].points_m[-1, 0])


def _check_wall(wall: Meridian, where: str) -> None:
    points, h = wall.points_m, wall.thickness_m
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 2 or h.shape != (len(points),):
        raise ModelError(f"{where}: expected two or more points (r, z) with a thickness each")
    if not (np.all(np.isfinite(points)) and np.all(np.isfinite(h))):
        raise ModelError(f"{where}: a number is missing or not finite")
    if np.any(points[:, 0] <= 0):
        raise ModelError(
            f"{where}: radius {points[:, 0].min():g} m, expected above zero: the wall may not reach the axis"
        )
    if np.any(np.linalg.norm(np.diff(points, axis=0), axis=1) <= 1e-9):
        raise ModelError(f"{where}: two of its points are the same; leave one out")
    if np.any(h <= 0):
        raise ModelError(f"{where}: thickness {h.min():g} m, expected above zero")
    least = min(wall.length_m, float(points[:, 0].min()))
    if h.max() > THICKEST * least:
        raise ModelError(
            f"{where}: {h.max() * 1e3:.3g} mm thick where it is {least * 1e3:.3g} mm long or wide; beyond a third "
            "of that it is not a shell: use a solid model"
        )


def _check_crossing(points: Floats) -> None:
    """Raise ModelError where the polyline through points (n, 2) crosses itself, naming the points."""
    a, b = points[:-1], points[1:]
    for i in range(len(a)):
        for j in range(i + 2, len(a)):
            if _cross(a[i], b[i], a[j], b[j]):
                raise ModelError(
                    f"profile: it crosses itself between points {i + 1} to {i + 2} and {j + 1} to {j + 2}; give the "
                    "points in the order of the wall"
                )


def _cross(a: Floats, b: Floats, c: Floats, d: Floats) -> bool:
    def side(p: Floats, q: Floats, r: Floats) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0


def frustum(r_i_m: float, r_o_m: float, zeta0_m: float, h_m: float, crease_n: float = 0.0) -> Profile:
    """A conical frustum with its large base at z = 0 and its small base at z = zeta0_m."""
    for name, value in (("r_i_m", r_i_m), ("r_o_m", r_o_m), ("zeta0_m", zeta0_m), ("h_m", h_m)):
        if not math.isfinite(value):
            raise ModelError(f"profile: {name} = {value}, expected a number")
    if not 0 < r_i_m < r_o_m:
        raise ModelError(f"profile: r_i_m = {r_i_m}, r_o_m = {r_o_m}, expected 0 < r_i_m < r_o_m")
    return Profile((Meridian(np.array([[r_o_m, 0.0], [r_i_m, zeta0_m]]), np.full(2, h_m)),), crease_n)


def cell(
    r_i_m: float, r_o_m: float, zeta0_m: tuple[float, float], h_m: tuple[float, float], crease_n: float = 0.0
) -> Profile:
    """A cell: the odd frustum below with its small base at z = 0, the even one above; zeta0_m as (odd, even)."""
    odd, even = zeta0_m
    frustum(r_i_m, r_o_m, odd, h_m[0])  # for its checks
    lower = Meridian(np.array([[r_i_m, 0.0], [r_o_m, odd]]), np.full(2, h_m[0]))
    upper = Meridian(np.array([[r_o_m, odd], [r_i_m, odd + even]]), np.full(2, h_m[1]))
    return Profile((lower, upper), crease_n)


def profile_of(straw: StrawParameters, cell_number: int = 1, *, whole: bool = False, crease_n: float = 0.0) -> Profile:
    """The even frustum of a cell of a straw, or the whole cell."""
    if not 1 <= cell_number <= straw.cells:
        raise ModelError(f"shell: cell {cell_number} is not in a straw of {straw.cells} cells")
    zeta0, h = (row[cell_number - 1].tolist() for row in (straw.zeta0_m, straw.h_m))
    if whole:
        return cell(straw.r_i_m, straw.r_o_m, (zeta0[0], zeta0[1]), (h[0], h[1]), crease_n)
    return frustum(straw.r_i_m, straw.r_o_m, zeta0[1], h[1], crease_n)


def read_profile(path: Path, crease_n: float = 0.0) -> Profile:
    """A measured profile: CSV with the columns r_m, z_m, thickness_m; an empty line stands for a crease.

    One stretch is a frustum, from its large base to its small one; two are a cell, from the lower base to the upper.
    Raises ModelError naming the line.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise ModelError(f"{path}: cannot read the profile: {reason}") from None
    if not lines or [name.strip() for name in lines[0].split(",")] != list(COLUMNS):
        raise ModelError(f"{path}: line 1: expected the columns {','.join(COLUMNS)}")
    stretches: list[list[list[float]]] = [[]]
    for number, row in enumerate(csv.reader(lines[1:]), 2):
        if not any(field.strip() for field in row):
            stretches.append([])
            continue
        try:
            numbers = [float(field) for field in row]
        except ValueError:
            numbers = []
        if len(numbers) != len(COLUMNS):
            raise ModelError(f"{path}: line {number}: {','.join(row)!r}, expected three numbers r_m,z_m,thickness_m")
        stretches[-1].append(numbers)
    tables = [np.array(stretch) for stretch in stretches if stretch]
    if not tables or any(len(table) < 2 for table in tables):
        raise ModelError(f"{path}: each stretch of wall needs two points or more")
    widest = max(float(table[:, 0].max()) for table in tables)
    if widest > LARGEST_M:
        raise ModelError(f"{path}: a radius of {widest:g} m; the columns are in metres, write 0.01465 for 14.65 mm")
    try:
        profile = Profile(tuple(Meridian(table[:, :2], table[:, 2]) for table in tables), crease_n)
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None
    if len(tables) == 1 and tables[0][0, 0] <= tables[0][-1, 0]:
        raise ModelError(f"{path}: begins at the smaller radius; give a frustum from its large base to its small one")
    if any(table[0, 1] == table[-1, 1] for table in tables):
        raise ModelError(f"{path}: a wall that ends at the height it begins at; expected a frustum between two bases")
    return profile
