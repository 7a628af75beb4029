"""Curves as sums of functions, fitted to the runs themselves, and a fit with what it takes to repeat it elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign, Point
from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.fit import fitted as fitted_unknowns
from straw.replay.diagnose.formula import Sum
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.numerical import jacobian
from straw.replay.diagnose.recording import Recording
from straw.replay.diagnose.refine import refined
from straw.replay.diagnose.settings import COARSE_ROUNDS, ROUNDS
from straw.replay.diagnose.system import Level, Misfit

Floats = NDArray[np.float64]


class Formed(Campaign):
    """A campaign in which curves, the last of its unknowns, are sums of functions, whose unknowns follow the base's."""

    curves: tuple[Unknown, ...]  # the base's and the curves'
    sums: tuple[Sum, ...]  # of each curve

    @classmethod
    def of(cls, campaign: Campaign, curves: Sequence[Unknown], sums: Sequence[Sum]) -> Formed:
        """The campaign with the curves' unknowns as such sums."""
        out = cls(campaign.observations, campaign.system, campaign.pool, campaign.stop, campaign.level)
        out.tally, out.kept = campaign.tally, campaign.kept
        out.random_effects, out.own = campaign.random_effects, campaign.own
        out.curves, out.sums = tuple(curves), tuple(sums)
        return out

    @property
    def base(self) -> int:
        """How many unknowns are no curve's."""
        return len(self.curves) - sum(len(one.at) for one in self.sums)

    def misfits(self, unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[list[Misfit | None]]:
        """Misfit of every run at every point."""
        return super().misfits(self.curves, [self.u_of_curves(p) for p in points])

    def at(self, points: Sequence[Point]) -> list[tuple[Floats, Floats]]:
        """Residuals (m,) and Jacobian (m, unknowns) at each point, by the chain rule."""
        out, base = [], self.base
        found = super().at([Point(self.curves, self.u_of_curves(p.u), p.derivatives) for p in points])
        for (unknowns, u, derivatives), (r, J) in zip(points, found, strict=True):
            if derivatives:
                own = jacobian(self._values, unknowns[base:], u[base:], self._values(u[base:]))
                J = np.hstack([J[:, :base], J[:, base:] @ own])
            out.append((r, J))
        return out

    def u_of_curves(self, point: Floats) -> Floats:
        """u of base and curves at a point u of base and sums."""
        return np.concatenate([point[: self.base], self._values(point[self.base :])])

    def _values(self, own: Floats) -> Floats:
        counts = [len(one.unknowns()[0]) for one in self.sums]
        parts = np.split(own, np.cumsum(counts)[:-1])
        return np.concatenate([one.values(part) for one, part in zip(self.sums, parts, strict=True)])

    def _like(self, observations: Sequence[Recording], level: Level) -> Campaign:
        out = super()._like(observations, level)
        assert isinstance(out, Formed)
        out.curves, out.sums = self.curves, self.sums
        return out


@dataclass(frozen=True, eq=False)
class Model:
    """A fit with what it takes to repeat it on other runs: their campaign, and the roughness penalty (k, unknowns)."""

    campaign: Campaign
    fit: Fit
    smooth: Floats | None = None

    @property
    def formulas(self) -> bool:
        """Whether curves in it are formulas."""
        return isinstance(self.campaign, Formed)

    def parameters(self) -> tuple[Sequence[Unknown], Floats]:
        """Unknowns of the system and u: of formulas, those of the curves they stand for."""
        if isinstance(self.campaign, Formed):
            return self.campaign.curves, self.campaign.u_of_curves(self.fit.u)
        return self.fit.unknowns, self.fit.u

    def shows(self, one: Recording) -> Floats:
        """Predicted values of the channels at a recording's times, (channels, n)."""
        return self.campaign.system.simulated(one, *self.parameters())


def fitted(
    campaign: Campaign,
    curves: Sequence[Unknown],
    u: Floats,
    others: Floats,
    sums: Sequence[Sum],
    rounds: int,
    share: float = 1e-4,
) -> Model:
    """Sums of atoms fitted to the runs themselves, beside the base at u (base,).

    ``curves`` are the unknowns of base and curves, ``others`` (k, base) the roughness penalty of what is beside
    the curves.
    """
    own, starts = zip(*(one.unknowns() for one in sums), strict=True)
    unknowns = (*curves[: others.shape[1]], *(one for part in own for one in part))
    smooth = np.pad(others, ((0, 0), (0, len(unknowns) - others.shape[1])))
    here = Formed.of(campaign, curves, sums)
    u = np.concatenate([u, *starts])
    return Model(here, fitted_unknowns(here, unknowns, u, rounds=rounds, share=share, smooth=smooth), smooth)


def coarsely_first(model: Model) -> Model:
    """The model fitted to the coarse comparison, and from there to all samples (`refined`)."""
    fit, smooth = model.fit, model.smooth
    coarse = fitted_unknowns(
        model.campaign.coarse(), fit.unknowns, fit.u, rounds=COARSE_ROUNDS[-1], share=1e-4, smooth=smooth
    )
    return replace(model, fit=refined(model.campaign, coarse, ROUNDS, smooth))
