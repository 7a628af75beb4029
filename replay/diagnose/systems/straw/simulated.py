"""A run simulated as the instruments would have seen it, with exact derivatives by a hypothesis' unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from straw.model.derivative import Derivatives, differentiate
from straw.model.direction import Direction
from straw.model.drive import Table
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.model.simulate import run as simulate
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.settings import (
    EXTRA_TIME_S,
    FINER_M,
    LIVELIEST_PER_S,
    SIMULATED_EVERY_S,
    TOLERANCE_M,
)
from straw.replay.diagnose.systems.straw.instrument import Instrument
from straw.replay.diagnose.systems.straw.nearby import Beside, at_point, nearby
from straw.replay.diagnose.systems.straw.observation import Observation
from straw.replay.diagnose.systems.straw.snaps import SMOOTHED_S, cell_snaps, crossings

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Simulated:
    """A prediction at the times the camera would stamp, and its derivatives at fixed stamped times by u.

    ``time_s`` (n,), ``pose`` (3, n) = X, Z (m), Phi (rad), ``events_s`` (k,) when snaps begin and end; ``d_pose``
    (3, n, unknowns) and ``d_events_s`` (k, unknowns), without columns where no derivatives were asked for;
    ``evaluations`` of the equations, of a shorter prediction before this one too.
    """

    time_s: Floats
    pose: Floats
    events_s: Floats
    d_pose: Floats
    d_events_s: Floats
    prediction: Prediction
    evaluations: int


def simulated(
    observed: Observation,
    straw: StrawParameters,
    unknowns: Sequence[Unknown],
    at: Floats,
    *,
    derivatives: bool = False,
    tolerance_m: float = TOLERANCE_M,
) -> Simulated:
    """The straw's motion in this run with the unknowns at u; ModelError where it cannot be simulated."""
    near = nearby(straw, unknowns, at) if derivatives else None
    changed, instrument = at_point(straw, unknowns, at)
    changed = changed.in_run(observed.run.cycle, observed.run.zero_time_ns)
    seen, true_events_s, by, evaluations = _until_it_snaps(observed, changed, instrument, unknowns, near, tolerance_m)
    pose = np.stack([seen.x_m, seen.z_m, seen.phi_rad])
    stamped_s = instrument.stamped(seen.time_s)
    shown = instrument.seen(pose, seen.time_s)
    none = 0 if by is None else len(unknowns)
    d_shown, d_true_s = np.zeros((*pose.shape, none)), np.zeros((len(true_events_s), none))
    d_stamped, d_late = np.zeros((len(stamped_s), none)), np.zeros((len(true_events_s), none))
    if near is not None and by is not None:
        moving, columns = by
        d_pose = np.stack([columns.x_m, columns.z_m, columns.phi_rad])
        d_shown[:, :, moving] = instrument.seen_tangent(pose, d_pose, seen.time_s)
        d_true_s[:, moving] = _events_tangent(observed, seen, instrument, true_events_s, columns)
        for k, unknown in enumerate(unknowns):
            if unknown.target.startswith("instrument.") and k not in moving:
                low, high, step = near[k].below, near[k].above, near[k].step
                d_shown[:, :, k] = (high.seen(pose, seen.time_s) - low.seen(pose, seen.time_s)) / step
                d_stamped[:, k] = (high.stamped(seen.time_s) - low.stamped(seen.time_s)) / step
                d_late[:, k] = (high.stamped(true_events_s) - low.stamped(true_events_s)) / step
        # at a fixed stamped time: a shift of the clock moves the tip by its rate
        rate = np.gradient(shown, stamped_s, axis=1)
        d_shown -= rate[:, :, None] * d_stamped
        d_true_s = d_true_s * (1 + instrument.clock_drift) + d_late
    return Simulated(stamped_s, shown, instrument.stamped(true_events_s), d_shown, d_true_s, seen, evaluations)


def most_steps_per_s(tolerance_m: float) -> float:
    """Steps a second that a simulation of this accuracy may take."""
    return float(LIVELIEST_PER_S * (TOLERANCE_M / tolerance_m) ** 0.25)  # a method of fourth order


