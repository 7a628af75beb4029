"""A sparse formula for a curve: a sum of few functions of its state that fits the runs as well as the curve."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, prior_cost
from straw.replay.diagnose.fit import fitted as fitted_unknowns
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.robust import robust_cost, weights

Floats = NDArray[np.float64]

#: How many sums of one, two and three functions are tried on the runs; the condition number at which some count as
#: alike.
KEPT, ALIKE = (3, 2, 1), 12.0
#: Rounds of a sum's fit, and the share of the gain that another function has to earn.
ROUNDS, EARNS = 4, 0.02


@dataclass(frozen=True)
class Atom:
    """One function of the state: its text, its power of the state's unit, and the cost of choosing it."""

    text: str
    power: float
    of: Callable[[Floats], Floats]
    numbers: int = 1  # number of its constants, its shape's included
    code: str = ""  # the same as Python over x, for a law's file; empty where no law of the straw depends on the state


@dataclass(frozen=True)
class Formula:
    """A sum of atoms with coefficients (SI) and one sigma of each, and how much of the curve's gain it keeps."""

    symbol: str
    atoms: tuple[Atom, ...]
    coefficients: Floats
    sigmas: Floats
    units: tuple[str, ...]
    keeps: float

    @property
    def text(self) -> str:
        """In one line, coefficients in SI units."""
        parts = [
            " ".join(word for word in (f"({c:.3g} ± {s:.2g})", unit if unit != "1" else "", atom.text) if word)
            for atom, c, s, unit in zip(self.atoms, self.coefficients, self.sigmas, self.units, strict=True)
        ]
        return f"{self.symbol} = {' + '.join(parts)}"

    def of(self, x: Floats) -> Floats:
        """Values at states x (n,)."""
        return np.asarray(sum(c * atom.of(x) for c, atom in zip(self.coefficients, self.atoms, strict=True)))

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "text": self.text,
            "terms": [
                {"function": atom.text or "1", "coefficient": float(c), "sigma": float(s), "unit": unit}
                for atom, c, s, unit in zip(self.atoms, self.coefficients, self.sigmas, self.units, strict=True)
            ],
            "keeps": self.keeps,
        }


@dataclass(frozen=True, eq=False)
class Tangent:
    """The likelihood of a curve near its fit, profiled over the base's constants: -2 log L = 2 g d + d H d + const.

    ``d`` are the curve's values less ``values``, (n,).
    """

    values: Floats
    g: Floats
    H: Floats
    sigmas: Floats  # (n,) one deviation of each value, the roughness penalty and the values' prior included


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
    return Tangent(values, g, H, np.abs(per_u) * sigmas_u)


def deviations(information: Floats) -> Floats:
    """Standard deviations (n,) from a positive definite information matrix (n, n), also where it is nearly singular:
    there they are large, limited by the accuracy of its elements."""
    size = np.sqrt(np.diag(information))
    values, ways = np.linalg.eigh(information / np.outer(size, size))
    values = np.maximum(values, len(size) * np.finfo(float).eps)
    return np.asarray(np.sqrt(np.sum(ways**2 / values, axis=1)) / size)


def sparse(t: Tangent, at: Floats, atoms: Sequence[Atom]) -> list[tuple[tuple[Atom, ...], Floats]]:
    """Atoms and coefficients of the sums nearest to the curve in the runs' likelihood: a few of each size.

    Exhaustive, and the first atom alone in any case; ``at`` (n,) in SI. Parts that the base's constants can compensate
    cost nothing, so they need not be in a sum.
    """
    table = np.stack([atom.of(at) for atom in atoms], axis=1)
    size = np.linalg.norm(table, axis=0)
    table = table / size
    target = t.H @ t.values - t.g
    found = []
    for k, most in enumerate(KEPT, 1):
        rows = []
        for chosen in itertools.combinations(range(len(atoms)), k):
            A = table[:, chosen]
            if np.linalg.cond(A) > ALIKE:  # the difference of two nearly equal functions is not informative
                continue
            a = np.linalg.lstsq(A.T @ t.H @ A, A.T @ target, rcond=1e-10)[0]
            rows.append((_misfit(t, A @ a), chosen, a / size[list(chosen)]))
        simplest = [row for row in rows if row[1] == (0,)]
        rows.sort(key=lambda row: row[0])
        tried = [*rows[:most], *(row for row in simplest if row[1] not in [r[1] for r in rows[:most]])]
        found += [(tuple(atoms[j] for j in chosen), a) for _, chosen, a in tried]
    return found


