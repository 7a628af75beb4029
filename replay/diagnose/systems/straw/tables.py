"""Where the points of a table lie: dense where the runs are frequent, and where a curve or a formula bends."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from straw.model.table import POINTS
from straw.replay.diagnose.systems.straw.states import State

Floats = NDArray[np.float64]

#: Speeds are covered from the fastest down to this share of it, evenly in their logarithm.
SLOWEST = 1 / 60
#: Points of a curve are at least this share of its range apart: drawn out over a share w, a step has an RMS error over
#: the range of the root of w / 12, here 3 % of its height.
APART = 1 / 100
#: Values of the state at which a table is compared with a formula, and by which share of the formula's largest value it
#: may be off: the fits themselves are good to a percent of it at best.
GRID, FOLLOWS = 401, 1e-3
#: A curve over so few values is none.
FEWEST = 3


def points(state: State, visited: Sequence[Floats]) -> Floats | None:
    """Points (n,), at most POINTS, of a state's curve, dense where the runs are frequent; None where they cover too
    little.

    Even in the mean of the share of samples below x and the share of the range below x.
    """
    x = np.concatenate(visited)
    few = np.unique(x)
    if len(few) <= POINTS:
        return few if len(few) >= FEWEST else None
    if state.odd:
        # of all but one sample in two thousand, below one in a thousand on either side: a few may be wrong
        return np.asarray(np.geomspace(SLOWEST, 1.0, POINTS) * np.quantile(x, 0.9995))
    low, high = np.quantile(x, [0.001, 0.999])
    if not high > low:
        return None
    even = np.linspace(low, high, 400)
    below = (np.searchsorted(np.sort(x), even) / len(x) + np.linspace(0, 1, 400)) / 2
    return _kept_apart(state, np.interp(np.linspace(0, 1, POINTS), below, even), low, high)


def bent_points(state: State, placed: Floats, at: Floats, values: Floats) -> Floats:
    """Points (n,) of a curve with ``values`` (n,) at points ``at`` (n,), closer where it bends; both ends stay.

    Straight lines between points are off by an eighth of f'' d^2, so that error is spread evenly where the points'
    density goes with the root of f'' (de Boor, A Practical Guide to Splines, chapter XII). Even in the mean of that
    density and of the one in which `points` ``placed`` (n,) them, as a bend that does not show yet has to be found. A
    curve over cycles has a point at each.
    """
    if len(at) < POINTS or state.state_unit == "cycles":
        return at
    x, y = (np.append(0.0, v) if state.odd else v for v in (at, values))
    slope = np.diff(y) / np.diff(x)
    second = np.abs(np.diff(slope)) / ((x[2:] - x[:-2]) / 2)  # at inner points
    root = np.sqrt(np.concatenate([second[:1], (second[1:] + second[:-1]) / 2, second[-1:]]))  # between points
    bend = np.append(0.0, np.cumsum(root * np.diff(x)))[-POINTS:]
    if not bend[-1] > bend[0]:
        return placed
    where = np.union1d(at, placed)
    bend = np.interp(where, at, (bend - bend[0]) / (bend[-1] - bend[0]))
    below = (bend + np.interp(where, placed, np.linspace(0, 1, POINTS))) / 2
    return _kept_apart(state, np.interp(np.linspace(0, 1, POINTS), below, where), at[0], at[-1])


def formula_points(state: State, at: Floats, law: Callable[[Floats], Floats], edges: Sequence[float]) -> Floats:
    """Points (n,) of a table for a formula over the range of points ``at`` (n,), which are kept where they follow it.

    At its ``edges`` and close to either side of them, where a fit may move them, then one by one where straight lines
    are farthest off (Ramer, Computer Graphics and Image Processing 1, 1972), or in the widest gap where they are not.
    """
    if len(at) < POINTS or state.state_unit == "cycles":
        return at
    low, high = float(at[0]), float(at[-1])
    least = (SLOWEST if state.odd else 1.0) * APART * (high - low)
    inside = [x for x in edges if low + least < x < high - least]
    grid = (
        np.unique([*np.geomspace(low, high, GRID), *inside])
        if state.odd
        else np.union1d(np.linspace(low, high, GRID), inside)
    )
    values = law(grid)
    fixed = [0.0] if state.odd or (state.zero and low < 0 < high) else []

    def off(points: Sequence[float] | Floats) -> Floats:
        """Distance of the formula from straight lines between points, in its largest value."""
        x = np.sort(np.unique([*fixed, *points]))
        y = np.where(x == 0, 0.0, law(x)) if fixed else law(x)
        return np.asarray(np.abs(values - np.interp(grid, x, y)) / max(float(np.max(np.abs(values))), 1e-300))

    if float(np.max(off(at))) < FOLLOWS:
        return at
    points = [low, high, *(x for x in fixed if not state.odd), *inside]
    for x in (side for edge in inside for side in (edge - least, edge + least)):
        if len(points) < POINTS and min(abs(x - p) for p in points) > least / 2:
            points.append(x)
    while len(points) < POINTS:
        far = np.min(np.abs(grid[:, None] - np.array(points)), axis=1)
        error = np.where(far >= least, off(points), 0.0)
        points.append(float(grid[np.argmax(error if error.max() > FOLLOWS else far)]))
    return np.sort(points[:POINTS])


def _kept_apart(state: State, at: Floats, low: float, high: float) -> Floats:
    """Points (n,) moved, where they are too close, within their range; one of them to zero where the curve is zero
    there."""
    least = (SLOWEST if state.odd else 1.0) * APART * (high - low)
    for n in range(1, POINTS):
        at[n] = max(at[n], at[n - 1] + least)
    at[-1] = high
    for n in range(POINTS - 2, -1, -1):
        at[n] = min(at[n], at[n + 1] - least)
    if state.zero:
        at[np.argmin(np.abs(at))] = 0.0
    return np.asarray(at)
