"""How far a straw, seen through an instrument, is from an observation: timing and shape charged separately.

A snap 30 ms late differs by all of its height, whatever was the cause. So the prediction's clock is bent near the
snaps until they coincide; how far it had to be bent is charged as timing, what then still differs as shape. Both
change almost linearly with the constants of the straw, which point-wise differences do not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.model.simulate import run as simulate
from straw.replay.diagnose.instrument import Instrument
from straw.replay.diagnose.matching import matched, without_odd
from straw.replay.diagnose.observation import REPEATABILITY_S, Observation
from straw.replay.diagnose.robust import robust_cost
from straw.replay.diagnose.snaps import cell_snaps, crossings

Floats = NDArray[np.float64]

#: Accuracy and output step of simulations. What a rougher one leaves out is far below a camera's noise, but another at
#: every point, so it passes for a slope, and searches end early in valleys that are narrow. For sigmas the finer one is
#: taken, for outlines the rough one will do.
TOLERANCE_M = 2e-7
FINE_M, ROUGH_M = 1e-8, 1e-6
STEP_S = 2e-3
#: Laws that make the water swing carry what a step leaves out on to the next snap: with less accuracy a small change of
#: a constant is lost in it, and the search with it, by outlines, too.
FINER_M = {"trapped_gas": 5e-8, "fluid_inertia": 5e-8}
#: Steps a second that a simulation may take at `TOLERANCE_M`, 1.6 times what the paper's livelier straw takes in
#: its first three: a straw that nothing damps rings on, and one simulation takes as long as many.
#: With the tolerance they grow to the power of -0.24 to -0.29, from 1e-6 to 1e-8 m, as for a method of fourth order.
LIVELIEST_PER_S, STEPS_GROW = 1850.0, 1 / 4
#: Where the recording shows more snaps than the straw, the straw is given this much longer to snap.
PATIENCE_S = 1.5
#: The prediction's clock is bent as for the nearest snap from this long before it to this long after it, s.
BEFORE_S, AFTER_S = 0.1, 0.6
#: Over the longest of this and a multiple of the difference the bend fades, s.
FADES_S, FADES = 0.3, 3.0
#: Noise of a track: share of its variance that lasts, and for how long (measured on one campaign of another apparatus).
LASTING, LASTS_S = 0.38, 0.05
#: How far off a snap may be while only outlines are compared, s.
ROUGHLY_S = 3e-3
#: A beginning or an end that only one of the two shows counts as this many sigmas, no more than noise may be: whether a
#: ring just reaches a level says little, and a snap that did not happen shows in all that follows.
MISSING = 3.0


@dataclass(frozen=True, eq=False)
class Misfit:
    """Differences between prediction and observation in sigmas: shape (3, n), white for a right model; timing (k,).

    ``timing`` has an entry for each of the observation's snap times (begin, end, begin, ...), and one for all that
    the straw shows beside them; ``late_s`` (k - 1,) are the same in seconds, NaN where the straw does not show it.
    ``plain`` (3, n) is what differs without bending the clock, m and rad. ``steps`` is how many the simulation took.
    """

    shape: Floats
    timing: Floats
    late_s: Floats
    plain: Floats
    steps: int

    @property
    def vector(self) -> Floats:
        """All of it, (3 n + k,)."""
        return np.concatenate([self.shape.ravel(), self.timing])


def play(
    observed: Observation, straw: StrawParameters, instrument: Instrument, finest_m: float = TOLERANCE_M
) -> tuple[Prediction, Floats]:
    """What the straw does in this run and its snap times as stamped by the camera; ModelError where it cannot."""
    run = observed.run
    assert run.initial_deployed is not None
    table = observed.pressure
    grid_s: Floats = table.start_s + table.step_s * np.arange(len(table.pressure_pa), dtype=np.float64)
    pressure = table._replace(pressure_pa=instrument.true_pressure(table.pressure_pa, grid_s))
    tolerance_m = min(FINER_M.get(term, finest_m) for term in ("", *straw.terms))
    worn = straw.replace(cycle=float(run.cycle))
    ends = instrument.true_time(np.array([observed.start_s, observed.end_s]))
    start, end = float(min(ends[0], observed.start_s)), float(ends[1])
    most, steps = most_steps_per_s(tolerance_m), 0
    for patience in (0.0, PATIENCE_S):
        grid = np.arange(start, end + patience + 2 * STEP_S, STEP_S)
        near = observed.rests.get(straw.form)
        seen = simulate(worn, pressure, grid, run.initial_deployed, tolerance_m, near, most)
        steps += seen.steps
        told = instrument.camera_roll_rad
        true_s = crossings(grid, seen.phi_rad + told, observed.levels)
        if len(true_s) < len(observed.snaps_s):
            true_s = cell_snaps(grid, seen.zeta_m[:, :, 1], true_s)
        if len(true_s) >= len(observed.snaps_s):
            break
    return replace(seen, steps=steps), instrument.stamped(true_s)


def most_steps_per_s(tolerance_m: float) -> float:
    """Steps a second that a simulation of this accuracy may take."""
    return float(LIVELIEST_PER_S * (TOLERANCE_M / tolerance_m) ** STEPS_GROW)


def misfit(
    observed: Observation, straw: StrawParameters, instrument: Instrument, finest_m: float = TOLERANCE_M
) -> Misfit:
    """Misfit of one run; ModelError where the model cannot follow."""
    at, ways, steps = _aligned(observed, straw, instrument, finest_m)

    def told(way: _Way) -> Misfit:
        shape = whitened((at(way.bent(observed.time_s)) - observed.tip) / observed.sigma(), observed.time_s)
        return Misfit(shape, way.timing(REPEATABILITY_S), way.late_s, plain, steps)

    plain = at(observed.time_s) - observed.tip
    return min((told(way) for way in ways), key=lambda one: robust_cost(one.vector))


def rough_misfit(observed: Observation, straw: StrawParameters, instrument: Instrument) -> tuple[Floats, int]:
    """Misfit of one run by its outline alone and its snaps' times, in sigmas: what leads from afar to a good fit; and
    how many steps the simulation took."""
    at, ways, steps = _aligned(observed, straw, instrument, ROUGH_M)
    outline = observed.outline
    told = (np.concatenate([outline.differs(at(way.bent(outline.time_s))), way.timing(ROUGHLY_S)]) for way in ways)
    return min(told, key=robust_cost), steps


@dataclass(frozen=True, eq=False)
class _Way:
    """One way to take a prediction's snaps for those of a recording, at ``snaps_s`` (k,): how late each is, NaN where
    none is taken for it, and how many of the prediction's are left."""

    snaps_s: Floats
    late_s: Floats
    left: int

    def bent(self, time_s: Floats) -> Floats:
        """Times (n,) at which to look into the prediction."""
        shown = np.isfinite(self.late_s)
        return np.asarray(time_s + bend(time_s, self.snaps_s[shown], self.late_s[shown]))

    def timing(self, sigma_s: float) -> Floats:
        """How late each is, in sigmas, and all that are left (k + 1,)."""
        late = np.where(np.isfinite(self.late_s), self.late_s / sigma_s, MISSING)
        return np.append(late, MISSING * np.sqrt(self.left))


