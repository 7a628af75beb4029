"""A curve over a state that a missing force may depend on: a table of values with a roughness penalty, and its fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, fitted
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.systems.straw.constants import applied
from straw.replay.diagnose.systems.straw.of import straw_of, with_straw
from straw.replay.diagnose.systems.straw.states import State

Floats = NDArray[np.float64]

#: Prior deviation of a curve's point from the line between its neighbours, in units of the state.
ROUGH = 1.5
#: Rounds of a first fit, and the share of the cost by which the last one has to lower it.
FIRST_ROUNDS, SHARE = 8, 0.01
#: How often the points of a curve are moved at most: to where it bends, which halves the distance of a point from a
#: kink each time, or where the runs pass.
MOVES = 4


@dataclass(frozen=True, eq=False)
class Curve:
    """A state's curve fitted beside the base's constants, and perhaps another curve's, which come before its own;
    ``campaign`` holds the straw with the curves' points.

    ``smooth`` (k, unknowns) are the rows of the roughness penalty, by u; ``beneath`` (j, unknowns before the curve's)
    those of the other curve.
    """

    state: State
    campaign: Campaign
    smooth: Floats
    beneath: Floats
    fit: Fit
    placed: Floats  # (n,) points of the table as first placed, as it counts them
    points: Floats  # (n,) and as moved to where the curve bends

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which of the points are searched, not held at zero, (n,)."""
        return searched(self.state, self.points)

    @property
    def at(self) -> Floats:
        """The points that are searched."""
        return self.points[self.free]

    def scale(self, fit: Fit, base: int | None = None) -> float:
        """SI value of a point at 1 for the straw of a fit, of whose unknowns the first ones, ``base``, are its own."""
        straw, _ = applied(straw_of(self.campaign), fit.unknowns[:base], fit.u[:base])
        return self.state.scale(straw)


def searched(state: State, at: Floats) -> NDArray[np.bool_]:
    """Which points (n,) have a value to be found: all but one that is held at zero."""
    return np.asarray(~((at == 0) & state.zero))


def with_points(
    campaign: Campaign, base: Sequence[Unknown], beneath: Floats, state: State, at: Floats
) -> tuple[Campaign, tuple[Unknown, ...], Floats]:
    """The campaign with a curve at points (n,), all unknowns, and the rows (k, unknowns) of the roughness penalty, to
    which ``beneath`` (j, base) belong."""
    own = rows_for(state, at, searched(state, at))
    here = with_straw(campaign, state.straw_with(straw_of(campaign), at))
    rows = np.zeros((len(beneath) + len(own), len(base) + own.shape[1]))
    rows[: len(beneath), : len(base)], rows[len(beneath) :, len(base) :] = beneath, own
    return here, (*base, *state.unknowns(at)), rows


def rows_for(state: State, at: Floats, free: NDArray[np.bool_]) -> Floats:
    """Each point's distance from the line between its neighbours, in ROUGH: (k, free points)."""
    where = np.concatenate([[0.0], at]) if state.odd else at
    keep = np.concatenate([[False], free]) if state.odd else free
    rows = []
    for k in range(1, len(where) - 1):
        row = np.zeros(len(where))
        share = (where[k] - where[k - 1]) / (where[k + 1] - where[k - 1])
        row[k - 1 : k + 2] = share - 1, 1.0, -share
        rows.append(row[keep] / ROUGH)
    return np.array(rows).reshape(len(rows), int(keep.sum()))


def on_points(curve: Curve, campaign: Campaign, at: Floats) -> Curve:
    """The curve on other points (n,), to be fitted again."""
    state, fit, base = curve.state, curve.fit, curve.smooth.shape[1] - len(curve.at)
    values = np.zeros(len(curve.points))
    values[curve.free] = fit.u[base:]
    here, unknowns, smooth = with_points(campaign, fit.unknowns[:base], curve.beneath, state, at)
    scale = fit.unknowns[-1].scale
    unknowns = (*unknowns[:base], *(replace(k, scale=scale) for k in unknowns[base:]))
    where, known = (np.append(0.0, x) if state.odd else x for x in (curve.points, values))
    u = np.concatenate([fit.u[:base], np.interp(at, where, known)[searched(state, at)]])
    return replace(curve, campaign=here, smooth=smooth, points=at, fit=replace(fit, unknowns=unknowns, u=u))


def carried_on(curve: Curve, campaign: Campaign, rounds: int, share: float = 1e-4) -> Curve:
    """The curve's fit continued, perhaps on other runs; with no rounds only evaluated there."""
    fit, smooth = curve.fit, curve.smooth
    fit = fitted(campaign, fit.unknowns, fit.u, rounds=rounds, share=share, smooth=smooth)
    return replace(curve, campaign=campaign, fit=fit)


def downhill(fit: Fit, smooth: Floats) -> tuple[Floats, float]:
    """Minus the step to the optimum of the linearised problem, and its gain."""
    w = weights(fit.residual)
    sd, mean = np.array([k.sd for k in fit.unknowns]), np.array([k.mean for k in fit.unknowns])
    curvature = (fit.slopes * w[:, None]).T @ fit.slopes + np.diag(1 / sd**2) + smooth.T @ smooth
    gradient = fit.slopes.T @ (w * fit.residual) + (fit.u - mean) / sd**2 + smooth.T @ (smooth @ fit.u)
    step = np.linalg.solve(curvature, gradient)
    return step, float(gradient @ step)


def priced(curve: Curve) -> float:
    """Cost of a curve's fit with the price of the constants besides its values: each the logarithm of the number of
    samples (Schwarz, Annals of Statistics 6, 1978)."""
    return curve.fit.cost + len(curve.state.further) * float(np.log(len(curve.fit.residual)))
