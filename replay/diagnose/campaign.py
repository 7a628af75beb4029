"""A campaign: runs of one specimen, and their residuals and Jacobians from a pool of workers."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.recording import Recording
from straw.replay.diagnose.settings import COLUMN_COSTS, FAILED_SIGMAS
from straw.replay.diagnose.system import Level, Misfit, System

Floats = NDArray[np.float64]

#: Derivatives, sigmas per u, above which a motion is too unstable for them to tell anything: in double precision the
#: normal equations, of their squares, no longer hold the priors, which are of order 1.
STEEPEST = 1 / np.sqrt(np.finfo(np.float64).eps)
#: Bytes of Jacobians that are kept, the last ones: fits that are continued start where they ended, a tenth of all work.
#: Those of a tournament's 24 starts are 60 MB with four runs of 5 s at 240 Hz and 20 unknowns.
KEPT = 2e8

#: Of runs that share all constants.
NOTHING: Mapping[str, Any] = {}


class Point(NamedTuple):
    """A point u at which residuals are wanted, and perhaps their derivatives."""

    unknowns: tuple[Unknown, ...]
    u: Floats
    derivatives: bool = False


class RandomEffects(NamedTuple):
    """How one run may differ from the others: its residuals have covariance 1 + J J', with J linearised.

    ``basis`` (m, k) along which residuals are made smaller, ``factor`` (k,) by what less one; ``offset`` (m,): what J
    says the run's own constants do, where the run is simulated with them.
    """

    basis: Floats
    factor: Floats
    offset: Floats


class Campaign:
    """Recordings of one system, whose residuals are computed by an executor's workers.

    ``own``: by run, steps in u of constants that it does not share with the others, by target.
    """

    def __init__(
        self,
        observations: Sequence[Recording],
        system: System,
        pool: Executor,
        stop: Callable[[], bool] = lambda: False,
        level: Level = Level.FINE,
    ) -> None:
        self.observations, self.system, self.pool, self.stop = tuple(observations), system, pool, stop
        self.level = level
        self.tally = {"played": 0, "failed": 0, "work": 0.0}  # shared with campaigns made from this one
        self.kept: dict[tuple[Hashable, ...], Misfit] = {}  # with derivatives; shared like the tally
        self.random_effects: list[RandomEffects] | None = None
        self.own: dict[str, dict[str, float]] = {}

    def only(self, names: Sequence[str]) -> Campaign:
        """The campaign with some of its runs, and their random effects."""
        which = [k for k, o in enumerate(self.observations) if o.name in set(names)]
        out = self._like([self.observations[k] for k in which], self.level)
        out.random_effects = [self.random_effects[k] for k in which] if self.random_effects else None
        out.own = {name: own for name, own in self.own.items() if name in names}
        return out

    def coarse(self) -> Campaign:
        """The campaign with only smooth features compared, which widens the basin of a good fit."""
        return self._like(self.observations, Level.COARSE)

    def with_system(self, system: System) -> Campaign:
        """The campaign with another system to start from."""
        out = Campaign(self.observations, system, self.pool, self.stop, self.level)
        out.tally, out.random_effects, out.own = self.tally, self.random_effects, self.own
        return out

    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        """One or more causes together, as they may act on this system."""
        return self.system.hypothesis(names)

    def misfits(self, unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[list[Misfit | None]]:
        """Misfit of every run at every point u, shared by all runs; None where the model cannot follow."""
        return self._worked_out([Point(tuple(unknowns), u) for u in points], Level.FINE)

    def at(self, points: Sequence[Point]) -> list[tuple[Floats, Floats]]:
        """Residuals (m,) of all runs in sigmas and Jacobian (m, unknowns) at each point, without columns where no
        derivatives are wanted; runs with constants of their `own` have them. Large residuals and zero derivatives of
        runs that cannot be simulated, zero derivatives where they exceed `STEEPEST`."""
        out = []
        for point, row in zip(points, self._worked_out(points, self.level, self.own), strict=True):
            columns = len(point.unknowns) if point.derivatives else 0
            jacobian = np.concatenate(
                [
                    np.zeros((self.size(o), columns)) if not columns or one is None or _unstable(one) else one.jacobian
                    for o, one in zip(self.observations, row, strict=True)
                ]
            )
            out.append((self._stacked(row), self.decorrelated(jacobian) if columns else jacobian))
        return out

    def residuals(self, unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[Floats]:
        """Residuals (m,) at each point u; see `at`."""
        return [residual for residual, _ in self.at([Point(tuple(unknowns), u) for u in points])]

    def allow(self, directions: Floats, offset: Floats | None = None) -> None:
        """Let every run differ a little from the others (random effects): ``directions`` (m, k) are the effects of one
        standard deviation of each kind on the residuals, ``offset`` (m,) what they say of the runs' `own` constants.

        With covariance 1 + J J' in each run, residuals are multiplied by its inverse root.
        """
        self.random_effects = []
        for part in self.slices():
            basis, size, _ = np.linalg.svd(directions[part], full_matrices=False)
            off = np.zeros(part.stop - part.start) if offset is None else offset[part]
            self.random_effects.append(RandomEffects(basis, 1 / np.sqrt(1 + size**2) - 1, off))

    def decorrelated(self, differences: Floats) -> Floats:
        """Differences of residuals (m,) or Jacobian (m, k), whitened for the random effects."""
        if self.random_effects is None:
            return differences
        return self._along(differences, [(one.basis, one.factor) for one in self.random_effects])

    def correlated(self, whitened: Floats, effects: Sequence[RandomEffects]) -> Floats:
        """Differences or Jacobian before they were whitened for these effects: the inverse of `decorrelated`."""
        return self._along(whitened, [(one.basis, 1 / (1 + one.factor) - 1) for one in effects])

    def whitened(self, residual: Floats) -> Floats:
        """Residuals (m,) without what the random effects say of the runs' own constants, whitened for them."""
        if self.random_effects is None:
            return residual
        return self.decorrelated(residual - np.concatenate([one.offset for one in self.random_effects]))

    def _along(self, differences: Floats, ways: Sequence[tuple[Floats, Floats]]) -> Floats:
        out = differences.copy()
        for part, (basis, factor) in zip(self.slices(), ways, strict=True):
            here = differences[part]
            out[part] += basis @ ((basis.T @ here).T * factor).T
        return out

    def size(self, observed: Recording) -> int:
        """Length of a run's residual vector."""
        return self.system.size(observed, self.level)

    def slices(self) -> list[slice]:
        """The place of each run's residuals in the stacked vector."""
        ends = np.cumsum([0, *(self.size(o) for o in self.observations)])
        return [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]

    def _like(self, observations: Sequence[Recording], level: Level) -> Campaign:
        out = type(self)(observations, self.system, self.pool, self.stop, level)
        out.tally, out.kept, out.own = self.tally, self.kept, self.own
        return out

    def _worked_out(
        self, points: Sequence[Point], level: Level, own: Mapping[str, Mapping[str, float]] = NOTHING
    ) -> list[list[Misfit | None]]:
        """Misfit of every run at every point: kept, or from the pool's workers."""
        every = [[_own(point, own.get(o.name, NOTHING)) for o in self.observations] for point in points]
        found = [
            [self.kept.get(_key(point, o, level)) for point, o in zip(row, self.observations, strict=True)]
            for row in every
        ]
        jobs = {
            (k, r): self.pool.submit(_one, self.system, observed, *every[k][r], level)
            for k in range(len(points))
            for r, observed in enumerate(self.observations)
            if found[k][r] is None
        }
        for (k, r), job in jobs.items():
            found[k][r] = one = job.result()
            columns = len(points[k].unknowns) if points[k].derivatives else 0
            self.tally["played"] += 1
            self.tally["failed"] += one is None
            if one is not None:
                self.tally["work"] += one.work * (1 + COLUMN_COSTS * columns)
            if one is not None and points[k].derivatives:
                self.kept[_key(every[k][r], self.observations[r], level)] = one
        while sum(one.jacobian.nbytes for one in self.kept.values()) > KEPT:
            del self.kept[next(iter(self.kept))]
        return found

    def _stacked(self, row: Sequence[Misfit | None]) -> Floats:
        return self.whitened(
            np.concatenate(
                [
                    np.full(self.size(o), FAILED_SIGMAS) if one is None else one.vector
                    for o, one in zip(self.observations, row, strict=True)
                ]
            )
        )


def _own(point: Point, steps: Mapping[str, float]) -> Point:
    """The point with the steps of a run's own constants."""
    if not steps:
        return point
    return point._replace(u=point.u + [steps.get(one.target, 0.0) for one in point.unknowns])


def _key(point: Point, observed: Recording, level: Level) -> tuple[Hashable, ...]:
    return observed.name, level, point.unknowns, point.u.tobytes()


def _unstable(one: Misfit) -> bool:
    return bool(np.abs(one.jacobian).max(initial=0.0) > STEEPEST)


def _one(
    system: System, recording: Recording, unknowns: tuple[Unknown, ...], at: Floats, derivatives: bool, level: Level
) -> Misfit | None:
    """A run's misfit; None where it, or a derivative, is not finite."""
    found = system.misfit(recording, unknowns, at, level=level, derivatives=derivatives)
    if found is None or not np.isfinite(found.vector).all() or not np.isfinite(found.jacobian).all():
        return None
    return found
