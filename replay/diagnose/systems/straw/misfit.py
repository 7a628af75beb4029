"""Residuals of a run: prediction against recording, registered at the snaps, in sigmas, with their Jacobian.

A snap 30 ms late differs by all of its height, whatever the cause. So prediction and recording are registered by their
landmarks, the snaps (curve registration: Ramsay and Silverman, Functional Data Analysis, chapter 7): their lateness
counts as timing, the remaining difference as shape. Both change almost linearly with the straw's constants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.robust import robust_cost
from straw.replay.diagnose.settings import (
    COARSE_TOLERANCE_M,
    LANDMARK_AFTER_S,
    LANDMARK_BEFORE_S,
    LASTING,
    LASTS_S,
    MISSING_EVENT_SIGMAS,
    REGISTRATION_FADES_S,
    ROUGH_TIMING_S,
    TOLERANCE_M,
)
from straw.replay.diagnose.systems.straw.matching import matched, without_odd
from straw.replay.diagnose.systems.straw.observation import REPEATABILITY_S, Observation
from straw.replay.diagnose.systems.straw.simulated import Simulated, simulated
from straw.replay.diagnose.systems.straw.vented import vent_residual

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Misfit:
    """Differences between prediction and observation in sigmas: shape (3, n), white for a right model; timing (k,).

    ``timing`` has an entry for each of the observation's snap times (begin, end, begin, ...), one for all
    additional ones of the prediction, and one for the gauge's reading on a vented line; ``late_s`` (k - 2,) are the
    first of them in seconds, NaN where the prediction has none. ``plain`` (3, n) is the difference without
    registration, m and rad. ``jacobian`` (3 n + k, unknowns) has no columns where no derivatives were asked for.
    ``work``: the simulations' evaluations of the equations.
    """

    shape: Floats
    timing: Floats
    late_s: Floats
    plain: Floats
    jacobian: Floats
    work: int

    @property
    def vector(self) -> Floats:
        """All of it, (3 n + k,)."""
        return np.concatenate([self.shape.ravel(), self.timing])


def misfit(
    observed: Observation,
    straw: StrawParameters,
    unknowns: Sequence[Unknown],
    at: Floats,
    *,
    derivatives: bool = False,
    tolerance_m: float = TOLERANCE_M,
) -> Misfit:
    """Misfit of one run with the unknowns at u; ModelError where it cannot be simulated."""
    seen = simulated(observed, straw, unknowns, at, derivatives=derivatives, tolerance_m=tolerance_m)
    curve = _Curve(seen)
    plain = curve.at(observed.time_s) - observed.tip
    sigma = observed.sigma()
    vent, d_vent = vent_residual(observed.vent_pa, observed.start_s, unknowns, at)

    def told(way: Registration) -> Misfit:
        shape = whitened((curve.at(way.bent_s) - observed.tip) / sigma, observed.time_s)
        return Misfit(
            shape,
            np.append(way.timing(REPEATABILITY_S), vent),
            way.late_s,
            plain,
            np.empty((0, 0)),
            seen.evaluations,
        )

    ways = registrations(observed, seen, observed.time_s)
    costs = [robust_cost(told(way).vector) for way in ways]
    way = ways[int(np.argmin(costs))]
    one = told(way)
    if derivatives:
        moved = curve.tangent(way) / sigma[:, :, None]
        white = whitened(moved, observed.time_s)
        jacobian = np.concatenate(
            [white.reshape(-1, white.shape[-1]), way.timing_tangent(REPEATABILITY_S), d_vent[None]]
        )
        one = Misfit(one.shape, one.timing, one.late_s, one.plain, jacobian, one.work)
    return one


def coarse_misfit(
    observed: Observation,
    straw: StrawParameters,
    unknowns: Sequence[Unknown],
    at: Floats,
    *,
    derivatives: bool = False,
) -> tuple[Floats, Floats, int]:
    """Residual (m,), Jacobian (m, unknowns) and work of a run by its slow part, the envelope of its ringing and its
    snap times, which lead to a good fit from distant starts."""
    seen = simulated(observed, straw, unknowns, at, derivatives=derivatives, tolerance_m=COARSE_TOLERANCE_M)
    curve, envelope = _Curve(seen), observed.envelope
    vent, d_vent = vent_residual(observed.vent_pa, observed.start_s, unknowns, at)

    def told(way: Registration) -> Floats:
        slow = envelope.differs(curve.at(way.bent_s))
        return np.concatenate([slow, way.timing(ROUGH_TIMING_S), [vent]])

    ways = registrations(observed, seen, envelope.time_s)
    vectors = [told(way) for way in ways]
    best = int(np.argmin([robust_cost(vector) for vector in vectors]))
    way, jacobian = ways[best], np.empty((0, 0))
    if derivatives:
        moved = envelope.tangent(curve.at(way.bent_s), curve.tangent(way))
        jacobian = np.concatenate([moved, way.timing_tangent(ROUGH_TIMING_S), d_vent[None]])
    return vectors[best], jacobian, seen.evaluations


class _Curve:
    """The predicted tip as a function of stamped time, with its derivatives by u."""

    def __init__(self, seen: Simulated) -> None:
        self.seen = seen
        self.spline = CubicSpline(seen.time_s, seen.pose, axis=1)
        self.rate = self.spline.derivative()
        self.span = float(seen.time_s[0]), float(seen.time_s[-1])

    def at(self, time_s: Floats) -> Floats:
        """Tip (3, n)."""
        return np.asarray(self.spline(np.clip(time_s, *self.span)))

    def tangent(self, way: Registration) -> Floats:
        """Derivative (3, n, unknowns) of the registered tip at the recording's times (n,)."""
        look_s = np.clip(way.bent_s, *self.span)
        grid = self.seen.time_s
        k = np.clip(np.searchsorted(grid, look_s) - 1, 0, len(grid) - 2)
        x = ((look_s - grid[k]) / (grid[k + 1] - grid[k]))[:, None]
        moved = self.seen.d_pose[:, k] * (1 - x) + self.seen.d_pose[:, k + 1] * x
        bent = way.basis @ way.d_late_s
        return np.asarray(moved + np.asarray(self.rate(look_s))[:, :, None] * bent)


