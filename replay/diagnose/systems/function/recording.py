"""A recording of a user's system: inputs and their rates, channels, noise, held-out samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.recording import Stretch

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class HeldOut:
    """How what is held out lies beside what is fitted: whole ``recordings``, ``after``, or ``between``; and the number
    of ``blocks`` as long as its stretches that what is fitted has."""

    lies: str = "between"
    blocks: int = 60


@dataclass(frozen=True, eq=False)
class Recorded:
    """One run: channels ``seen`` (channels, n), NaN where there is none, at ``time_s`` (n,) from its first reading.

    ``inputs`` (2 inputs, n) are the inputs and their rates; ``noise`` (channels,); ``fitted`` (n,) marks the samples
    that are not held out, ``tells_start`` (n,) those from which starts may be estimated. What lies before ``skip_s`` is
    neither fitted nor held out. ``asked``: how what was taken away from it as held out lies. ``left_out``: readings of
    each channel that were left out as spikes.
    """

    name: str
    time_s: Floats
    seen: Floats
    inputs: Floats
    noise: Floats
    fitted: Flags
    tells_start: Flags
    conditions_: Mapping[str, float] = field(default_factory=dict)
    skip_s: float = 0.0
    asked: HeldOut = HeldOut()
    left_out: tuple[int, ...] = ()

    @property
    def events_s(self) -> Floats:
        """No events."""
        return np.empty(0)

    @property
    def kind(self) -> str:
        """Every recording is of its own kind."""
        return self.name

    @property
    def held(self) -> Flags:
        """Held-out samples, (n,)."""
        return ~self.fitted & ~np.isnan(self.seen).all(axis=0) & (self.time_s >= self.skip_s)

    def without_held(self) -> Recorded:
        """The recording as a search sees it: no reading where it is held out."""
        return replace(self, seen=np.where(self.held, np.nan, self.seen))

    def sigma(self) -> Floats:
        """Noise, (channels, n)."""
        return np.repeat(self.noise[:, None], len(self.time_s), axis=1)

    def floor(self) -> Floats:
        """Noise, (channels, n)."""
        return self.sigma()

    def stretches(self) -> list[Stretch]:
        """Eighths of the recording, as its events are unknown."""
        ends = np.linspace(self.time_s[0], self.time_s[-1], 9)
        words = [f"{k} of 8" for k in range(1, 9)]
        return [Stretch(f"part {w}", float(a), float(b)) for w, a, b in zip(words, ends[:-1], ends[1:], strict=True)]

    def every(self, step: int) -> Recorded:
        """Evenly thinned samples."""
        return self._cut(slice(None, None, step))

    def until(self, many: int) -> Recorded:
        """Its first samples."""
        return self._cut(slice(None, many))

    def _cut(self, cut: slice) -> Recorded:
        return replace(
            self,
            time_s=self.time_s[cut],
            seen=self.seen[:, cut],
            inputs=self.inputs[:, cut],
            fitted=self.fitted[cut],
            tells_start=self.tells_start[cut],
        )

    def conditions(self) -> Mapping[str, float]:
        """Means and sizes of its inputs."""
        return self.conditions_
