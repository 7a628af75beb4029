"""States that a missing force may depend on, the points of its curve, and their descriptions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.model.table import POINTS
from straw.model.terms.missing_force import HEIGHTS
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.systems.straw.observation import Observation

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
#: Deviation of the prior of a value in units: nearly flat.
WIDE = 100.0


@dataclass(frozen=True)
class State:
    """One state and the curve over it: a table in a term of the model, or a curve of the instrument.

    ``values`` and ``points`` are patterns of targets and constants; ``unit`` is about the smallest visible value.
    """

    name: str
    symbol: str  # of the state
    state_unit: str
    value_symbol: str
    value_unit: str
    says: str  # a noun: "a missing axial force of each frustum that depends on its height"
    values: str
    points: str
    unit: float
    visited: Callable[[StrawParameters, Observation, Prediction], Floats]  # values in the runs
    odd: bool = False  # odd: over the magnitude of the state, through zero
    zero: bool = False  # zero where the state is zero
    scale: Callable[[StrawParameters], float] = lambda straw: 1.0  # SI value of a point at 1

    @property
    def term(self) -> str:
        """The term whose table it is; empty for an instrument."""
        return self.values.split(".")[1] if self.values.startswith("term.") else ""

    def straw_with(self, straw: StrawParameters, at: Floats) -> StrawParameters:
        """The straw with the table's points (n,), unused ones before them, and all values zero."""
        if not self.term:
            return straw
        before = at[0] - np.arange(POINTS - len(at), 0, -1)
        where = {self.points.format(n): float(x) for n, x in enumerate([*before, *at], 1)}
        return straw.with_term(self.term, amount=1.0, **where)

    def unknowns(self, at: Floats) -> tuple[Unknown, ...]:
        """Unknowns for the values at points (n,), without those fixed at zero."""
        first = 1 + POINTS - len(at)
        return tuple(
            Unknown(self.values.format(n if self.term else f"{x:.6g}"), self.unit, kind="linear", sd=WIDE)
            for n, x in enumerate(at, first)
            if not (self.zero and x == 0)
        )


def _even_m(straw: StrawParameters) -> float:
    return float(np.mean(np.abs(straw.zeta0_m[:, 1])))


def _length_m(straw: StrawParameters) -> float:
    return float(np.sum(straw.zeta0_m[:, 0] - straw.zeta0_m[:, 1]))


def _speed(straw: StrawParameters, o: Observation, p: Prediction) -> Floats:
    return np.asarray(np.abs(np.gradient(p.zeta_m[:, :, 1], p.time_s, axis=0)).ravel(), dtype=np.float64)


def _tip_speed(straw: StrawParameters, o: Observation, p: Prediction) -> Floats:
    return np.asarray(np.hypot(o.rate[0], o.rate[1]))


def _height(straw: StrawParameters, o: Observation, p: Prediction) -> Floats:
    return np.array(HEIGHTS)


def _cycle(straw: StrawParameters, o: Observation, p: Prediction) -> Floats:
    return np.array([float(o.run.cycle)])


def _along(straw: StrawParameters, o: Observation, p: Prediction) -> Floats:
    return np.asarray(o.tip[0] / _length_m(straw))


def _aside(straw: StrawParameters, o: Observation, p: Prediction) -> Floats:
    return np.asarray(o.tip[1] / _length_m(straw))


