"""Recordings of a user's system one after the other, so that a campaign is simulated by one compiled call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign, Point
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.settings import FAILED_SIGMAS
from straw.replay.diagnose.system import System
from straw.replay.diagnose.systems.function.encoding import Encoding
from straw.replay.diagnose.systems.function.plain import plain_march
from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.shots import profiled
from straw.replay.diagnose.systems.function.varied import varied

if TYPE_CHECKING:  # for types only, as it imports this module
    from straw.replay.diagnose.systems.function.system import FunctionSystem

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Stack:
    """Recordings one after the other: times (N,), inputs (rows, N), channels (channels, N), whether samples are fitted
    or may tell a start (N,), where recordings end, and their starts with scales and bounds.

    ``o`` (recordings, free) are the last starts with fresh columns (M, free), from which the next ones begin; no
    columns (0, 0) where none are known.
    """

    t: Floats
    inputs: Floats
    seen: Floats
    fitted: NDArray[np.bool_]
    tells: NDArray[np.bool_]
    ends: NDArray[np.int64]
    starts: Floats
    scales: Floats
    free: NDArray[np.int64]
    low: Floats
    high: Floats
    o: Floats
    columns: Floats

    def profiled(
        self, system: FunctionSystem, given: Encoding, at: tuple[Floats, Floats], *, fresh: bool
    ) -> tuple[Floats, Floats, Stack]:
        """Channels (channels, N) from the best starts, these (recordings, states), and the stack with them as its last
        ones."""
        c, p = at
        if system.model.plain:
            parts = [slice(a, b) for a, b in zip(self.ends[:-1], self.ends[1:], strict=True)]
            ys = [plain_march(system.model, self.t[k], self.inputs[:, k], c, given.rows, p) for k in parts]
            return np.concatenate(ys, axis=1), self.starts, self
        size = self.seen.size + len(self.ends) - 1
        fresh = fresh or not self.columns.size
        columns = self.columns.copy() if self.columns.size else np.zeros((size, len(self.free)))
        o = self.o.copy()
        ys, starts = profiled()(
            *system.model.functions, self.t, self.inputs, self.seen, self.tells, self.ends, self.sigma(system),
            self.starts, self.scales, self.free, self.low, self.high, c, given.rows, p, given.lags, system.longest_s,
            o, columns, fresh,
        )  # fmt: skip
        return ys, starts, replace(self, o=o, columns=columns)

    def varied(self, system: FunctionSystem, given: Encoding, u: Floats, ys: Floats, starts: Floats) -> Floats:
        """Derivatives (M, unknowns) in sigmas at u from one-sided differences, where the channels are ``ys``; starts
        stay, and what their columns can do is left out."""
        by, cs, ps = given.around(u)
        if system.model.plain:
            out = np.zeros((self.seen.size + len(self.ends) - 1, len(u)))
            for k in np.flatnonzero(by):
                moved, _, _ = self.profiled(system, given, (cs[k], ps[k]), fresh=False)
                out[:, k] = self.rows((moved - ys) / by[k] / self.sigma(system)[:, None])
            return out
        own = self.columns if self.columns.size else np.zeros((self.seen.size + len(self.ends) - 1, 0))
        return np.asarray(
            varied()(
                *system.model.functions, self.t, self.inputs, self.seen, self.fitted, self.ends, self.sigma(system),
                starts, cs, given.rows, ps, given.lags, system.longest_s, ys, own, by,
            )
        )  # fmt: skip

    def differences(self, system: FunctionSystem, ys: Floats) -> Floats:
        """Residuals (M,) in sigmas where samples are fitted; a recording that diverged has large ones."""
        off = (ys - self.seen) / self.sigma(system)[:, None]
        for a, b in zip(self.ends[:-1], self.ends[1:], strict=True):
            if not np.isfinite(ys[:, a:b]).all():
                off[:, a:b] = FAILED_SIGMAS
        return self.rows(off)

    def rows(self, off: Floats) -> Floats:
        """Values by channel (channels, N), zero where nothing is fitted, as a campaign's vector (M,)."""
        counted = np.where(self.fitted & np.isfinite(self.seen), off, 0.0)
        parts = zip(self.ends[:-1], self.ends[1:], strict=True)
        return np.concatenate([np.append(counted[:, a:b].ravel(), 0.0) for a, b in parts])

    @staticmethod
    def sigma(system: FunctionSystem) -> Floats:
        """Of the channels, (channels,)."""
        return np.array(system.sigma)


def stacked(system: FunctionSystem, recordings: Sequence[Recorded]) -> Stack:
    """Recordings as a system takes them."""
    begun = [system.started(one) for one in recordings]
    starts, scales = (np.array([pair[k] for pair in begun]).reshape(len(recordings), -1) for k in (0, 1))
    free = np.array(system.free_starts(), dtype=np.int64)
    names = [y.name for y in system.model.channels]
    channels = [system.model.starts[i].channel for i in free]
    # near a channel's first readings, if these are the recording's first
    begins = [
        [c is not None and bool(np.isfinite(o.seen[names.index(c), :3]).any()) for c in channels] for o in recordings
    ]
    within = np.where(np.reshape(begins, (len(recordings), len(free))), system.reach * scales[:, free], np.inf)
    low, high = (np.array([getattr(system.model.starts[i], end) for i in free]) for end in ("low", "high"))

    def joined(parts: list[Any]) -> Any:
        return np.ascontiguousarray(np.concatenate(parts, axis=-1))

    return Stack(
        joined([one.time_s for one in recordings]),
        joined([one.inputs for one in recordings]),
        joined([one.seen for one in recordings]),
        joined([one.fitted for one in recordings]),
        joined([one.tells_start for one in recordings]),
        np.cumsum([0, *(len(one.time_s) for one in recordings)]),
        starts,
        scales,
        free,
        np.ascontiguousarray(np.maximum(low, starts[:, free] - within)),
        np.ascontiguousarray(np.minimum(high, starts[:, free] + within)),
        np.zeros((len(recordings), len(free))),
        np.zeros((0, 0)),
    )


class Stacked(Campaign):
    """A campaign whose recordings are simulated together; jobs of a pool are whole campaigns."""

    stack: Stack | None = None
    #: Recordings that are to be predicted, without readings but those that tell their starts.
    ahead: tuple[Recorded, ...] = ()

    def with_system(self, system: System) -> Stacked:
        """The campaign with another system to start from, beginning at the same starts."""
        out = Stacked(self.observations, system, self.pool, self.stop, self.level)
        out.tally, out.ahead = self.tally, self.ahead
        out.stack = replace(self.stack, columns=np.zeros((0, 0))) if self.stack else None
        return out

    def at(self, points: Sequence[Point]) -> list[tuple[Floats, Floats]]:
        """Residuals (m,) of all runs in sigmas and Jacobian (m, unknowns) at each point; runs that diverge get large
        residuals."""
        return [self._at(*point) for point in points]

    def _at(self, unknowns: Sequence[Unknown], u: Floats, derivatives: bool) -> tuple[Floats, Floats]:
        system: Any = self.system
        stack = self.stack or stacked(system, self.observations)  # type: ignore[arg-type]
        given = system.encoding(unknowns)
        ys, starts, known = stack.profiled(system, given, given.at(u), fresh=derivatives)
        residual = stack.differences(system, ys)
        self.tally["played"] += len(self.observations)
        if not derivatives:
            self.stack = stack
            return residual, np.zeros((len(residual), 0))
        self.stack = known if np.isfinite(ys).all() else stack
        slopes = known.varied(system, given, u, ys, starts)
        return residual, np.where(np.isfinite(slopes), slopes, 0.0)
