"""Robust least squares over a campaign: SciPy's trust-region Gauss-Newton on exact Jacobians, priors and bounds."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.robust import robust_cost, weights
from straw.replay.diagnose.settings import ROBUST_SIGMAS

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


class StoppedError(Exception):
    """The user stopped the search: the best point so far is the result."""


def prior_cost(unknowns: Sequence[Unknown], u: Floats) -> float:
    """The priors' part of the cost."""
    return float(sum(((x - k.mean) / k.sd) ** 2 for k, x in zip(unknowns, u, strict=True)))


def cost_at(unknowns: Sequence[Unknown], u: Floats, residual: Floats, smooth: Floats | None = None) -> float:
    """Robust misfit at u plus the priors' cost, ``smooth`` (k, unknowns) included (see `fitted`)."""
    rough = 0.0 if smooth is None else float(np.sum((smooth @ u) ** 2))
    return robust_cost(residual) + prior_cost(unknowns, u) + rough


def normal_equations(unknowns: Sequence[Unknown], u: Floats, residual: Floats, slopes: Floats) -> tuple[Floats, Floats]:
    """Gauss-Newton Hessian (n, n) and gradient (n,) of half the cost at u, with residual (m,) and Jacobian (m, n)."""
    w, sd, mean = weights(residual), np.array([k.sd for k in unknowns]), np.array([k.mean for k in unknowns])
    return (slopes * w[:, None]).T @ slopes + np.diag(1 / sd**2), slopes.T @ (w * residual) + (u - mean) / sd**2


def clipped(unknowns: Sequence[Unknown], u: Floats) -> Floats:
    """u within its bounds."""
    return np.clip(u, [k.low for k in unknowns], [k.high for k in unknowns])


def evaluated(campaign: Campaign, unknowns: Sequence[Unknown], u: Floats, smooth: Floats | None = None) -> Fit:
    """Residual, Jacobian and cost at u, nothing fitted."""
    u = clipped(unknowns, u)
    ((residual, jacobian),) = campaign.linearised(unknowns, [u])
    return Fit(tuple(unknowns), u, residual, jacobian, cost_at(unknowns, u, residual, smooth))


def fitted(
    campaign: Campaign,
    unknowns: Sequence[Unknown],
    u: Floats,
    *,
    rounds: int,
    share: float = 1e-4,
    smooth: Floats | None = None,
) -> Fit:
    """The fit found from u in at most so many evaluations; it ends when a step gains less than ``share`` of the cost.

    Minimises the sum of rho(r_i) + ((u_k - mean_k) / sd_k)^2 with rho the soft-L1 loss
    (`straw.replay.diagnose.robust`), and |smooth u|^2 for ``smooth`` (k, unknowns), the roughness penalty of a
    table's values.
    """
    problem = _Problem(campaign, tuple(unknowns), smooth)
    low, high = (np.array([getattr(k, name) for k in unknowns]) for name in ("low", "high"))
    start = clipped(unknowns, np.asarray(u, dtype=np.float64))
    if rounds > 0 and len(unknowns) and not campaign.stop():
        # a step that overflows is not finite, and is refused as one that costs more
        with suppress(StoppedError), np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            least_squares(
                problem.rows,
                np.clip(start, low + 1e-10, high - 1e-10),
                problem.jacobian,
                bounds=(low, high),
                loss=problem.loss,  # type: ignore[arg-type]
                max_nfev=rounds,
                ftol=max(share, 1e-12),
                xtol=1e-6,
                gtol=1e-10,
            )
    return problem.result(start)


class _Problem:
    """Functions for SciPy: rows of residuals and of priors, their Jacobian, their loss; the best point is kept."""

    def __init__(self, campaign: Campaign, unknowns: tuple[Unknown, ...], smooth: Floats | None) -> None:
        self.campaign, self.unknowns, self.smooth = campaign, unknowns, smooth
        mean, sd = (np.array([getattr(k, name) for k in unknowns]) for name in ("mean", "sd"))
        self.priors = np.vstack([np.diag(1 / sd), *([] if smooth is None else [smooth])])
        self.wanted = np.pad(mean / sd, (0, len(self.priors) - len(mean)))
        self.best: tuple[float, Floats, Floats] | None = None
        self.known: tuple[Floats, Floats, Floats] | None = None  # u, residual, Jacobian where it was linearised last

    def rows(self, u: Floats) -> Floats:
        if self.campaign.stop() and self.best is not None:
            raise StoppedError
        if self.best is None:
            residual = self._linearised(u)[0]
        else:
            (residual,) = self.campaign.residuals(self.unknowns, [u])
        cost = cost_at(self.unknowns, u, residual, self.smooth)
        if self.best is None or cost < self.best[0]:
            self.best = cost, u.copy(), residual
        return np.concatenate([residual, self.priors @ u - self.wanted])

    def jacobian(self, u: Floats) -> Floats:
        return np.vstack([self._linearised(u)[1], self.priors])

    def loss(self, z: Floats) -> Floats:
        """Value and two derivatives of the loss of squared rows; the last rows, the priors, are not robust."""
        data = np.arange(len(z)) < len(z) - len(self.priors)
        c2 = ROBUST_SIGMAS**2
        root = np.sqrt(1 + z / c2)
        return np.where(data, [2 * c2 * (root - 1), 1 / root, -0.5 / (c2 * root**3)], [z, np.ones_like(z), 0 * z])

    def result(self, start: Floats) -> Fit:
        u = self.best[1] if self.best else start
        residual, jacobian = self._linearised(u)
        return Fit(self.unknowns, u, residual, jacobian, cost_at(self.unknowns, u, residual, self.smooth))

    def _linearised(self, u: Floats) -> tuple[Floats, Floats]:
        if self.known is None or not np.array_equal(self.known[0], u):
            ((residual, jacobian),) = self.campaign.linearised(self.unknowns, [u])
            self.known = u.copy(), residual, jacobian
        return self.known[1], self.known[2]
