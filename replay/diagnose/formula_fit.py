"""The shortest formula that fits the runs as well as a curve: best subsets of a dictionary, then fitted to the runs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, prior_cost
from straw.replay.diagnose.formed import Formed, Model, coarsely_first, fitted
from straw.replay.diagnose.formula import Atom, Sum
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.judge import CALIBRATION
from straw.replay.diagnose.robust import robust_cost, weights

Floats = NDArray[np.float64]

#: How many sums of one, two and three functions are tried on the runs; the condition number at which some count as
#: alike. One more of each size is the nearest where the base's constants stay.
KEPT, ALIKE = (3, 2, 1), 12.0
#: Rounds of a sum's fit and of the chosen one's, and the share of the gain that another constant has to earn.
ROUNDS, LAST_ROUNDS, EARNS = 4, 10, 0.02


@dataclass(frozen=True, eq=False)
class Tangent:
    """The likelihood of a curve near its fit, profiled over the base's constants: -2 log L = 2 g d + d H d + const.

    ``d`` are the curve's values less ``values``, (n,).
    """

    values: Floats
    g: Floats
    H: Floats
    sigmas: Floats  # (n,) one deviation of each value, the roughness penalty and the values' prior included
    follow: Floats  # (base, n) how the optimum of the base's u follows d,
    rest: Floats  # (base,) and its step where d = 0
    fixed: Floats  # (n, n) H where the base's constants stay

    def base_step(self, values: Floats) -> Floats:
        """Step of the base's u to the optimum beside other values of the curve (n,)."""
        return self.rest + self.follow @ (values - self.values)


def tangent(fit: Fit, base: int, smooth: Floats) -> Tangent:
    """Of a fit of which all unknowns but the first ones, ``base``, are the curve's; ``smooth`` (k, unknowns) times u is
    the roughness penalty, of which no row holds both.

    Robust weights; misfit beyond noise widens all uncertainties.
    """
    w, unknowns = weights(fit.residual), fit.unknowns
    spread = max(1.0, float(np.mean(w * fit.residual**2)))
    S, s = (fit.slopes * w[:, None]).T @ fit.slopes / spread, fit.slopes.T @ (w * fit.residual) / spread
    prior = np.diag([1 / k.sd**2 for k in unknowns]) + smooth.T @ smooth
    sigmas_u = deviations(S + prior)[base:]
    pull = smooth.T @ (smooth @ fit.u) + [(u - k.mean) / k.sd**2 for k, u in zip(unknowns, fit.u, strict=True)]
    S[:base, :base] += prior[:base, :base]
    s[:base] += pull[:base]
    beside = np.linalg.solve(S[:base, :base], np.column_stack([S[:base, base:], s[:base]]))
    per_u = np.array([k.per_u(float(u)) for k, u in zip(unknowns[base:], fit.u[base:], strict=True)])
    H = (S[base:, base:] - S[base:, :base] @ beside[:, :-1]) / np.outer(per_u, per_u)
    g = (s[base:] - S[base:, :base] @ beside[:, -1]) / per_u
    values = np.array([k.value(float(u)) for k, u in zip(unknowns[base:], fit.u[base:], strict=True)])
    follow: Floats = -(beside[:, :-1] / per_u).astype(np.float64)
    fixed = S[base:, base:] / np.outer(per_u, per_u)
    return Tangent(values, g, H, np.abs(per_u) * sigmas_u, follow, np.asarray(-beside[:, -1]), fixed)


def deviations(information: Floats) -> Floats:
    """Standard deviations (n,) from a positive definite information matrix (n, n), also where it is nearly singular:
    there they are large, limited by the accuracy of its elements."""
    size = np.sqrt(np.diag(information))
    values, ways = np.linalg.eigh(information / np.outer(size, size))
    values = np.maximum(values, len(size) * np.finfo(float).eps)
    return np.asarray(np.sqrt(np.sum(ways**2 / values, axis=1)) / size)


