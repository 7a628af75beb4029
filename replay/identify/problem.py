"""The differences between recordings and simulations as a function of constants, blurred in time, and their slopes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from straw.model.parameters import StrawParameters
from straw.replay.compare.comparison import CHANNELS
from straw.replay.identify.difference import SEARCH_TOLERANCE_M, Difference
from straw.rig.run import Run

Floats = NDArray[np.float64]

#: Simulations that fail count as this many sigmas everywhere.
FAILED_SIGMAS = 1e3


class Problem:
    """Weighted differences of all runs as a function of the constants' logarithms."""

    def __init__(self, runs: Sequence[Run], straw: StrawParameters, names: Sequence[str], pool: Executor) -> None:
        self.runs, self.pool, self.difference = list(runs), pool, Difference(straw, tuple(names))
        self.failures = 0

    def many(self, points: Sequence[Floats]) -> list[list[Floats]]:
        """Differences of every run at every point, spread over the pool."""
        jobs = [[self.pool.submit(self.difference.at, run, point) for run in self.runs] for point in points]
        out = []
        for row in jobs:
            found = [job.result() for job in row]
            self.failures += sum(one is None for one in found)
            out.append(
                [
                    np.full((len(CHANNELS), samples(run)), FAILED_SIGMAS) if one is None else one
                    for run, one in zip(self.runs, found, strict=True)
                ]
            )
        return out

    def slopes(self, at: Floats, blur_s: float, tolerance_m: float = SEARCH_TOLERANCE_M) -> Floats:
        """Derivatives of the blurred differences by the logarithms, (all samples, constants)."""
        jobs = [self.pool.submit(self.difference.slope, run, at, tolerance_m) for run in self.runs]
        found = [job.result() for job in jobs]
        self.failures += sum(one is None for one in found)
        rows = [
            np.zeros((len(CHANNELS), samples(run), len(at))) if one is None else one
            for run, one in zip(self.runs, found, strict=True)
        ]
        return np.stack([self.blurred([row[..., k] for row in rows], blur_s) for k in range(len(at))], axis=1)

    def blurred(self, rows: list[Floats], blur_s: float) -> Floats:
        """Differences of all runs as one vector, blurred in time."""
        parts = []
        for run, row in zip(self.runs, rows, strict=True):
            assert run.tip is not None
            step_s = float(np.median(np.diff(run.tip.time_s)))
            parts.append((gaussian_filter1d(row, blur_s / step_s, axis=1) if blur_s else row).ravel())
        return np.concatenate(parts)


def samples(run: Run) -> int:
    """Number of valid samples of the tip."""
    assert run.tip is not None
    return int(np.count_nonzero(run.tip.valid))


@contextmanager
def pool_of(executor: Executor | None) -> Iterator[Executor]:
    """The given executor, or threads of its own until the end of the block."""
    if executor is not None:
        yield executor
        return
    with ThreadPoolExecutor() as own:  # the compiled model releases the GIL
        yield own