def _aligned(
    observed: Observation, straw: StrawParameters, instrument: Instrument, finest_m: float
) -> tuple[Callable[[Floats], Floats], list[_Way], int]:
    """Of a prediction: tip (3, n) by stamped time, ways in which its snaps are those of the recording, steps."""
    seen, snaps_s = play(observed, straw, instrument, finest_m)
    mine, others = matched(observed.snaps_s, snaps_s)
    late = np.full(len(observed.snaps_s), np.nan)
    late[mine] = snaps_s[others] - observed.snaps_s[mine]
    left = int(np.count_nonzero(np.delete(snaps_s, others) < observed.end_s))
    ways = [_Way(observed.snaps_s, late, left)]
    usual = without_odd(late[mine])
    if not usual.all():
        sure = np.full(len(late), np.nan)
        sure[mine[usual]] = late[mine[usual]]
        ways.append(_Way(observed.snaps_s, sure, left + int(np.count_nonzero(~usual))))
    spline = CubicSpline(seen.time_s, np.stack([seen.x_m, seen.z_m, seen.phi_rad]), axis=1)
    span = seen.time_s[0], seen.time_s[-1]

    def at(stamped_s: Floats) -> Floats:
        return instrument.seen(spline(np.clip(instrument.true_time(stamped_s), *span)))

    return at, ways, seen.steps


def bend(time_s: Floats, snaps_s: Floats, late_s: Floats) -> Floats:
    """How much later (s) to look into the prediction at times (n,), so that its snaps coincide; zero far from snaps."""
    if len(snaps_s) == 0:
        return np.zeros_like(time_s)
    fade = np.maximum(FADES_S, FADES * np.abs(late_s))
    knots = np.concatenate([[snaps_s[0] - BEFORE_S - fade[0], snaps_s[0] - BEFORE_S], snaps_s])
    values = np.concatenate([[0.0, late_s[0]], late_s])
    knots = np.concatenate([knots, [snaps_s[-1] + AFTER_S, snaps_s[-1] + AFTER_S + fade[-1]]])
    values = np.concatenate([values, [late_s[-1], 0.0]])
    return np.asarray(np.interp(time_s, knots, values))


def whitened(scaled: Floats, time_s: Floats) -> Floats:
    """Differences in sigmas (3, n) with the lasting part of a track's noise filtered out: unit variance, independent.

    White noise plus a first-order process, each at its share of the variance, is an ARMA(1, 1) process: its own
    one-step prediction is subtracted (Box and Jenkins). Offsets that last count as the few independent looks they are.
    """
    fade = float(np.exp(-np.median(np.diff(time_s)) / LASTS_S))
    drive, white = LASTING * (1 - fade**2), 1 - LASTING
    # theta and innovation variance from the autocovariances of (1 - fade B) y at lags 0 and 1
    lag0, lag1 = drive + white * (1 + fade**2), -fade * white
    half = -lag0 / (2 * lag1)
    theta = half - np.sqrt(half**2 - 1)
    innovation = -lag1 / theta
    # started as if the first difference had lasted for long
    first = scaled[:, :1] * (1 - fade) / (1 - theta)
    zi = (theta * first) - fade * scaled[:, :1]
    out, _ = lfilter([1.0, -fade], [1.0, -theta], scaled, axis=1, zi=zi)
    return np.asarray(out / np.sqrt(innovation))