def _until_it_snaps(
    observed: Observation,
    changed: StrawParameters,
    instrument: Instrument,
    unknowns: Sequence[Unknown],
    about: tuple[Beside, ...] | None,
    tolerance_m: float,
) -> tuple[Prediction, Floats, tuple[list[int], Derivatives] | None, int]:
    """The simulation, a little longer where the recording shows more snaps, its snaps (`_events`), and its derivatives
    by the straw's unknowns where these are known ``about`` the point; how often the equations were evaluated."""
    deployed = observed.run.initial_deployed
    assert deployed is not None
    table = observed.pressure
    shown_s = table.start_s + table.step_s * np.arange(len(table.pressure_pa), dtype=np.float64)
    pressure = table._replace(pressure_pa=instrument.true_pressure(table.pressure_pa, shown_s))
    tolerance_m = min(tolerance_m, *(FINER_M.get(term, tolerance_m) for term in ("", *changed.terms)))
    first, end = (float(t) for t in instrument.true_time(np.array([observed.start_s, observed.end_s])))
    off_s = max(abs(first - observed.start_s), abs(end - observed.end_s))
    if first >= end or off_s >= observed.end_s - observed.start_s:
        raise ModelError(f"run {observed.name}: the clock is off by more than the run is long")
    start = min(first, observed.start_s)
    near, most = observed.rests.get(changed.form), most_steps_per_s(tolerance_m)
    moving, directions = _directions(changed, unknowns, about, table, shown_s) if about is not None else ([], [])
    evaluations = 0
    for extra_s in (0.0, EXTRA_TIME_S):
        grid = np.arange(start, end + extra_s + 2 * SIMULATED_EVERY_S, SIMULATED_EVERY_S)
        by = None
        if about is not None:
            by = differentiate(
                changed,
                pressure,
                grid,
                deployed,
                directions,
                tolerance_m=tolerance_m,
                near=near,
                most_steps_per_s=most,
                cells=True,
            )
            seen = by.prediction
        else:
            seen = simulate(changed, pressure, grid, deployed, tolerance_m, near, most)
        evaluations += seen.evaluations
        events_s = _events(observed, seen, instrument)
        if len(events_s) >= len(observed.snaps_s):
            break
    return seen, events_s, None if by is None else (moving, by), evaluations


def _directions(
    changed: StrawParameters, unknowns: Sequence[Unknown], about: tuple[Beside, ...], table: Table, shown_s: Floats
) -> tuple[list[int], list[Direction]]:
    """The unknowns that affect the straw, and the directions in its constants or driving pressure."""
    moving, directions = [], []
    for k, (unknown, beside) in enumerate(zip(unknowns, about, strict=True)):
        if beside.direction is not None:
            directions.append(beside.direction)
        elif unknown.target.startswith("instrument.gauge"):
            over, under = (one.true_pressure(table.pressure_pa, shown_s) for one in (beside.above, beside.below))
            directions.append(Direction.driven(changed, table._replace(pressure_pa=(over - under) / beside.step)))
        else:
            continue
        moving.append(k)
    return moving, directions


def _events(observed: Observation, seen: Prediction, instrument: Instrument) -> Floats:
    """True times (s) at which the prediction's snaps begin and end."""
    true_s = crossings(seen.time_s, seen.phi_rad + instrument.camera_roll_rad, observed.levels)
    if len(true_s) < len(observed.snaps_s):
        true_s = cell_snaps(seen.time_s, seen.zeta_m[:, :, 1], true_s)
    return true_s


def _events_tangent(
    observed: Observation, seen: Prediction, instrument: Instrument, events_s: Floats, by: Derivatives
) -> Floats:
    """Derivative of the events' true times: dt/dp = -(dg/dp) / (dg/dt) of the signal g that crosses its level."""
    out = np.zeros((len(events_s), by.phi_rad.shape[-1]))
    assert by.zeta_m is not None
    if not len(events_s):
        return out
    step_s = float(np.median(np.diff(seen.time_s)))
    smooth_s = SMOOTHED_S / step_s
    rate = gaussian_filter1d(np.gradient(seen.phi_rad, seen.time_s), smooth_s)
    shown = crossings(seen.time_s, seen.phi_rad + instrument.camera_roll_rad, observed.levels)
    zeta = seen.zeta_m[:, :, 1]
    zeta_rate = np.gradient(zeta, seen.time_s, axis=0)
    reach = round(4 * smooth_s)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / smooth_s) ** 2)
    for j, at_s in enumerate(events_s):
        k = int(np.clip(np.searchsorted(seen.time_s, at_s), 1, len(seen.time_s) - 1))
        if len(shown) and np.min(np.abs(shown - at_s)) < 1e-9:
            rows = np.clip(np.arange(k - reach, k + reach + 1), 0, len(seen.time_s) - 1)
            moved, speed = weights @ by.phi_rad[rows] / weights.sum(), rate[k]
        else:  # a cell passes its flat state
            # of those that move; 1 km puts the others last
            cell = int(np.argmin(np.abs(zeta[k]) + 1e3 * (np.abs(zeta_rate[k]) < 1e-6)))
            moved, speed = by.zeta_m[k, cell, 1], zeta_rate[k, cell]
        if speed != 0:
            out[j] = -moved / speed
    return out
