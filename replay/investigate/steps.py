"""The loop's data (findings, proposals, plans, runs) and the interface of the steps it calls."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class Found:
    """Result of a diagnosis of ``runs`` runs. ``recordings``: SHA-256 of its files; ``probability`` by hypothesis.

    ``untried``: nothing seems to be missing, but the largest pressures within the limits have not been run yet.
    """

    verdict: str
    causes: tuple[str, ...] = ()
    probability: Mapping[str, float] | None = None
    says: str = ""
    recordings: tuple[str, ...] = ()
    untried: bool = False
    runs: int = 0


@dataclass(frozen=True)
class Proposal:
    """An experiment: its protocol as TOML, its reason, its expected information and cost.

    ``information_nats`` is expected over the hypotheses' probabilities; ``separation_sigma`` is that of the pair that
    it separates best; ``chances``: the probabilities that after 1, 2, ... runs of it an answer is certain enough.
    ``run_before`` counts existing recordings of the same protocol; an ``opening`` is run whatever it is expected to
    tell.
    """

    protocol: str
    initial_deployed: tuple[int, ...]
    why: str
    information_nats: float
    separation_sigma: float
    minutes: float
    snaps: int
    run_before: int = 0
    opening: bool = False
    chances: tuple[float, ...] = ()

    @property
    def key(self) -> str:
        """The same for the same protocol."""
        return hashlib.sha256(self.protocol.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Ahead:
    """Round ``number``: ``before`` runs of the same protocol are there, so many ``runs`` alike are expected to be
    needed."""

    number: int
    before: int
    runs: int


@dataclass(frozen=True)
class Plan:
    """A dry run: the protocol's demands and its prediction. ``hand``: what must be done by hand first, or empty.
    ``ends`` are the cells that are deployed after it, None where that is not known. ``predicted`` are columns to draw:
    time_s from the main part, pressure_pa, x_m, z_m, phi_rad."""

    minutes: float
    snaps: int
    says: str
    hand: str = ""
    ends: tuple[int, ...] | None = None
    predicted: Mapping[str, Sequence[float]] | None = None


@dataclass(frozen=True)
class Ran:
    """How a run went: ``success``, ``abort``, ``fail``, ``cut`` where the process died, ``none`` where it never began;
    ``reason`` in words."""

    status: str
    recording: str
    sha256: str = ""
    minutes: float = 0.0
    snaps: int | None = None  # where they were not counted, as many as expected
    reason: str = ""

    @property
    def well(self) -> bool:
        """Whether it can be diagnosed."""
        return self.status == "success"


class Steps(Protocol):
    """The steps that the loop calls. User errors (USER_ERRORS) pass through and end the command with 2."""

    def recordings(self) -> tuple[str, ...]:
        """SHA-256 of the recordings of a diagnosis."""

    def diagnose(self) -> Found:
        """Diagnose the recordings; verdict ``too_few`` where there are not enough."""

    def propose(self, found: Found) -> Sequence[Proposal]:
        """Experiments that might be run after `diagnose` found this, those that were run before included."""

    def dry_run(self, proposal: Proposal, left: Sequence[int] | None) -> Plan:
        """The dry run; ``left``: cells that the previous run left deployed. RigError where a limit forbids it."""

    def ask(self, proposal: Proposal, plan: Plan, ahead: Ahead) -> str:
        """Who approves; empty for no."""

    def unknown(self, found: Found) -> str:
        """Search for an unknown law, for minutes; the result in words."""

    def run(self, proposal: Proposal, recording: str) -> None:
        """Drive and record it; RigError where that fails. It has vented in any case."""

    def recording_of(self, proposal: Proposal, number: int) -> str:
        """The name that the recording will have, known before anything moves."""

    def after(self, recording: str) -> Ran:
        """The outcome of a run by its files, also where the process died meanwhile."""

    def track(self, recording: str) -> bool:
        """Whether the run has a track, which is made where it can be."""
