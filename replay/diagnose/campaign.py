"""A campaign: runs of one specimen, and their residuals and Jacobians from a pool of workers."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.errors import ModelError
from model.parameters import StrawParameters
from replay.diagnose.hypothesis import Hypothesis, Unknown
from replay.diagnose.library import hypothesis
from replay.diagnose.misfit import Misfit, coarse_misfit, misfit
from replay.diagnose.observation import Observation
from replay.diagnose.settings import FAILED_SIGMAS

Floats = NDArray[np.float64]


class Level(Enum):
    """What is compared: slow part, envelope and snap times, or all samples."""

    COARSE = "coarse"
    FINE = "fine"


class Campaign:
    """Observations of one specimen; what is asked of them is worked out by an executor's workers."""

    def __init__(
        self,
        observations: Sequence[Observation],
        straw: StrawParameters,
        pool: Executor,
        stop: Callable[[], bool] = lambda: False,
        level: Level = Level.FINE,
    ) -> None:
        self.observations, self.straw, self.pool, self.stop = tuple(observations), straw, pool, stop
        self.level = level
        self.tally = {"played": 0, "failed": 0, "steps": 0}  # shared with campaigns made from this one
        self.random_effects: list[tuple[Floats, Floats]] | None = None

    def only(self, names: Sequence[str]) -> Campaign:
        """The campaign with some of its runs, and what repeats of these may differ by."""
        which = [k for k, o in enumerate(self.observations) if o.name in set(names)]
        out = self._like([self.observations[k] for k in which], self.level)
        out.random_effects = [self.random_effects[k] for k in which] if self.random_effects else None
        return out

    def coarse(self) -> Campaign:
        """The campaign with only slow parts, envelopes and snap times compared: the way down to a good fit is wider."""
        return self._like(self.observations, Level.COARSE)

    def with_straw(self, straw: StrawParameters) -> Campaign:
        """The campaign with another straw to start from."""
        out = Campaign(self.observations, straw, self.pool, self.stop, self.level)
        out.tally, out.random_effects = self.tally, self.random_effects
        return out

    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        """One or more causes together, as they may act on this specimen."""
        return hypothesis(names, self.straw.cells)

    def misfits(self, unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[list[Misfit | None]]:
        """Misfit of every run at every point u; None where the model cannot follow."""
        return self._worked_out(_one, unknowns, points)

    def residuals(self, unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[Floats]:
        """Residuals (m,) of all runs in sigmas at each point u; runs that cannot be simulated count as very wrong."""
        rows = self._worked_out(_differences, unknowns, points, self.level, False)
        return [self._stacked(row) for row in rows]

    def linearised(self, unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[tuple[Floats, Floats]]:
        """Residuals (m,) and Jacobian (m, unknowns) at each point u."""
        out = []
        for row in self._worked_out(_differences, unknowns, points, self.level, True):
            jacobian = np.concatenate(
                [
                    np.zeros((self.size(o), len(unknowns))) if one is None else one[1]
                    for o, one in zip(self.observations, row, strict=True)
                ]
            )
            out.append((self._stacked(row), self.decorrelated(jacobian)))
        return out

    def allow(self, directions: Floats) -> None:
        """Let every run differ a little from the others (random effects): ``directions`` (m, k) are what one standard
        deviation of each kind does to the residuals.

        With covariance 1 + J J' in each run, residuals are multiplied by its inverse root.
        """
        self.random_effects = []
        for part in self.slices():
            basis, size, _ = np.linalg.svd(directions[part], full_matrices=False)
            self.random_effects.append((basis, 1 / np.sqrt(1 + size**2) - 1))

    def decorrelated(self, differences: Floats) -> Floats:
        """Residuals (m,) or Jacobian (m, k) with what repeats of one straw differ by counted as such."""
        if self.random_effects is None:
            return differences
        out = differences.copy()
        for part, (basis, less) in zip(self.slices(), self.random_effects, strict=True):
            here = differences[part]
            out[part] += basis @ ((basis.T @ here).T * less).T
        return out

    def size(self, observed: Observation) -> int:
        """Length of a run's residual vector."""
        shaped = observed.envelope.size if self.level is Level.COARSE else observed.tip.size
        return shaped + len(observed.snaps_s) + 1

    def slices(self) -> list[slice]:
        """Where each run's residuals lie in the stacked vector."""
        ends = np.cumsum([0, *(self.size(o) for o in self.observations)])
        return [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]

    def _like(self, observations: Sequence[Observation], level: Level) -> Campaign:
        out = type(self)(observations, self.straw, self.pool, self.stop, level)
        out.tally = self.tally
        return out

    def _worked_out(
        self, how: Callable[..., Any], unknowns: Sequence[Unknown], points: Sequence[Floats], *more: Any
    ) -> list[list[Any]]:
        """What ``how`` tells of every run at every point, from the pool's workers; it says how many steps it took."""
        jobs = [
            [self.pool.submit(how, o, self.straw, tuple(unknowns), point, *more) for o in self.observations]
            for point in points
        ]
        found = [[job.result() for job in row] for row in jobs]
        self.tally["played"] += sum(len(row) for row in found)
        self.tally["steps"] += sum(steps for row in found for _, steps in row)
        self.tally["failed"] += sum(one is None for row in found for one, _ in row)
        return [[one for one, _ in row] for row in found]

    def _stacked(self, row: Sequence[tuple[Floats, Floats] | None]) -> Floats:
        return self.decorrelated(
            np.concatenate(
                [
                    np.full(self.size(o), FAILED_SIGMAS) if one is None else one[0]
                    for o, one in zip(self.observations, row, strict=True)
                ]
            )
        )


def _one(
    observed: Observation, straw: StrawParameters, unknowns: tuple[Unknown, ...], at: Floats
) -> tuple[Misfit | None, int]:
    try:
        one = misfit(observed, straw, unknowns, at)
    except ModelError:
        return None, 0
    return one, one.steps


def _differences(
    observed: Observation,
    straw: StrawParameters,
    unknowns: tuple[Unknown, ...],
    at: Floats,
    level: Level,
    derivatives: bool,
) -> tuple[tuple[Floats, Floats] | None, int]:
    try:
        if level is Level.COARSE:
            residual, jacobian, steps = coarse_misfit(observed, straw, unknowns, at, derivatives=derivatives)
            return (residual, jacobian), steps
        one = misfit(observed, straw, unknowns, at, derivatives=derivatives)
    except ModelError:
        return None, 0
    return (one.vector, one.jacobian), one.steps
