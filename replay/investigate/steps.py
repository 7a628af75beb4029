"""What the loop is told and whom it asks: findings, proposals, plans, runs, and the steps that somebody else takes."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class Found:
    """What a diagnosis says. ``recordings`` are the SHA-256 of what it looked at, ``probability`` by hypothesis."""

    verdict: str
    causes: tuple[str, ...] = ()
    probability: Mapping[str, float] | None = None
    says: str = ""
    recordings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Proposal:
    """An experiment: its protocol as TOML, why, and what it is expected to tell and to cost.

    ``information_nats`` is expected over the hypotheses' probabilities; ``separation_sigma`` is that of the pair that
    it tells apart best; ``chances`` are those that after 1, 2, ... runs of it something is as certain as was asked for.
    ``run_before`` counts recordings of the same protocol that are there; an ``opening`` is run because nothing is known
    yet.
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
    """A dry run: what the protocol asks for and what the model says it will do. ``hand`` says what somebody has to do
    first; empty where nothing has to be done by hand. ``ends`` are the cells that are deployed after it, None where
    that is not known. ``predicted`` are columns to draw: time_s from the main part, pressure_pa, x_m, z_m, phi_rad."""

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
    snaps: int | None = None  # where nobody counted them, as many as were expected
    reason: str = ""

    @property
    def well(self) -> bool:
        """Whether it can be diagnosed."""
        return self.status == "success"


class Steps(Protocol):
    """What the loop has others do. Errors of the user's (USER_ERRORS) pass through and end the command with 2."""

    def recordings(self) -> tuple[str, ...]:
        """SHA-256 of what a diagnosis would look at."""

    def diagnose(self) -> Found:
        """What the recordings say; verdict ``too_few`` where there are not enough to say anything."""

    def propose(self, found: Found) -> Sequence[Proposal]:
        """Experiments that might be run after `diagnose` found this, those that were run before included."""

    def dry_run(self, proposal: Proposal, left: Sequence[int] | None) -> Plan:
        """What it will do; ``left``: cells that the run before it left deployed. RigError where a limit forbids it."""

    def ask(self, proposal: Proposal, plan: Plan, ahead: Ahead) -> str:
        """Who says yes; empty for no."""

    def unknown(self, found: Found) -> str:
        """What can be said of what no hypothesis explains, in words; a search of minutes."""

    def run(self, proposal: Proposal, recording: str) -> None:
        """Drive and record it; RigError where that fails. Every way out has vented."""

    def recording_of(self, proposal: Proposal, number: int) -> str:
        """The name that the recording will have, known before anything moves."""

    def after(self, recording: str) -> Ran:
        """What the files say of a run: how it went, or what became of it where the process died meanwhile."""

    def track(self, recording: str) -> bool:
        """Whether the run has a track, which is made where it can be."""
