"""Fits constants of the straw to recordings, all runs at once, with decreasing blur in time, and with intervals.

A run that snaps gives point-wise least squares plateaus and cliffs: a snap 30 ms late is a large error whatever its
cause, and the basin of attraction is as narrow as the snap is short. Blurring the difference in time widens the basin
to the blur. Several starts are followed that way on a few dissimilar runs; the best is finished on all runs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from straw.model.parameters import StrawParameters
from straw.replay.compare.comparison import CHANNELS
from straw.replay.errors import ReplayError
from straw.replay.identify.difference import GAUGE_DRAWS, INTERVAL_TOLERANCE_M, sigmas, with_values
from straw.replay.identify.problem import Problem, pool_of, samples
from straw.rig.run import Run

Floats = NDArray[np.float64]
Progress = Callable[[int, int], None]

#: Blurs of the stages of the search and of the finish, s.
SEARCH = (0.3, 0.08, 0.02)
FINISH = (0.02, 0.0)
#: Starts that are followed down, and runs they are followed on.
FOLLOWED_STARTS, SEARCHED_RUNS = 2, 3
MOST_EVALUATIONS = 15
#: Residuals within this time count as one independent sample.
BLOCK_S = 0.5
#: Differences beyond this many sigmas count linearly, not squared.
ROBUST_SIGMAS = 5.0


@dataclass(frozen=True)
class Fitted:
    """Constants that fit, natural logarithms' covariance, and how well; arrays (constants,) and (n, n)."""

    names: tuple[str, ...]
    value: Floats
    log_covariance: Floats
    straw: StrawParameters
    reduced_chi2: float
    rms: dict[str, float]  # by channel, m or rad
    runs: tuple[str, ...]
    failures: int  # simulations that failed, each counted as a bad fit

    @property
    def interval(self) -> Floats:
        """95 % intervals, (constants, 2)."""
        half = 1.96 * np.sqrt(np.diag(self.log_covariance))
        return np.stack([self.value * np.exp(-half), self.value * np.exp(half)], axis=1)


def value_of(straw: StrawParameters, name: str) -> float:
    """The even frusta's mean of a constant of the straw."""
    value = np.asarray(getattr(straw, name), dtype=np.float64)
    return float(value[:, 1].mean() if value.ndim == 2 else value)


def most_different(runs: Sequence[Run]) -> list[Run]:
    """The most informative runs: for each start configuration the one whose tip travels furthest, longest first."""
    furthest: dict[tuple[int, ...] | None, tuple[float, Run]] = {}
    for run in runs:
        assert run.tip is not None
        travel_m = float(np.ptp(run.tip.x_m[run.tip.valid]))
        if travel_m > furthest.get(run.initial_deployed, (-1.0, run))[0]:
            furthest[run.initial_deployed] = (travel_m, run)
    return [run for _, run in sorted(furthest.values(), key=lambda pair: -pair[0])][:SEARCHED_RUNS]


def _gentle(differences: Floats) -> float:
    """Robust misfit, in which large differences count little more than moderate ones."""
    return float(np.sum(np.log1p((differences / ROBUST_SIGMAS) ** 2)))


def _descend(problem: Problem, at: Floats, blur_s: float) -> Floats:
    def differences(x: Floats) -> Floats:
        return problem.blurred(problem.many([x])[0], blur_s)

    def slopes(x: Floats) -> Floats:
        return problem.slopes(x, blur_s)

    found = least_squares(
        differences,
        at,
        slopes,
        loss="soft_l1",
        f_scale=ROBUST_SIGMAS,
        x_scale="jac",  # a few permille of r_ch have the effect of a tenth of c_zeta
        xtol=1e-5,
        ftol=1e-3,
        max_nfev=MOST_EVALUATIONS,
    )
    return np.asarray(found.x)