STATES: tuple[State, ...] = (
    State(
        "height", "zeta", "m", "F", "N", "an axial force of each frustum that depends on its height",
        "term.missing_force.force_{}_n", "height_{}", 0.2, _height, scale=_even_m,
    ),
    State(
        "angle", "phi", "rad", "M", "N m", "a moment of each frustum that depends on its bending angle",
        "term.missing_force.moment_{}_n_m", "angle_{}_rad", 0.5e-3,
        lambda straw, o, p: p.frustum_phi_rad[:, :, 1].ravel(),
    ),
    State(
        "speed", "v", "m/s", "F", "N", "an axial force of each frustum against its speed",
        "term.missing_damping.force_{}_n", "speed_{}_m_per_s", 0.1, _speed, odd=True,
    ),
    State(
        "damping over height", "zeta", "m", "d", "N s/m", "an axial damping of each frustum that depends on its height",
        "term.missing_damping.damping_{}_n_s_per_m", "height_{}", 50.0, _height, scale=_even_m,
    ),
    State(
        "cycles: stiffness", "n", "cycles", "e", "1", "a stiffness of the frusta that changes with the cycles before",
        "term.missing_force.stiffness_{}", "cycle_{}", 2e-3, _cycle,
    ),
    State(
        "pressure: stiffness", "p", "Pa", "e", "1", "a stiffness of the frusta that changes with the pressure inside",
        "term.missing_force.stiffer_{}", "pressed_{}_pa", 5e-3, lambda straw, o, p: p.pressure_pa, zero=True,
    ),
    State(
        "cycles: force", "n", "cycles", "c", "1", "a change of the frusta's missing force with the cycles before",
        "term.missing_force.change_{}", "changed_{}", 0.02, _cycle,
    ),
    State(
        "tip X, along X", "X", "m", "F_X", "N", "a force along X on the tip that depends on where it is",
        "term.missing_tip_force.along_x_{}_n", "x_{}", 0.01, _along, scale=_length_m,
    ),
    State(
        "tip X, along Z", "X", "m", "F_Z", "N", "a force along Z on the tip that depends on where it is",
        "term.missing_tip_force.along_z_{}_n", "at_x_{}", 2e-3, _along, scale=_length_m,
    ),
    State(
        "tip Z, along Z", "Z", "m", "F_Z", "N", "a force along Z on the tip that depends on how far aside it is",
        "term.missing_tip_force.aside_{}_n", "z_{}", 2e-3, _aside, scale=_length_m,
    ),
    State(
        "tip angle", "Phi", "rad", "M", "N m", "a moment on the tip that depends on its angle",
        "term.missing_tip_force.turning_{}_n_m", "phi_{}_rad", 0.2e-3, lambda straw, o, p: o.tip[2],
    ),
    State(
        "tip speed", "V", "m/s", "F", "N", "a force along the tip's velocity that depends on its speed",
        "term.missing_tip_force.push_{}_n", "speed_{}_m_per_s", 3e-3, _tip_speed, odd=True,
    ),
    State(
        "flow", "Q", "m^3/s", "dp", "Pa", "a loss of pressure that depends on the flow",
        "term.missing_loss.loss_{}_pa", "flow_{}_m3_per_s", 200.0,
        lambda straw, o, p: np.gradient(p.volume_m3, p.time_s), zero=True,
    ),
    State(
        "leak", "p", "Pa", "q", "m^3/s", "a flow of water out through the walls that depends on the pressure inside",
        "term.missing_loss.leak_{}_m3_per_s", "pressure_{}_pa", 1e-7, lambda straw, o, p: p.pressure_pa, zero=True,
    ),
    State(
        "cycles: channel", "n", "cycles", "k", "1", "a loss in the channel that changes with the cycles before",
        "term.missing_loss.share_{}", "cycle_{}", 0.01, _cycle,
    ),
    State(
        "gauge over pressure", "p", "Pa", "error", "Pa", "an error of the gauge that depends on what it shows",
        "instrument.gauge_curve_pa@{}", "", 100.0, lambda straw, o, p: p.external_pa,
    ),
    State(
        "gauge over time", "t", "s", "error", "Pa", "an error of the gauge that depends on the time in a run",
        "instrument.gauge_wander_pa@{}", "", 100.0, lambda straw, o, p: p.time_s,
    ),
    State(
        "clock over time", "t", "s", "late", "s", "a delay of the camera's time stamps that depends on the time",
        "instrument.clock_curve_s@{}", "", 5e-3, lambda straw, o, p: p.time_s,
    ),
    State(
        "camera X over X", "X", "m", "error", "m", "an error of the camera's X that depends on X",
        "instrument.camera_x_m@{}", "", 1e-4, lambda straw, o, p: o.tip[0],
    ),
    State(
        "camera Z over X", "X", "m", "error", "m", "an error of the camera's Z that depends on X",
        "instrument.camera_z_m@{}", "", 1e-4, lambda straw, o, p: o.tip[0],
    ),
)  # fmt: skip


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
