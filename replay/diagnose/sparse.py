"""Sparse regression of a curve: the sums of few functions nearest to it in the likelihood of the runs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.formula import Atom
from straw.replay.diagnose.robust import weights

Floats = NDArray[np.float64]

#: How many sums of one, two and three functions are tried on the runs; the condition number at which some count as
#: alike. One more of each size is the nearest where the base's constants stay.
KEPT, ALIKE = (3, 2, 1), 12.0


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


def deviations_of(fit: Fit, smooth: Floats | None = None) -> Floats:
    """Standard deviations (unknowns,) of u at a fit, the prior and the roughness penalty ``smooth`` (k, unknowns)
    included.

    Robust weights; misfit beyond noise widens all uncertainties.
    """
    w = weights(fit.residual)
    spread = max(1.0, float(np.mean(w * fit.residual**2)))
    prior = np.diag([1 / k.sd**2 for k in fit.unknowns])
    rough = 0.0 if smooth is None else smooth.T @ smooth
    return deviations((fit.slopes * w[:, None]).T @ fit.slopes / spread + prior + rough)


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
