"""A campaign: runs of one specimen, and where straws are played against them on a pool of workers."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown, applied
from straw.replay.diagnose.library import hypothesis
from straw.replay.diagnose.misfit import FINE_M, LIVELIEST_PER_S, TOLERANCE_M, Misfit, misfit, rough_misfit
from straw.replay.diagnose.observation import Observation

Floats = NDArray[np.float64]

#: A simulation that fails counts as this many sigmas everywhere.
FAILED_SIGMAS = 300.0


class Campaign:
    """Observations of one specimen, and where straws are played against them."""

    def __init__(
        self,
        observations: Sequence[Observation],
        straw: StrawParameters,
        pool: Executor,
        stop: Callable[[], bool] = lambda: False,
        patience: float = np.inf,
    ) -> None:
        self.observations, self.straw, self.pool, self.stop = tuple(observations), straw, pool, stop
        # of runs, and of what was left out in a hurry; shared with campaigns made from this one
        self.tally = {"played": 0, "failed": 0, "steps": 0, "left_out": 0}
        self.patience = patience  # steps
        self.steps: dict[str, float] = {}  # of derivatives by each unknown, as last felt well
        self.scatter: list[tuple[Floats, Floats]] | None = None
        self.how: Callable[..., Any] = _vector  # what is compared

    def only(self, names: Sequence[str]) -> Campaign:
        """The campaign with some of its runs."""
        return self._like([o for o in self.observations if o.name in set(names)], self.how)

    def among(self, names: Sequence[str]) -> tuple[Campaign, NDArray[np.intp]]:
        """The campaign with some of its runs and what these may differ by, and where their differences are in all."""
        which = [k for k, o in enumerate(self.observations) if o.name in set(names)]
        out = self._like([self.observations[k] for k in which], self.how)
        out.scatter = [self.scatter[k] for k in which] if self.scatter else None
        parts = self.slices()
        return out, np.concatenate([np.arange(parts[k].start, parts[k].stop) for k in which])

    def roughly(self) -> Campaign:
        """The campaign with only outlines compared: the way down to a good fit is wider."""
        return self._like(self.observations, _rough)

    def finely(self) -> Campaign:
        """The campaign played more accurately, for slopes by which constants' sigmas are told."""
        out = self._like(self.observations, _fine)
        out.scatter = self.scatter
        return out

    def look_until(self, ends_s: Mapping[str, float]) -> None:
        """From now on look at some runs, by name, until these times; what they may differ by has to be felt anew."""
        self.observations = tuple(o.until(ends_s[o.name]) if o.name in ends_s else o for o in self.observations)
        self.scatter = None

    def seen_until(self, ends_s: Mapping[str, float]) -> NDArray[np.intp]:
        """Where those of all differences are that are still there when some runs, by name, are looked at until then."""
        rows = []
        for observed, part in zip(self.observations, self.slices(), strict=True):
            end_s = ends_s.get(observed.name, np.inf)
            timing = np.append(observed.snaps_s <= end_s, True)
            rows.append(part.start + np.flatnonzero(np.append(np.tile(observed.time_s <= end_s, 3), timing)))
        return np.concatenate(rows)

    def shares_with(self, other: Campaign) -> Self:
        """This campaign, from now on counting, playing and allowing for repeats as another does."""
        self.tally, self.scatter, self.how = other.tally, other.scatter, other.how
        self.patience = other.patience
        return self

    @property
    def hurried(self) -> bool:
        """Whether so many steps have been taken that what only may help is left out: by steps and not by the clock, so
        that every machine finds the same."""
        return self.tally["steps"] > self.patience

    def leaves_out(self) -> bool:
        """Whether what only may help, and would be done now, is left out as the search is `hurried`; it is counted."""
        self.tally["left_out"] += self.hurried
        return self.hurried

    @property
    def rough(self) -> bool:
        """Whether only outlines are compared."""
        return self.how is _rough

    def _like(self, observations: Sequence[Observation], how: Callable[..., Any]) -> Campaign:
        """Another campaign that counts with this one; what repeats differ by has to be felt anew."""
        out = Campaign(observations, self.straw, self.pool, self.stop, self.patience)
        out.how, out.tally = how, self.tally
        return out

    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        """One or more causes together, as they may act on this specimen."""
        return hypothesis(names, self.straw.cells)

    def misfits(self, unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[list[Misfit | None]]:
        """Misfit of every run at every point u; None where the model cannot follow."""
        return self.played(_one, unknowns, points)

    def played(self, how: Callable[..., Any], unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[list[Any]]:
        """What ``how`` tells of every run at every point u, from the pool's workers; it says how many steps it took."""
        jobs = [
            [self.pool.submit(how, o, self.straw, tuple(unknowns), point) for o in self.observations]
            for point in points
        ]
        found = [[job.result() for job in row] for row in jobs]
        self.tally["played"] += sum(len(row) for row in found)
        self.tally["steps"] += sum(steps for row in found for _, steps in row)
        self.tally["failed"] += sum(one is None for row in found for one, _ in row)
        return [[one for one, _ in row] for row in found]

    def residuals(self, unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[Floats]:
        """All differences of all runs in sigmas as one vector for each point u."""
        played = self.played(self.how, unknowns, points)
        return [self.stacked(row) for row in played]

    def stacked(self, row: Sequence[Floats | None]) -> Floats:
        """One vector of all runs; failures count as very wrong."""
        return self.repeatable(
            np.concatenate(
                [
                    np.full(self.size(o), FAILED_SIGMAS) if one is None else one
                    for o, one in zip(self.observations, row, strict=True)
                ]
            )
        )

    def allow(self, slopes: Floats) -> None:
        """Let every run differ a little from the others: ``slopes`` (m, k) are what one deviation of each kind does.

        From now on differences in these directions count as what they are beside what repeats differ by: with
        covariance 1 + J J' in each run, differences are multiplied by its inverse root.
        """
        self.scatter = []
        for part in self.slices():
            directions, size, _ = np.linalg.svd(slopes[part], full_matrices=False)
            self.scatter.append((directions, 1 / np.sqrt(1 + size**2) - 1))

    def repeatable(self, differences: Floats) -> Floats:
        """Differences (m,) or slopes (m, k) with what runs of one straw differ by counted as such."""
        if self.scatter is None:
            return differences
        out = differences.copy()
        for part, (directions, less) in zip(self.slices(), self.scatter, strict=True):
            here = differences[part]
            out[part] += directions @ ((directions.T @ here).T * less).T
        return out

    def size(self, observed: Observation) -> int:
        """Length of a run's misfit vector."""
        return (observed.outline.size if self.rough else observed.tip.size) + len(observed.snaps_s) + 1

    def slices(self) -> list[slice]:
        """Where each run's differences lie in the stacked vector."""
        ends = np.cumsum([0, *(self.size(o) for o in self.observations)])
        return [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]


def _one(
    observed: Observation,
    straw: StrawParameters,
    unknowns: tuple[Unknown, ...],
    at: Floats,
    finest_m: float = TOLERANCE_M,
) -> tuple[Misfit | None, int]:
    try:
        one = misfit(observed, *applied(straw, unknowns, at), finest_m)
    except ModelError:
        return _failed(observed)
    return one, one.steps


def _vector(*what: Any) -> tuple[Floats | None, int]:
    one, steps = _one(*what)
    return None if one is None else one.vector, steps


def _fine(*what: Any) -> tuple[Floats | None, int]:
    return _vector(*what, FINE_M)


def _rough(
    observed: Observation, straw: StrawParameters, unknowns: tuple[Unknown, ...], at: Floats
) -> tuple[Floats | None, int]:
    try:
        return rough_misfit(observed, *applied(straw, unknowns, at))
    except ModelError:
        return _failed(observed)


def _failed(observed: Observation) -> tuple[None, int]:
    """Nothing, for as many steps as it may have taken to find out."""
    return None, round(LIVELIEST_PER_S * (observed.end_s - observed.start_s))
