"""Hypotheses: what may be missing, as unknowns with priors."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Unknown:
    """One number to estimate: ``target`` names it for its system, as ``PLACE.NAME``.

    Searched as u: value = start exp(scale u) of a ``log`` one, scale sinh(u) of a strength, which is linear while
    small and logarithmic when large, and scale u of a ``linear`` one; at zero strength the cause is absent. Its prior
    is a normal distribution about u = ``mean`` with deviation ``sd``; low and high bound u.
    """

    target: str
    scale: float
    start: float = 0.0
    kind: str = "strength"
    mean: float = 0.0
    sd: float = 1.0
    low: float = -np.inf
    high: float = np.inf

    def value(self, u: float) -> float:
        """The number, SI, at u."""
        if self.kind == "log":
            with np.errstate(over="ignore"):  # infinite where a search steps too far: a run that cannot be simulated
                return float(self.start * np.exp(self.scale * u))
        return self.scale * self.units(u)

    def per_u(self, u: float) -> float:
        """d value / d u."""
        return self.value(u) * self.scale if self.kind == "log" else self.scale * self.units_per_u(u)

    def units(self, u: float) -> float:
        """A strength in units of ``scale``; u itself for other unknowns."""
        return float(np.sinh(u)) if self.kind == "strength" else u

    def units_per_u(self, u: float) -> float:
        """d units / d u."""
        return float(np.cosh(u)) if self.kind == "strength" else 1.0

    def at(self, units: float) -> float:
        """u of so many `units`."""
        return float(np.arcsinh(units)) if self.kind == "strength" else units


@dataclass(frozen=True)
class Hypothesis:
    """Causes that act together, their unknowns, and starts for each (u without the base's)."""

    causes: tuple[str, ...]
    unknowns: tuple[Unknown, ...]
    starts: tuple[tuple[float, ...], ...]
    faults: frozenset[str] = frozenset()  # causes that are faults of a recording

    @property
    def name(self) -> str:
        """Causes joined by +; ``complete`` without any."""
        return "+".join(self.causes) or "complete"

    def beside(self, first: Hypothesis) -> Hypothesis:
        """Both hypotheses' causes together, physics named before instruments; no starts."""
        faults = first.faults | self.faults
        both = in_order((*first.causes, *self.causes), faults)
        return Hypothesis(both, (*first.unknowns, *self.unknowns), (), faults)


def in_order(causes: Sequence[str], faults: Collection[str]) -> tuple[str, ...]:
    """Causes in the order in which a pair is named, so that it has one name: physics first, then by the alphabet."""
    return tuple(sorted(causes, key=lambda name: (name in faults, name)))