class Formed(Campaign):
    """A campaign in which a curve is a sum of functions: unknowns beside the base's are shares of coefficients."""

    curve: tuple[Unknown, ...]  # the base's and the curve's
    to_u: Floats  # (points of the curve, coefficients): u of the curve by the shares

    @classmethod
    def of(cls, campaign: Campaign, curve: tuple[Unknown, ...], to_u: Floats) -> Formed:
        """The campaign with the curve's unknowns as such sums."""
        out = cls(campaign.observations, campaign.system, campaign.pool, campaign.stop, campaign.level)
        out.tally, out.random_effects = campaign.tally, campaign.random_effects
        out.curve, out.to_u = curve, to_u
        return out

    def residuals(self, unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[Floats]:
        """Residuals (m,) at each point."""
        return super().residuals(self.curve, [self._u(p) for p in points])

    def linearised(self, unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[tuple[Floats, Floats]]:
        """Residuals (m,) and Jacobian (m, unknowns) at each point, by the chain rule."""
        base = len(self.curve) - len(self.to_u)
        seen = super().linearised(self.curve, [self._u(p) for p in points])
        return [(r, np.hstack([J[:, :base], J[:, base:] @ self.to_u])) for r, J in seen]

    def _u(self, point: Floats) -> Floats:
        base = len(self.curve) - len(self.to_u)
        return np.concatenate([point[:base], self.to_u @ point[base:]])


def fitted(
    campaign: Campaign, fit: Fit, others: Floats, at: Floats, atoms: tuple[Atom, ...], start: Floats
) -> tuple[Fit, Floats]:
    """A sum of atoms fitted to the runs themselves, and its coefficients; ``fit`` is the curve's, ``others`` (k, base)
    the roughness penalty of what is beside it."""
    base = others.shape[1]
    scale = np.array([k.scale for k in fit.unknowns[base:]])
    to_u = np.stack([atom.of(at) for atom in atoms], axis=1) * start / scale[:, None]
    here = Formed.of(campaign, fit.unknowns, to_u)
    unknowns = (
        *fit.unknowns[:base],
        *(Unknown(f"coefficient.{n}", 1.0, kind="linear", sd=100.0) for n in range(len(atoms))),
    )
    u = np.concatenate([fit.u[:base], np.ones(len(atoms))])
    smooth = np.hstack([others, np.zeros((len(others), len(atoms)))])
    end = fitted_unknowns(here, unknowns, u, rounds=ROUNDS, share=2e-3, smooth=smooth)
    return end, end.u[base:] * start


def formula(
    campaign: Campaign, fit: Fit, base: int, smooth: Floats, at: Floats, atoms: Sequence[Atom], null_cost: float
) -> tuple[tuple[Atom, ...], Floats, Floats, float]:
    """The fewest atoms that explain the runs nearly as well as any: they, coefficients, sigmas, share of the gain kept.

    Another atom must gain its cost, or a share of the whole gain, as no law has exactly the true form.
    """
    t, count, others = tangent(fit, base, smooth), len(fit.residual), smooth[:, :base]
    best: tuple[float, tuple[Atom, ...], Floats, Fit] | None = None
    curve_cost = robust_cost(fit.residual) + prior_cost(fit.unknowns[:base], fit.u[:base])
    curve_cost += float(np.sum((others @ fit.u[:base]) ** 2))
    price = max(float(np.log(count)), EARNS * (null_cost - curve_cost))
    for chosen, start in sparse(t, at, atoms):
        end, coefficients = fitted(campaign, fit, others, at, chosen, start)
        score = end.cost + price * sum(atom.numbers for atom in chosen)
        if best is None or score < best[0]:
            best = score, chosen, coefficients, end
        if campaign.stop():
            break
    assert best is not None
    _, chosen, coefficients, end = best
    w = weights(end.residual)
    spread = max(1.0, float(np.mean(w * end.residual**2)))
    prior = np.diag([1 / k.sd**2 for k in end.unknowns])
    prior[:base, :base] += others.T @ others
    information = (end.slopes * w[:, None]).T @ end.slopes / spread + prior
    sigmas = deviations(information)[base:] * np.abs(coefficients / end.u[base:])
    return chosen, coefficients, sigmas, (null_cost - end.cost) / max(null_cost - curve_cost, 1e-9)


def _misfit(t: Tangent, values: Floats) -> float:
    d = values - t.values
    return float(2 * t.g @ d + d @ t.H @ d)
