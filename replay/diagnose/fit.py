"""Robust least squares over a campaign: Gauss-Newton on exact Jacobians, with priors and bounds."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign, Point
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.robust import curvature, robust_cost, weights
from straw.replay.diagnose.trust_region import FIRST_RADIUS, POOR, bounded_step, promised, resized

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fit:
    """Where a search ended: u, residual (m,), Jacobian ``slopes`` (m, unknowns) there, and the cost there."""

    unknowns: tuple[Unknown, ...]
    u: Floats
    residual: Floats
    slopes: Floats
    cost: float  # robust, with priors

    @property
    def values(self) -> dict[str, float]:
        """Numbers found, SI, by target."""
        return {k.target: k.value(float(u)) for k, u in zip(self.unknowns, self.u, strict=True)}


@dataclass(frozen=True, eq=False)
class Contestant:
    """A hypothesis and its best fit so far."""

    hypothesis: Hypothesis
    fit: Fit

    @property
    def name(self) -> str:
        """The hypothesis' name."""
        return self.hypothesis.name

    @property
    def cost(self) -> float:
        """Robust misfit with priors."""
        return self.fit.cost


def prior_cost(unknowns: Sequence[Unknown], u: Floats) -> float:
    """The priors' part of the cost."""
    return float(sum(((x - k.mean) / k.sd) ** 2 for k, x in zip(unknowns, u, strict=True)))


def cost_at(unknowns: Sequence[Unknown], u: Floats, residual: Floats, smooth: Floats | None = None) -> float:
    """Robust misfit at u plus the priors' cost, ``smooth`` (k, unknowns) included (see `fitted`)."""
    rough = 0.0 if smooth is None else float(np.sum((smooth @ u) ** 2))
    return robust_cost(residual) + prior_cost(unknowns, u) + rough


def normal_equations(
    unknowns: Sequence[Unknown], u: Floats, residual: Floats, slopes: Floats, smooth: Floats | None = None
) -> tuple[Floats, Floats]:
    """Gauss-Newton Hessian (n, n) and gradient (n,) of half the cost at u, with residual (m,) and Jacobian (m, n)."""
    sd, mean = (np.array([getattr(k, name) for k in unknowns]) for name in ("sd", "mean"))
    H = (slopes * curvature(residual)[:, None]).T @ slopes + np.diag(1 / sd**2)
    g = slopes.T @ (weights(residual) * residual) + (u - mean) / sd**2
    return (H, g) if smooth is None else (H + smooth.T @ smooth, g + smooth.T @ (smooth @ u))


def clipped(unknowns: Sequence[Unknown], u: Floats) -> Floats:
    """u within its bounds."""
    return np.clip(u, [k.low for k in unknowns], [k.high for k in unknowns])


def evaluated(campaign: Campaign, unknowns: Sequence[Unknown], u: Floats, smooth: Floats | None = None) -> Fit:
    """Residual, Jacobian and cost at u, nothing fitted."""
    return _together(campaign, [_evaluating(tuple(unknowns), u, smooth)])[0]


def moved(unknowns: Sequence[Unknown], u: Floats, step: Floats) -> Floats:
    """u after a step, within its bounds. A strength moves by its value: what it does, and what the base's constants may
    do instead, is nearly linear in it, so that a step in u would leave a valley that is straight in the values."""
    return clipped(
        unknowns, np.array([k.at(k.units(x) + k.units_per_u(x) * d) for k, x, d in zip(unknowns, u, step, strict=True)])
    )


def step_to(unknowns: Sequence[Unknown], u: Floats, to: Floats) -> Floats:
    """The step that moves u there (`moved`)."""
    return np.array([(k.units(y) - k.units(x)) / k.units_per_u(x) for k, x, y in zip(unknowns, u, to, strict=True)])


def fitted(
    campaign: Campaign,
    unknowns: Sequence[Unknown],
    u: Floats,
    *,
    rounds: int,
    share: float = 1e-4,
    smooth: Floats | None = None,
) -> Fit:
    """The fit found from u in at most so many evaluations; it ends where a step gains, or promises, less than ``share``
    of the cost.

    Minimises the sum of rho(r_i) + ((u_k - mean_k) / sd_k)^2 with rho the soft-L1 loss
    (`straw.replay.diagnose.robust`), and |smooth u|^2 for ``smooth`` (k, unknowns), the roughness penalty of a
    table's values.
    """
    return fits_from(campaign, [(tuple(unknowns), u)], rounds=rounds, share=share, smooth=smooth)[0]


def fits_from(
    campaign: Campaign,
    starts: Sequence[tuple[tuple[Unknown, ...], Floats]],
    *,
    rounds: int,
    share: float = 1e-4,
    smooth: Floats | None = None,
    brief: bool = False,
) -> list[Fit]:
    """`fitted` from each start, unknowns and u, evaluated together: a single fit's few runs leave workers idle.

    ``brief``: where all evaluations are used, the last point's derivatives are not worked out, and those of the point
    before it are returned; for fits that are continued or left out.
    """
    return _together(campaign, [_fitting(campaign, *start, rounds, share, smooth, brief) for start in starts])


#: A fit under way: asks for points, is sent their residuals and Jacobians.
_Fitting = Generator[Point, tuple[Floats, Floats], Fit]


def _together(campaign: Campaign, fittings: Sequence[_Fitting]) -> list[Fit]:
    """Where each of them ends; the points that they ask for are worked out together."""
    ends: dict[int, Fit] = {}
    asked = {k: next(one) for k, one in enumerate(fittings)}
    while asked:
        answers = dict(zip(asked, campaign.at(list(asked.values())), strict=True))
        asked = {}
        for k, answer in answers.items():
            try:
                asked[k] = fittings[k].send(answer)
            except StopIteration as end:
                ends[k] = end.value
    return [ends[k] for k in range(len(fittings))]


def _evaluating(unknowns: tuple[Unknown, ...], u: Floats, smooth: Floats | None, derivatives: bool = True) -> _Fitting:
    u = clipped(unknowns, u)
    residual, jacobian = yield Point(unknowns, u, derivatives)
    return Fit(unknowns, u, residual, jacobian, cost_at(unknowns, u, residual, smooth))


def _fitting(
    campaign: Campaign,
    unknowns: tuple[Unknown, ...],
    u: Floats,
    rounds: int,
    share: float,
    smooth: Floats | None,
    brief: bool,
) -> _Fitting:
    at, radius, gains = (yield from _evaluating(unknowns, u, smooth)), FIRST_RADIUS, True
    low, high = (np.array([getattr(k, name) for k in unknowns]) for name in ("low", "high"))
    for k in range(1, rounds if len(unknowns) else 0):
        if campaign.stop():
            break
        H, g = normal_equations(unknowns, at.u, at.residual, at.slopes, smooth)
        step = bounded_step(H, g, step_to(unknowns, at.u, low), step_to(unknowns, at.u, high), radius)
        expected = promised(H, g, step)
        if expected < share * at.cost:
            break
        u = moved(unknowns, at.u, step)
        last = brief and k == rounds - 1
        # most steps gain after one that did, and derivatives with the residuals cost less than a second simulation
        new = yield from _evaluating(unknowns, u, smooth, derivatives=gains and not last)
        gained = at.cost - new.cost
        radius = resized(radius, step, gained, expected)
        if last:
            return min(at, replace(new, slopes=at.slopes), key=lambda fit: fit.cost)
        if gained > 0:
            at = new if gains else min(at, (yield from _evaluating(unknowns, u, smooth)), key=lambda fit: fit.cost)
            if POOR * expected < gained < share * at.cost:
                break
        gains = gained > 0
    return at
