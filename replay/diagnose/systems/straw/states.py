"""States that a missing force may depend on, and their descriptions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.model.table import POINTS
from straw.model.terms.missing_force import HEIGHTS
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.systems.straw.instrument import last_direction
from straw.replay.diagnose.systems.straw.observation import Observation

Floats = NDArray[np.float64]

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
    visited: Callable[[StrawParameters, Observation, Any], Floats]  # values in the runs
    odd: bool = False  # odd: over the magnitude of the state, through zero
    zero: bool = False  # zero where the state is zero
    scale: Callable[[StrawParameters], float] = lambda straw: 1.0  # SI value of a point at 1
    further: tuple[Unknown, ...] = ()  # more constants, found with the table's values, in the unit of its points
    symbols: tuple[str, ...] = ()  # of these
    sought_from: Callable[..., State] | None = None  # the state with other values of these to start from

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


def _laboratory_s(straw: StrawParameters, o: Observation, p: Prediction) -> Floats:
    return straw.in_run(o.run.cycle, o.run.zero_time_ns).start_s + p.time_s


def _along(straw: StrawParameters, o: Observation, p: Prediction) -> Floats:
    return np.asarray(o.tip[0] / _length_m(straw))


def _from(x: float, z: float) -> Callable[[StrawParameters, Observation, Prediction], Floats]:
    """The tip's distance from a point, which is given in unloaded lengths."""
    return lambda straw, o, p: np.hypot(o.tip[0] / _length_m(straw) - x, o.tip[1] / _length_m(straw) - z)


def _toward(x: float, z: float) -> State:
    """A force on the tip along the line to a fixed point, sought from there on; its prior's deviation is a third of a
    length."""
    where = (("post_x", x), ("post_z", z))
    return State(
        "tip distance", "r", "m", "F", "N",
        "a force on the tip towards a fixed point that depends on the distance from it",
        "term.missing_tip_force.pull_{}_n", "far_{}", 2e-3, _from(x, z), scale=_length_m,
        symbols=("X", "Z"), sought_from=_toward,
        further=tuple(
            Unknown(f"term.missing_tip_force.{name}", POST, kind="linear", mean=at / POST, sd=1 / (3 * POST))
            for name, at in where
        ),
    )  # fmt: skip


#: Unit of a fixed point's place in the search, in unloaded lengths: 3 mm on the paper's straw.
POST = 0.05
#: Where the search for it starts: beside the folded and the deployed tip, on either side, and beyond. From all of them,
#: as the first slopes do not tell which leads to the point (the magnet of `tests.benchmarks.missing_force`).
POSTS = ((0.5, -0.4), (0.5, 0.4), (1.0, -0.3), (1.0, 0.3), (2.0, 0.0))

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
        "time: stiffness", "t", "s", "e", "1", "a stiffness of the frusta that changes with time",
        "term.missing_force.aged_{}", "at_{}_s", 2e-3, _laboratory_s,
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
        "term.missing_tip_force.aside_{}_n", "z_{}", 2e-3, lambda straw, o, p: o.tip[1] / _length_m(straw),
        scale=_length_m,
    ),
    *(_toward(*at) for at in POSTS),
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
        "gauge over direction", "d", "1", "error", "Pa",
        "an error of the gauge that depends on the direction in which the pressure moved last",
        "instrument.gauge_memory_pa@{}", "", 100.0, lambda straw, o, p: last_direction(o.pressure.pressure_pa),
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
    State(
        "camera roll over X", "X", "m", "roll", "rad", "a roll of the camera or of the clamp that depends on X",
        "instrument.camera_roll_curve_rad@{}", "", 1e-3, lambda straw, o, p: o.tip[0],
    ),
    State(
        "camera X over time", "t", "s", "error", "m", "an error of the camera's X that depends on the time in a run",
        "instrument.camera_x_wander_m@{}", "", 1e-4, lambda straw, o, p: p.time_s,
    ),
    State(
        "camera Z over time", "t", "s", "error", "m", "an error of the camera's Z that depends on the time in a run",
        "instrument.camera_z_wander_m@{}", "", 1e-4, lambda straw, o, p: p.time_s,
    ),
    State(
        "camera roll over time", "t", "s", "roll", "rad",
        "a roll of the camera or of the clamp that depends on the time in a run",
        "instrument.camera_roll_wander_rad@{}", "", 1e-3, lambda straw, o, p: p.time_s,
    ),
    State(
        "board over time", "t", "s", "shift", "m",
        "a shift of the board along the tip that depends on the time in a run",
        "instrument.tip_offset_wander_m@{}", "", 1e-4, lambda straw, o, p: p.time_s,
    ),
)  # fmt: skip