def sparse(t: Tangent, at: Floats, atoms: Sequence[Atom]) -> list[tuple[tuple[Atom, ...], Floats, bool]]:
    """Atoms and coefficients of the sums nearest to the curve in the runs' likelihood, a few of each size, and whether
    the base's constants follow.

    Exhaustive, and the first atom alone in any case; ``at`` (n,) in SI. Parts that the base's constants can compensate
    cost nothing, so they need not be in a sum. Where constants follow far, the likelihood is no longer what it is near
    the curve: the nearest of each size with the base as it is is another start.
    """
    table = np.stack([atom.of(at) for atom in atoms], axis=1)
    size = np.linalg.norm(table, axis=0)
    table = table / size
    found = []
    for k, most in enumerate(KEPT, 1):
        sums = [chosen for chosen in itertools.combinations(range(len(atoms)), k) if _unlike(table[:, chosen])]
        follows, stays = (
            sorted((_nearest(t, H, g, table[:, chosen]), chosen) for chosen in sums)
            for H, g in ((t.H, t.g), (t.fixed, np.zeros_like(t.g)))
        )
        simplest = [row for row in follows[most:] if row[1] == (0,)]
        for rows, following in ((follows[:most] + simplest, True), (stays[:1], False)):
            for (_, a), chosen in rows:
                found.append((tuple(atoms[j] for j in chosen), np.array(a) / size[list(chosen)], following))
    return found


def _unlike(table: Floats) -> bool:
    """Whether functions (n, k) differ enough: the difference of two nearly equal ones is not informative."""
    return bool(np.linalg.cond(table) <= ALIKE)


def _nearest(t: Tangent, H: Floats, g: Floats, table: Floats) -> tuple[float, tuple[float, ...]]:
    """The smallest -2 log L, up to a constant, of a sum of the columns (n, k), and its coefficients."""
    a = np.linalg.lstsq(table.T @ H @ table, table.T @ (H @ t.values - g), rcond=1e-10)[0]
    d = table @ a - t.values
    return float(2 * g @ d + d @ H @ d), tuple(a.tolist())


def cost_beside(fit: Fit, base: int, smooth: Floats) -> float:
    """Cost of a fit without the prior and the roughness of a curve, of which all unknowns but the first ones are."""
    beneath = float(np.sum((smooth[:, :base] @ fit.u[:base]) ** 2))
    return robust_cost(fit.residual) + prior_cost(fit.unknowns[:base], fit.u[:base]) + beneath


def as_good(null_cost: float, curve_cost: float, points: int, cost: float, numbers: int) -> bool:
    """Whether formulas replace curves with more constants: each of these has to earn a share of the gain."""
    return cost - curve_cost <= EARNS * (points - numbers) * (null_cost - curve_cost)


@dataclass(frozen=True, eq=False)
class _Tried:
    """A sum, its fit, and the cost with the price of its constants."""

    sum: Sum
    model: Model
    score: float

    @property
    def own(self) -> Floats:
        """The sum's u."""
        return self.model.fit.u[-len(self.sum.unknowns()[0]) :]

    def refined(self, without: int = -1) -> Sum:
        """The sum from where its fit ended, perhaps without one of its atoms."""
        atoms, a = self.sum.atoms_at(self.own), self.sum.coefficients(self.own)
        keep = [n for n in range(len(atoms)) if n != without]
        return replace(self.sum, atoms=tuple(atoms[n] for n in keep), start=a[keep])


