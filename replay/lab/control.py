"""Control: which page may operate the rig; the others watch, and may always vent."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

from straw.rig.errors import RigError

#: Control passes to the requesting page if the holder does not answer within this time.
ANSWER_S = 20.0
#: A page that was closed for so long loses control; a reload is quicker.
AWAY_S = 5.0


@dataclass
class Person:
    """One page: its user's name, and when it last connected."""

    name: str
    heard_s: float = field(default_factory=lambda: time.monotonic())


class Control:
    """At most one page is in control. Control is taken when free, otherwise requested, and then given or kept."""

    def __init__(self) -> None:
        self.people: dict[str, Person] = {}
        self._holder = ""
        self._asker, self._asked_s = "", 0.0

    def heard(self, who: str, name: str) -> None:
        """Register a page under a name."""
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
        """Take control when it is free; otherwise request it from its holder."""
        if who not in self.people:
            raise RigError("this page is not connected; reload it")
        if self.holder in ("", who):
            self._holder, self._asker = who, ""
        else:
            self._asker, self._asked_s = who, time.monotonic()

    def give(self, who: str, keep: bool = False) -> None:
        """The holder gives control to the requesting page, releases it, or keeps it."""
        if self.holder != who:
            return
        if not keep:
            self._holder = self._asker if self._asker in self.people else ""
        self._asker = ""

    def check(self, who: str) -> str:
        """The name of the page in control, which the given page becomes if there was none; RigError for any other."""
        if not self.holder:
            self.take(who)
        if self.holder != who:
            raise RigError(f"{self.name(self.holder)} is in control; request control, or vent, which everybody may")
        return self.name(who)

    def name(self, who: str) -> str:
        """The name of a page's user."""
        person = self.people.get(who)
        return person.name if person else "somebody"

    def as_data(self, who: str) -> dict[str, Any]:
        """Who is in control and who requests it, for one page."""
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
