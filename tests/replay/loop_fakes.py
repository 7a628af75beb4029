"""Fakes for the closed loop: scripted experiments, findings and crashes of the process; and a loop run on them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from straw.replay.investigate.budget import Budget
from straw.replay.investigate.log import Log
from straw.replay.investigate.loop import Loop
from straw.replay.investigate.steps import Ahead, Found, Plan, Proposal, Ran
from straw.replay.investigate.stop import WHOLE_CAMPAIGN, Stop
from straw.rig.errors import RigError

UNSURE = {"cohesion": 0.5, "squeeze_film": 0.4, "complete": 0.1}
SURE = {"cohesion": 0.9, "cohesion+clock_offset": 0.06, "squeeze_film": 0.04}


def offered(
    name: str, nats: float = 0.5, minutes: float = 0.1, snaps: int = 3, chances: tuple[float, ...] = (0.9,)
) -> Proposal:
    return Proposal(f'name = "{name}"', (1, 4), name, nats, 9.0, minutes, snaps, chances=chances)


class Crash(BaseException):
    """Stands for the death of the process."""


class Fakes:
    """The steps of a loop, in memory, which outlive its crashes. After ``named_after`` runs the cause is certain, which
    rests on so many runs that were ``recorded_before``.
    ``crash`` names a step: the next time it is taken the process dies, before it is done or, with ``late``, after."""

    def __init__(self, named_after: int = 2, menu: Sequence[Proposal] = ()) -> None:
        self.named_after = named_after
        self.menu = list(menu) or [offered("a", 0.6), offered("b", 0.5), offered("c", 0.4)]
        self.sure = Found("missing_physics", ("cohesion",), SURE, "cohesion is missing")
        self.unsure = [Found("ambiguous", ("cohesion",), UNSURE, "not told")]  # the last one is repeated
        self.answer, self.forbidden, self.tracks, self.hand = "somebody", set[str](), True, ""
        self.recorded_before = WHOLE_CAMPAIGN
        self.ended: dict[str, Ran] = {}
        self.status, self.error = "success", ""
        self.crash, self.late, self.dead = "", False, False
        self.ran: list[str] = []
        self.asked = self.diagnosed = self.searched = 0
        self.ahead: list[Ahead] = []

    def _dies(self, step: str, late: bool) -> None:
        if (step, late) == (self.crash, self.late):
            self.crash, self.dead = "", True
            raise Crash

    def recordings(self) -> tuple[str, ...]:
        return tuple(sorted(ran.sha256 for ran in self.ended.values() if ran.well))

    def diagnose(self) -> Found:
        self._dies("diagnose", False)
        self.diagnosed += 1
        runs = self.recordings()
        unsure = self.unsure[min(len(runs), len(self.unsure) - 1)]
        found = self.sure if len(runs) >= self.named_after else unsure
        return replace(found, recordings=runs, runs=self.recorded_before + len(runs))

    def propose(self, found: Found) -> Sequence[Proposal]:
        self._dies("propose", False)
        return self.menu

    def dry_run(self, proposal: Proposal, left: Sequence[int] | None) -> Plan:
        self._dies("dry_run", False)
        if proposal.why in self.forbidden:
            raise RigError(f"{proposal.why} is beyond the limit")
        return Plan(proposal.minutes, proposal.snaps, "", self.hand, (1,))

    def unknown(self, found: Found) -> str:
        self.searched += 1
        return "It pulls at cell 4."

    def ask(self, proposal: Proposal, plan: Plan, ahead: Ahead) -> str:
        self._dies("ask", False)
        self.asked += 1
        self.ahead.append(ahead)
        return self.answer

    def recording_of(self, proposal: Proposal, number: int) -> str:
        return f"{len(self.ended)}-{proposal.why}.mcap"

    def run(self, proposal: Proposal, recording: str) -> None:
        self._dies("run", False)
        self.ended[recording] = Ran("cut", recording, minutes=0.05)
        if self.error:
            raise RigError(self.error)
        if (self.crash, self.late) != ("run", True):
            self.ended[recording] = Ran(self.status, recording, recording, proposal.minutes, proposal.snaps)
            self.ran.append(proposal.why.rpartition("; ")[2])
        self._dies("run", True)

    def after(self, recording: str) -> Ran:
        self._dies("after", False)
        return self.ended.get(recording, Ran("none", recording))

    def track(self, recording: str) -> bool:
        self._dies("track", False)
        return self.tracks


class CrashingLog(Log):
    """A log that refuses to write once the process is dead; ``until`` is the line after which the process dies."""

    fakes: Fakes
    until = 10**9

    def write(self, kind: str, **said: Any) -> dict[str, Any]:
        if self.fakes.dead:
            raise Crash
        written = super().write(kind, **said)
        self.until -= 1
        if self.until == 0:
            self.fakes.dead = True
            raise Crash
        return written


def went(
    path: Path,
    fakes: Fakes,
    budget: Budget | None = None,
    certainty: float = 0.9,
    yes: int = 0,
    until: int = 10**9,
) -> Stop:
    fakes.dead = False
    with CrashingLog(path) as log:
        log.fakes, log.until = fakes, until
        return Loop(log, fakes, budget or Budget(), certainty, yes).run()


def lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]
