"""Control: which of the people who look at a rig may move it; the others watch, and may always vent."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

from straw.rig.errors import RigError

#: Whoever is asked for control and does not answer for so long has gone home.
ANSWER_S = 20.0
#: Whose page has been closed for so long is not in control any more; a reload is quicker.
AWAY_S = 5.0


@dataclass
class Person:
    """One page: the name its user gave, and when it was last heard."""

    name: str
    heard_s: float = field(default_factory=lambda: time.monotonic())


class Control:
    """One page is in control at most. It is taken when free, asked for when not, and given or kept."""

    def __init__(self) -> None:
        self.people: dict[str, Person] = {}
        self._holder = ""
        self._asker, self._asked_s = "", 0.0

    def heard(self, who: str, name: str) -> None:
        """A page is there, under this name."""
        self.people[who] = Person(" ".join(name.split())[:40] or "somebody")
        for other in [w for w, p in self.people.items() if time.monotonic() - p.heard_s > AWAY_S]:
            del self.people[other]

    @property
    def holder(self) -> str:
        """The page in control; empty when there is none."""
        if self._holder not in self.people or time.monotonic() - self.people[self._holder].heard_s > AWAY_S:
            self._holder = ""
        if self._asker and self._holder and time.monotonic() - self._asked_s > ANSWER_S:
            self._holder, self._asker = self._asker, ""
        return self._holder

    def take(self, who: str) -> None:
        """Take control when it is free; else ask whoever has it."""
        if who not in self.people:
            raise RigError("this page is not connected; reload it")
        if self.holder in ("", who):
            self._holder, self._asker = who, ""
        else:
            self._asker, self._asked_s = who, time.monotonic()

    def give(self, who: str, keep: bool = False) -> None:
        """Whoever is in control gives it to the one who asks, or to nobody; or keeps it."""
        if self.holder != who:
            return
        if not keep:
            self._holder = self._asker if self._asker in self.people else ""
        self._asker = ""

    def check(self, who: str) -> str:
        """The name of a page that is in control, which it is from now on if nobody was; RigError for any other."""
        if not self.holder:
            self.take(who)
        if self.holder != who:
            raise RigError(f"{self.name(self.holder)} is in control; ask for it, or vent, which everybody may")
        return self.name(who)

    def name(self, who: str) -> str:
        """What a page's user is called."""
        person = self.people.get(who)
        return person.name if person else "somebody"

    def as_data(self, who: str) -> dict[str, Any]:
        """Who is in control and who asks, as seen by one page."""
        holder, asker = self.holder, self._asker
        left_s = max(0.0, ANSWER_S - (time.monotonic() - self._asked_s))
        return {
            "mine": bool(holder) and holder == who,
            "holder": self.name(holder) if holder else "",
            "asker": self.name(asker) if asker else "",
            "asking": asker == who and bool(asker),
            "answer_s": round(left_s) if asker else None,
            "watching": len(self.people),
        }
