"""Operator: a person's orders to a run in progress, and what the run reports."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping, Sequence

from straw.rig.errors import RigError
from straw.rig.reading import Reading

ORDERS = ("hold", "resume", "stop", "vent", "state")
#: A hold that is never ended is ended by venting, so that a straw is not left under pressure unattended.
LONGEST_HOLD_S = 600.0


class StoppedError(Exception):
    """The run was ended by an order; the message says by whom, and how."""


class Operator:
    """Takes orders from any thread, which the loop carries out in its next cycle, and receives every reading and event.

    ``hold`` stops the protocol's time: the pressure stays as it is and recording continues; ``resume`` ends it.
    ``stop`` and ``vent`` end the run, and every end vents. Orders are idempotent; a vent cannot be taken back.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._ended_by = ""
        self._held_from_s: float | None = None
        self.held_s = 0.0  # total time held so far
        self._wants_hold = False
        self._said: deque[tuple[str, str]] = deque()

    def order(self, kind: str, who: str) -> str:
        """Take an order; return the resulting state: running, held, or ending. RigError for an unknown order."""
        if kind not in ORDERS:
            raise RigError(f"order {kind!r} is unknown; known: {', '.join(ORDERS)}")
        with self._lock:
            if kind in ("stop", "vent") and not self._ended_by:
                self._ended_by = f"{'vented' if kind == 'vent' else 'stopped'} by {who or 'somebody'}"
            if kind in ("hold", "resume") and self._wants_hold != (kind == "hold"):
                self._wants_hold = kind == "hold"
                self._said.append((kind, f"by {who or 'somebody'}"))
            return self.state

    @property
    def state(self) -> str:
        """running, held or ending."""
        return "ending" if self._ended_by else "held" if self._wants_hold else "running"

    def protocol_s(self, now_s: float) -> float:
        """The protocol's time (s) at a time since the start: it stands still while held. StoppedError at an end."""
        if self._wants_hold and self._held_from_s is None:
            self._held_from_s = now_s
        elif not self._wants_hold and self._held_from_s is not None:
            self.held_s += now_s - self._held_from_s
            self._held_from_s = None
        if self._held_from_s is not None and now_s - self._held_from_s > LONGEST_HOLD_S:
            self._ended_by = self._ended_by or f"vented after {LONGEST_HOLD_S:g} s of being held"
        self.check()
        return (now_s if self._held_from_s is None else self._held_from_s) - self.held_s

    def check(self) -> None:
        """Raise StoppedError when an order ended the run."""
        if self._ended_by:
            raise StoppedError(self._ended_by)

    def said(self) -> list[tuple[str, str]]:
        """Orders since the last time as (kind, text), for the record."""
        found = []
        while self._said:
            found.append(self._said.popleft())
        return found

    def heard(self, now_s: float, readings: Sequence[Reading], told_pa: Mapping[int, float]) -> None:
        """The readings of a cycle (s since the start), and the command of each channel (Pa)."""

    def happened(self, now_s: float, kind: str, text: str) -> None:
        """An event of the run."""
