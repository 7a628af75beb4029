"""A sparse formula for a curve: the few functions of its state that the runs themselves cannot tell from the curve."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.diagnose.search import Fit, weights

Floats = NDArray[np.float64]

#: Most functions in a formula, and the condition number at which some of them are alike.
MOST, ALIKE = 3, 12.0


@dataclass(frozen=True)
class Atom:
    """One function of the state: how it is written, its power of the state's unit, and what choosing it costs."""

    text: str
    power: float
    of: Callable[[Floats], Floats]
    numbers: int = 1  # constants it brings, its own shape included


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
            f"({c:.3g} ± {s:.2g}) {unit}{' ' + atom.text if atom.text else ''}"
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
    """What runs say of a curve near its fit once the base's constants give way: -2 log L = 2 g d + d H d + const.

    ``d`` are the curve's values less ``values``, (n,).
    """

    values: Floats
    g: Floats
    H: Floats
    smooth: Floats  # (n, n) what H lacks: the price of roughness, and how wide values were sought


def tangent(fit: Fit, base: int, rows: Floats) -> Tangent:
    """Of a fit whose first unknowns are the base's and whose last differences are ``rows`` times values in units.

    Robust weights; what the fit leaves beyond noise widens everything.
    """
    runs = slice(0, len(fit.residual) - len(rows))
    w = weights(fit.residual[runs])
    spread = max(1.0, float(np.mean(w * fit.residual[runs] ** 2)))
    per_u = np.array([k.per_u(float(u)) for k, u in zip(fit.unknowns[base:], fit.u[base:], strict=True)])
    J = fit.slopes[runs] / np.concatenate([np.ones(base), per_u])
    S, s = (J * w[:, None]).T @ J / spread, J.T @ (w * fit.residual[runs]) / spread
    S[:base, :base] += np.diag([1 / k.sd**2 for k in fit.unknowns[:base]])
    s[:base] += [(u - k.mean) / k.sd**2 for k, u in zip(fit.unknowns[:base], fit.u[:base], strict=True)]
    inverse = np.linalg.inv(S[:base, :base])
    H = S[base:, base:] - S[base:, :base] @ inverse @ S[:base, base:]
    g = s[base:] - S[base:, :base] @ inverse @ s[:base]
    values = np.array([k.value(float(u)) for k, u in zip(fit.unknowns[base:], fit.u[base:], strict=True)])
    units = np.array([k.scale for k in fit.unknowns[base:]])
    wide = np.diag([1 / (k.sd * slope) ** 2 for k, slope in zip(fit.unknowns[base:], per_u, strict=True)])
    return Tangent(values, g, H, (rows / units).T @ (rows / units) + wide)


def sparse(
    t: Tangent, at: Floats, atoms: Sequence[Atom], symbol: str, units: Callable[[float], str], count: int
) -> Formula:
    """The best sum of at most MOST atoms by BIC, of ``count`` independent differences; ``at`` (n,) in SI.

    Exhaustive. What the base's constants can take over costs nothing, so it does not enter a formula.
    """
    table = np.stack([atom.of(at) for atom in atoms], axis=1)
    size = np.linalg.norm(table, axis=0)
    table = table / size
    target = t.H @ t.values - t.g
    none = _misfit(t, np.zeros(len(at)))
    best: tuple[float, tuple[int, ...], Floats] | None = None
    for k in range(1, MOST + 1):
        for chosen in itertools.combinations(range(len(atoms)), k):
            A = table[:, chosen]
            if np.linalg.cond(A) > ALIKE:  # the difference of two that are alike says nothing
                continue
            normal = A.T @ t.H @ A
            a = np.linalg.lstsq(normal, A.T @ target, rcond=1e-10)[0]
            price = sum(atoms[j].numbers for j in chosen) * np.log(count)
            score = _misfit(t, A @ a) + price
            if best is None or score < best[0]:
                best = score, chosen, a
    assert best is not None
    _, chosen, a = best
    A = table[:, chosen]
    sigma = np.sqrt(np.diag(np.linalg.pinv(A.T @ t.H @ A)))
    least = -float(t.g @ np.linalg.lstsq(t.H, t.g, rcond=1e-10)[0])
    keeps = (none - _misfit(t, A @ a)) / max(none - least, 1e-9)
    order = sorted(range(len(chosen)), key=lambda j: -abs(a[j]))
    return Formula(
        symbol,
        tuple(atoms[chosen[j]] for j in order),
        np.array([a[j] / size[chosen[j]] for j in order]),
        np.array([sigma[j] / size[chosen[j]] for j in order]),
        tuple(units(atoms[chosen[j]].power) for j in order),
        float(keeps),
    )


def _misfit(t: Tangent, values: Floats) -> float:
    d = values - t.values
    return float(2 * t.g @ d + d @ t.H @ d)
