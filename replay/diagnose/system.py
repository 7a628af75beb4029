"""The interface of a system for the diagnosis: anything that can be simulated, with derivatives or differences.

The straw is one (`systems/straw`), an oscillator another (`systems/oscillator`), a function written by a user a third
(`systems/function`). A system and its recordings travel to workers, so they can be pickled.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.recording import Channel

if TYPE_CHECKING:  # imported for types only, as these modules import this one
    from straw.replay.diagnose.campaign import Campaign
    from straw.replay.diagnose.fit import Contestant, Fit
    from straw.replay.diagnose.page.shown import Shown

Floats = NDArray[np.float64]


class Level(Enum):
    """What is compared: smooth features (slow parts, envelopes, events), or all samples."""

    COARSE = "coarse"
    FINE = "fine"


class Misfit(Protocol):
    """A recording against a simulation.

    ``vector`` (m,), in sigmas, white for a right model: all samples channel by channel, then events; ``jacobian``
    (m, unknowns), without columns unless asked for; ``plain`` (channels, n), SI, by subtraction; ``work``: its cost.
    """

    @property
    def vector(self) -> Floats:
        """Differences in sigmas, (m,)."""

    @property
    def jacobian(self) -> Floats:
        """Their derivatives by u, (m, unknowns)."""

    @property
    def plain(self) -> Floats:
        """Simulated less recorded, SI, (channels, n)."""

    @property
    def work(self) -> int:
        """How often the simulation evaluated the system's equations, without derivatives."""


@dataclass(frozen=True, eq=False)
class Differences:
    """The simplest `Misfit`."""

    vector: Floats
    jacobian: Floats
    plain: Floats
    work: int


class System(ABC):
    """A model of what was recorded; unknowns are searched as u, and u = 0 of the base's is the given model."""

    @property
    @abstractmethod
    def channels(self) -> tuple[Channel, ...]:
        """The measured channels."""

    @property
    @abstractmethod
    def base(self) -> tuple[Unknown, ...]:
        """Constants of its own that may be refitted before anything is called missing."""

    @property
    @abstractmethod
    def causes(self) -> tuple[str, ...]:
        """Names of what may be missing: laws that can be added and faults of instruments."""

    @property
    def most_work(self) -> float:
        """Evaluations of the equations after which a search ends with what it has found; without limit here."""
        return float("inf")

    @property
    def faults(self) -> frozenset[str]:
        """Those of the causes that are faults of a recording, not of the model."""
        return frozenset()

    @abstractmethod
    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        """Causes together: unknowns with priors, and starts."""

    @abstractmethod
    def misfit(
        self,
        recording: Any,
        unknowns: Sequence[Unknown],
        u: Floats,
        *,
        level: Level = Level.FINE,
        derivatives: bool = False,
    ) -> Misfit | None:
        """A recording against the system at u; None where it cannot be simulated."""

    @abstractmethod
    def size(self, recording: Any, level: Level) -> int:
        """Length of a recording's vector of differences."""

    def ready(self, recordings: Sequence[Any]) -> None:
        """Prepare recordings for this system, once, before anything is simulated."""
        return

    def propose(self, recordings: Sequence[Any], names: Sequence[str]) -> Any:
        """A proposal of starts, or None."""
        return None

    def fit_base(self, campaign: Campaign, proposed: Sequence[Floats]) -> tuple[Fit, Fit] | None:
        """The base fitted to all samples, and to the coarse comparison; None: multi-start over the priors does it."""
        return None

    def telling(self, campaign: Campaign, fit: Fit) -> list[str]:
        """Names of the few runs in which hypotheses are looked at first; by default all."""
        return [one.name for one in campaign.observations]

    def repeats(self, campaign: Campaign, fit: Fit) -> Floats | None:
        """Effect of one standard deviation of each kind of difference between repeats on the vector, (m, kinds)."""
        return None

    def repeat_steps(self, unknowns: Sequence[Unknown]) -> dict[int, float]:
        """One standard deviation between repeats as a step in u, by the index of each unknown that varies."""
        return {}

    def cannot_follow(self, recording: Any) -> str:
        """Message for a user whose recording cannot be simulated with the base's fit."""
        return f"run {recording.name}: cannot be simulated, neither with the constants given nor with those that fit"

    def named(self, unknown: Unknown) -> tuple[str, str, str]:
        """Cause, constant and unit of an unknown, as findings name them."""
        cause, _, name = unknown.target.partition(".")
        return cause, name or cause, "1"

    def equation(self, unknown: Unknown) -> tuple[str, str] | None:
        """Equation and constant of one of the base's unknowns, in words; None where it is none of its own."""
        return None

    def places(self, campaign: Campaign, fit: Fit, recording: Any) -> tuple[int, ...]:
        """Where each event of a recording happens, in order, as numbers of parts; empty where there are none."""
        return ()

    def doubts(self, recordings: Sequence[Any]) -> list[str]:
        """What these recordings leave untested, in sentences."""
        return []

    def experiment(self, campaign: Campaign, among: Sequence[Contestant], *, explain: bool) -> Any:
        """The next experiment that distinguishes hypotheses, or None."""
        return None

    def missing(self, campaign: Campaign, null: Fit, told: Any) -> Sequence[Any]:
        """The unexplained part as laws over states, what explains more first; none where there is no such search."""
        return ()

    def shown(self) -> Shown:
        """What the page shows beside its channels; by default nothing."""
        from straw.replay.diagnose.page.shown import Shown

        return Shown()

    def fitted(self, unknowns: Sequence[Unknown], u: Floats) -> Any:
        """The model with unknowns at u."""
        return {unknown.target: unknown.value(float(x)) for unknown, x in zip(unknowns, u, strict=True)}

    def simulated(self, recording: Any, unknowns: Sequence[Unknown], u: Floats) -> Floats:
        """Predicted values of the channels at the recording's times, (channels, n)."""
        one = self.misfit(recording, unknowns, u)
        return np.full_like(recording.seen, np.nan) if one is None else recording.seen + one.plain

    def written(self, model: Any) -> dict[str, str]:
        """A fitted model as text that its commands read, by the name findings give it."""
        return {}
