"""The shortest formula that fits the runs as well as a curve: the nearest sums of a dictionary, fitted to the runs."""

from __future__ import annotations

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
from straw.replay.diagnose.robust import robust_cost
from straw.replay.diagnose.sparse import deviations_of, sparse, tangent

Floats = NDArray[np.float64]

#: Rounds of a sum's fit and of the chosen one's, and the share of the gain that another constant has to earn.
ROUNDS, LAST_ROUNDS, EARNS = 4, 10, 0.02


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
    sigmas = deviations_of(fit, model.smooth)
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