def fit(
    runs: Sequence[Run],
    straw: StrawParameters,
    names: Sequence[str],
    *,
    starts: Sequence[Floats] = (),
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Fitted:
    """Constants (all above zero) with which one straw explains all gathered runs best.

    Starts from the straw's own values and from ``starts`` (values in the order of ``names``), those with the least
    misfit at the widest blur. Intervals treat residuals within half a second as one sample, so that an incomplete
    model does not look certain, and include the gauge's noise, which shifts all snaps of a run together. They do not
    account for a wrong model. Raises ReplayError where nothing can be simulated.
    """
    with pool_of(executor) as pool:
        problem = Problem(runs, straw, names, pool)
        few = problem if len(runs) <= SEARCHED_RUNS else Problem(most_different(runs), straw, names, pool)
        own = np.array([value_of(straw, name) for name in names])
        points = [np.log(start) for start in (own, *starts) if np.all(start > 0)]
        if not points:
            raise ReplayError(f"fit: {', '.join(names)} must start above zero; give the straw values to start from")
        followed = min(FOLLOWED_STARTS, len(points))
        total = 1 + followed * len(SEARCH) + len(FINISH) + 1
        done = 0

        def tell() -> None:
            nonlocal done
            if progress:
                progress(done, total)
            done += 1

        tell()
        looks = [_gentle(few.blurred(rows, SEARCH[0])) for rows in few.many(points)]
        if few.failures == len(points) * len(few.runs):
            raise ReplayError("fit: none of the runs can be simulated with these constants; check straw and runs")
        ends = []
        for start in np.argsort(looks, kind="stable")[:followed]:
            at = points[start]
            for blur_s in SEARCH:
                tell()
                at = _descend(few, at, blur_s)
            ends.append((_gentle(few.blurred(few.many([at])[0], SEARCH[-1])), at))
        best = min(ends, key=lambda end: end[0])[1]
        for blur_s in FINISH:
            tell()
            best = _descend(problem, best, blur_s)
        tell()
        left = problem.many([best])[0]
        final = problem.slopes(best, FINISH[-1], INTERVAL_TOLERANCE_M)
        covariance = _covariance(problem, left, final) + _from_gauge(problem, best, final)
        tell()
    values = np.exp(best)
    size = sum(row.size for row in left)
    return Fitted(
        tuple(names),
        values,
        covariance,
        with_values(straw, names, values),
        float(sum(np.sum(row**2) for row in left) / max(1, size - len(names))),
        _rms(runs, left),
        tuple(run.run_id for run in runs),
        problem.failures + (few.failures if few is not problem else 0),
    )


def _rms(runs: Sequence[Run], left: list[Floats]) -> dict[str, float]:
    pairs = list(zip(runs, left, strict=True))
    return {
        name: float(np.sqrt(np.mean(np.concatenate([_plain(run, row, i) for run, row in pairs]) ** 2)))
        for i, name in enumerate(CHANNELS)
    }


def _plain(run: Run, row: Floats, channel: int) -> Floats:
    """Differences of a channel in its unit."""
    return np.asarray(row[channel] * sigmas(run)[channel])


def _covariance(problem: Problem, left: list[Floats], slopes: Floats) -> Floats:
    """Covariance that is valid for correlated residuals: blocks of time are treated as independent.

    (J'J)^-1 (sum over blocks of (J'r)(J'r)') (J'J)^-1, the sandwich of Liang and Zeger (1986).
    """
    bread = np.linalg.pinv(slopes.T @ slopes)
    meat = np.zeros_like(bread)
    start = blocks = 0
    for run, row in zip(problem.runs, left, strict=True):
        assert run.tip is not None
        which = ((run.tip.time_s[run.tip.valid] - run.tip.time_s[0]) / BLOCK_S).astype(int)
        per_run = slopes[start : start + row.size].reshape(*row.shape, -1)
        start += row.size
        for block in range(which.max() + 1):
            score = np.einsum("ct,ctp->p", row[:, which == block], per_run[:, which == block])
            meat += np.outer(score, score)
            blocks += 1
    share = blocks / max(1, blocks - len(bread))
    return np.asarray(bread @ meat @ bread * share)


def _from_gauge(problem: Problem, best: Floats, slopes: Floats) -> Floats:
    """Covariance from the gauge's noise: first-order change of the optimum when its noise is added once more."""
    jobs = [problem.pool.submit(problem.difference.gauge, run, best) for run in problem.runs]
    bread, changes = np.linalg.pinv(slopes.T @ slopes), []
    for run, job in zip(problem.runs, jobs, strict=True):
        found = job.result()
        problem.failures += found is None
        change = np.zeros((len(CHANNELS), samples(run), GAUGE_DRAWS)) if found is None else found
        changes.append(change.reshape(-1, GAUGE_DRAWS))
    moves = bread @ slopes.T @ np.concatenate(changes)
    return np.asarray(moves @ moves.T / GAUGE_DRAWS)
