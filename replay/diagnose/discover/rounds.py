"""The rounds of a discovery: what each chose, what else was fitted, and what the held-out readings refuse."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.discover.screen import Candidate
from straw.replay.diagnose.discover.trial import Trial
from straw.replay.diagnose.systems.function.recording import Recorded

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Step:
    """One round: the trial chosen, if any; all fitted ones, the best first; those not distinguishable from it.

    ``same`` are the chosen law in other places, ``forms`` names of other shapes that it may have, ``errors``
    (1 + alike, blocks) those of accepted and alike on the search's samples.
    """

    accepted: Trial | None
    fitted: tuple[Trial, ...]
    alike: tuple[Trial, ...]
    promised: tuple[Candidate, ...]
    same: tuple[Trial, ...] = ()
    forms: tuple[str, ...] = ()
    errors: Floats = field(default_factory=lambda: np.zeros((1, 1)))


@dataclass(frozen=True, eq=False)
class Discovery:
    """The base's trial and the rounds; ``asked``: held-out RMS (channels,) of the base, then of each chosen trial.

    ``searched`` are the recordings without their held-out readings, which nothing saw before; ``refused`` how many of
    the last chosen trials they refuse.
    """

    base: Trial
    steps: tuple[Step, ...]
    noise: Floats
    asked: tuple[Floats, ...]
    searched: tuple[Recorded, ...]
    refused: int = 0
    whole: bool = True

    @property
    def chosen(self) -> list[Trial]:
        """Trials chosen, in order, whether accepted or refused."""
        return [step.accepted for step in self.steps if step.accepted]

    @property
    def accepted(self) -> list[Trial]:
        """Trials accepted, in order."""
        return self.chosen[: len(self.chosen) - self.refused]

    @property
    def best(self) -> Trial:
        """The last accepted, or the base's."""
        return ([self.base, *self.accepted])[-1]

    @property
    def held(self) -> tuple[Floats, ...]:
        """Held-out RMS (channels,) of the base, then of each accepted trial."""
        return self.asked[: len(self.accepted) + 1]
