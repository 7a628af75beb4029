"""State: where a loop stands, from its log alone, so that the same command continues after a crash."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

from straw.replay.investigate.budget import Spent
from straw.replay.investigate.log import Line
from straw.replay.investigate.steps import Found, Plan, Proposal, Ran

T = TypeVar("T", Found, Plan, Proposal, Ran)


@dataclass
class State:
    """The state after the lines of a log."""

    spent: Spent = field(default_factory=Spent)
    run_before: dict[str, int] = field(default_factory=dict)  # runs that went well, by the proposal's key
    found: Found | None = None  # the last diagnosis, if nothing was run after it
    history: list[Found] = field(default_factory=list)  # the last diagnosis of each set of recordings, oldest first
    proposal: Proposal | None = None  # what was proposed and not run yet
    plan: Plan | None = None
    recording: str = ""  # of a run that was started and of which no end is known
    tracked: bool = True  # whether the last run that went well has its track
    last: Ran | None = None
    ends: tuple[int, ...] | None = None  # cells deployed after the last run, None where that is not known

    @classmethod
    def of(cls, lines: Sequence[Line]) -> State:
        """The state after these lines; lines of an unknown kind are ignored."""
        state = cls()
        for line in lines:
            state.take(line)
        return state

    @property
    def number(self) -> int:
        """Number of the present or next round, from 1."""
        return self.spent.rounds + 1

    def take(self, line: Line) -> None:
        """One more line."""
        kind = line["kind"]
        if kind == "diagnosed":
            self.found, self.proposal, self.plan = restored(Found, line), None, None
            self.history = [one for one in self.history if one.recordings != self.found.recordings] + [self.found]
        elif kind == "proposed":
            self.proposal, self.plan = restored(Proposal, line["proposal"]), restored(Plan, line["plan"])
        elif kind == "started":
            self.recording = line["recording"]
        elif kind == "ran":
            self._ran(restored(Ran, line))
        elif kind == "round":
            self.tracked = True

    def _ran(self, ran: Ran) -> None:
        if ran.status != "none":
            expected = self.plan.snaps if self.plan is not None else 0
            self.spent = self.spent.and_also(ran.minutes, expected if ran.snaps is None else ran.snaps)
        if self.proposal is not None and ran.well:
            key = self.proposal.key
            self.run_before[key] = self.run_before.get(key, 0) + 1
        self.ends = self.plan.ends if self.plan is not None and ran.well else None
        self.found = self.proposal = self.plan = None
        self.recording, self.tracked, self.last = "", not ran.well, ran


def restored(kind: type[T], line: dict[str, Any]) -> T:
    """One of the loop's objects from JSON; fields of a newer version are ignored."""
    names = {one.name for one in fields(kind)}
    given: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value for key, value in line.items() if key in names
    }
    return kind(**given)