@dataclass(frozen=True, eq=False)
class Registration:
    """One matching of a prediction's snaps with those of a recording, at ``snaps_s`` (k,): the lateness of each, NaN if
    unmatched, its derivatives (k, unknowns), and the number of the prediction's unmatched ones; ``time_s`` (n,) of the
    recording's samples."""

    time_s: Floats
    snaps_s: Floats
    late_s: Floats
    d_late: Floats
    left: int

    @property
    def shown(self) -> NDArray[np.bool_]:
        """Which of the recording's snaps the prediction has."""
        return np.isfinite(self.late_s)

    @property
    def d_late_s(self) -> Floats:
        """Derivatives of the shown ones' lateness, (shown, unknowns)."""
        return self.d_late[self.shown]

    @cached_property
    def bent_s(self) -> Floats:
        """Times (n,) at which the prediction is evaluated."""
        return np.asarray(self.time_s + self.basis @ self.late_s[self.shown])

    @cached_property
    def basis(self) -> Floats:
        """Derivative of `bent_s` by each shown snap's lateness, (n, shown)."""
        return bend_basis(self.time_s, self.snaps_s[self.shown], self.late_s[self.shown])

    def timing(self, sigma_s: float) -> Floats:
        """Lateness of each, in sigmas, and the number of unmatched ones (k + 1,)."""
        late = np.where(self.shown, self.late_s / sigma_s, MISSING_EVENT_SIGMAS)
        return np.append(late, MISSING_EVENT_SIGMAS * np.sqrt(self.left))

    def timing_tangent(self, sigma_s: float) -> Floats:
        """Derivative of `timing`, (k + 1, unknowns)."""
        moved = np.where(self.shown[:, None], self.d_late / sigma_s, 0.0)
        return np.vstack([moved, np.zeros((1, moved.shape[1]))])


def registrations(observed: Observation, seen: Simulated, time_s: Floats) -> list[Registration]:
    """Matchings of the prediction's snaps with the recording's: all that match, and without an outlier."""
    mine, others = matched(observed.snaps_s, seen.events_s)
    late = np.full(len(observed.snaps_s), np.nan)
    late[mine] = seen.events_s[others] - observed.snaps_s[mine]
    moved = np.zeros((len(late), seen.d_events_s.shape[1]))
    moved[mine] = seen.d_events_s[others]
    left = int(np.count_nonzero(np.delete(seen.events_s, others) < observed.end_s))
    ways = [Registration(time_s, observed.snaps_s, late, moved, left)]
    usual = without_odd(late[mine])
    if not usual.all():
        sure = np.full(len(late), np.nan)
        sure[mine[usual]] = late[mine[usual]]
        more = left + int(np.count_nonzero(~usual))
        ways.append(Registration(time_s, observed.snaps_s, sure, moved, more))
    return ways


def bend_basis(time_s: Floats, snaps_s: Floats, late_s: Floats) -> Floats:
    """Hat functions (n, k) over the recording's time: one at each snap, constant a little before the first and after
    the last, zero far from all. They fade more slowly where a snap is so late that time would run backwards."""
    if len(snaps_s) == 0:
        return np.zeros((len(time_s), 0))
    fade = np.maximum(REGISTRATION_FADES_S, 3 * np.abs(late_s))
    before, after = snaps_s[0] - LANDMARK_BEFORE_S, snaps_s[-1] + LANDMARK_AFTER_S
    knots = np.concatenate([[before - fade[0], before], snaps_s, [after, after + fade[-1]]])
    rows = np.pad(np.eye(len(snaps_s)), ((0, 0), (2, 2)))
    rows[0, 1] = rows[-1, -2] = 1.0
    return np.stack([np.interp(time_s, knots, row) for row in rows], axis=1)


def whitened(scaled: Floats, time_s: Floats) -> Floats:
    """Differences in sigmas (3, n, ...) with the correlated part of a track's noise filtered out: unit variance, white.

    White noise plus a first-order process, each at its share of the variance, is an ARMA(1, 1) process: its own
    one-step prediction is subtracted (Box and Jenkins). Constant offsets then count as few independent samples.
    """
    fade = float(np.exp(-np.median(np.diff(time_s)) / LASTS_S))
    drive, white = LASTING * (1 - fade**2), 1 - LASTING
    # theta and innovation variance from the autocovariances of (1 - fade B) y at lags 0 and 1
    lag0, lag1 = drive + white * (1 + fade**2), -fade * white
    half = -lag0 / (2 * lag1)
    theta = half - np.sqrt(half**2 - 1)
    innovation = -lag1 / theta
    # started as if the first difference had been constant before
    first = scaled[:, :1] * (1 - fade) / (1 - theta)
    zi = (theta * first) - fade * scaled[:, :1]
    out, _ = lfilter([1.0, -fade], [1.0, -theta], scaled, axis=1, zi=zi)
    return np.asarray(out / np.sqrt(innovation))