@dataclass(frozen=True, eq=False)
class _Fits:
    """Fits of sums in place of a curve: ``unknowns`` and cost of base and curve, the roughness penalty beside it, and
    the price of a constant."""

    campaign: Campaign
    unknowns: tuple[Unknown, ...]
    others: Floats  # (k, base)
    curve_cost: float
    price: float

    def tried(self, form: Sum, beside: Floats, rounds: int, share: float) -> _Tried:
        """A sum fitted beside the base from u (base,)."""
        return self._scored(form, fitted(self.campaign, self.unknowns, beside, self.others, [form], rounds, share))

    def continued(self, known: _Tried, without: int = -1) -> _Tried:
        """A fit continued to its end, perhaps without one of the atoms.

        Where it is worse than the curve's it may be in a local minimum, which the coarse comparison avoids.
        """
        form, beside = known.refined(without), known.model.fit.u[: self.others.shape[1]]
        end = self.tried(form, beside, LAST_ROUNDS, 1e-4)
        if end.model.fit.cost <= self.curve_cost + CALIBRATION.scale or self.campaign.stop():
            return end
        return _best([end, self._scored(form, coarsely_first(end.model))])

    def pruned(self, best: _Tried) -> _Tried:
        """A fit without the atoms that do not earn their price (backward elimination)."""
        while len(best.sum.atoms) > 1 and not self.campaign.stop():
            fewer = _best([self.continued(best, without=n) for n in range(len(best.sum.atoms))])
            if fewer.score > best.score:
                break
            best = fewer
        return best

    def _scored(self, form: Sum, model: Model) -> _Tried:
        return _Tried(form, model, model.fit.cost + self.price * form.numbers)


def _best(some: Sequence[_Tried]) -> _Tried:
    return min(some, key=lambda one: one.score)


@dataclass(frozen=True, eq=False)
class Written:
    """A curve written as a sum: atoms with their shapes, coefficients and their deviations (atoms,), SI, the sum with
    these numbers, its fit, and the share of the curve's gain that it keeps."""

    atoms: tuple[Atom, ...]
    coefficients: Floats
    deviations: Floats
    sum: Sum
    model: Model
    keeps: float


def formula(
    campaign: Campaign, fit: Fit, base: int, smooth: Floats, at: Floats, atoms: Sequence[Atom], null_cost: float
) -> Written:
    """The fewest atoms that explain the runs nearly as well as any.

    Another constant must gain its cost, or a share of the whole gain, as no law has exactly the true form: atoms of the
    best sum that do not are left out in the end. Deviations are those of coefficients and shapes together, the base's
    constants free.
    """
    t, others = tangent(fit, base, smooth), smooth[:, :base]
    curve_cost = cost_beside(fit, base, smooth)
    price = max(float(np.log(len(fit.residual))), EARNS * (null_cost - curve_cost))
    scale = np.array([k.scale for k in fit.unknowns[base:]])
    fits, found = _Fits(campaign, fit.unknowns, others, curve_cost, price), []
    for chosen, start, follows in sparse(t, at, atoms):
        form = Sum(chosen, start, at, scale)
        beside = fit.u[:base] + (t.base_step(form.values(form.unknowns()[1]) * scale) if follows else 0.0)
        found.append(fits.tried(form, beside, ROUNDS, 2e-3))
        if campaign.stop():
            break
    best = fits.pruned(fits.continued(_best(found)))
    return as_written(best.model, null_cost, curve_cost)[0]


def as_written(model: Model, null_cost: float, curve_cost: float) -> list[Written]:
    """Each of a model's sums with the numbers of its fit."""
    here, fit = model.campaign, model.fit
    assert isinstance(here, Formed)
    assert model.smooth is not None
    w = weights(fit.residual)
    spread = max(1.0, float(np.mean(w * fit.residual**2)))
    prior = np.diag([1 / k.sd**2 for k in fit.unknowns]) + model.smooth.T @ model.smooth
    sigmas = deviations((fit.slopes * w[:, None]).T @ fit.slopes / spread + prior)
    keeps = min((null_cost - fit.cost) / max(null_cost - curve_cost, 1e-9), 1.0)  # it may explain more than the curve
    out, first = [], here.base
    for form in here.sums:
        own = slice(first, first + len(form.unknowns()[0]))
        first = own.stop
        u, sd = fit.u[own], sigmas[own]
        a = form.coefficients(u)
        out.append(
            Written(
                atoms=form.atoms_at(u, sd),
                coefficients=a,
                deviations=np.abs(form.start * sd[: len(a)]),
                sum=replace(form, atoms=form.atoms_at(u), start=a),
                model=model,
                keeps=keeps,
            )
        )
    return out
