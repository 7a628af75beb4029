"""Queue: protocols that wait for the rig, with repeats and pauses; stored in a file that survives a restart."""

from __future__ import annotations

import json
import secrets
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError
from straw.rig.protocol_toml import protocol_from_toml

MOST = 500
NOT_STARTED = "not started"


@dataclass
class Item:
    """One protocol, ``repeats`` times with ``pause_s`` before each but the first; ``done`` of them so far.

    ``by_hand``: the cells are set by hand before each, so each waits for a start.
    """

    id: str
    name: str
    toml: str
    specimen: str = ""
    repeats: int = 1
    pause_s: float = 0.0
    by_hand: bool = False
    done: int = 0
    said: str = ""


class Queue:
    """Items in order. ``held`` says why nothing starts; only a person can release it."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.items: list[Item] = []
        self.held = NOT_STARTED
        self.not_before_s = 0.0
        self._load()

    def add(self, toml: str, specimen: str, repeats: int, pause_s: float, by_hand: bool = False) -> Item:
        """Append a protocol; RigError with its place where it is none."""
        protocol = protocol_from_toml(toml, "protocol")
        if not 1 <= repeats <= 1000 or not 0.0 <= pause_s <= 86_400.0:
            raise RigError(f"repeats = {repeats}, pause = {pause_s:g} s: expected 1..1000 times and at most a day")
        if len(self.items) >= MOST:
            raise RigError(f"the queue holds {MOST} protocols already; let it run, or remove some")
        name = " ".join(protocol.name.split())[:60]
        item = Item(secrets.token_hex(4), name, toml, specimen or protocol.specimen, repeats, pause_s, by_hand)
        self.items.append(item)
        self._save()
        return item

    def remove(self, item_id: str) -> None:
        """Take an item out."""
        self.items = [item for item in self.items if item.id != item_id]
        self._save()

    def move(self, item_id: str, by: int) -> None:
        """Move an item up (-1) or down (+1)."""
        at = next((k for k, item in enumerate(self.items) if item.id == item_id), None)
        if at is None:
            raise RigError("that protocol is no longer in the queue")
        item = self.items.pop(at)
        self.items.insert(max(0, at + by), item)
        self._save()

    def hold(self, why: str) -> None:
        """Hold the queue until a person releases it."""
        self.held = why
        self._save()

    def release(self) -> None:
        """Resume it."""
        self.held = ""
        self._save()

    def ended(self, item_id: str, well: bool, said: str) -> None:
        """A run of an item ended: if well, it is counted; otherwise the item stays and the queue is held."""
        item = next((item for item in self.items if item.id == item_id), None)
        if item is not None:
            item.said = said
            item.done += well
            if well and item.done >= item.repeats:
                self.items.remove(item)
        if not well:
            self.held = said
        elif not self.items:
            self.held = NOT_STARTED
        elif self.items[0].by_hand:
            self.held = f"set the cells for {self.items[0].name} by hand, then start"
        waiting = self.items[0] if self.items else None
        pause_s = waiting.pause_s if waiting is item and waiting is not None else 0.0
        self.not_before_s = time.monotonic() + pause_s
        self._save()

    @property
    def next(self) -> Item | None:
        """The next item that may start."""
        ready = self.items and not self.held and time.monotonic() >= self.not_before_s
        return self.items[0] if ready else None

    def as_data(self) -> dict[str, Any]:
        """For the page."""
        left_s = self.not_before_s - time.monotonic()
        return {
            "held": self.held,
            "pause_s": round(left_s) if self.items and left_s > 0 else None,
            "items": [{**asdict(item), "toml": None} for item in self.items],
        }

    def _save(self) -> None:
        if self.path is None:
            return
        part = self.path.with_suffix(".part")
        try:
            part.write_text(json.dumps([asdict(item) for item in self.items]), encoding="utf-8")
            part.replace(self.path)
        except OSError:  # in a folder that cannot be written the queue lives as long as the lab
            with suppress(OSError):
                part.unlink()

    def _load(self) -> None:
        if self.path is None:
            return
        try:
            self.items = [Item(**row) for row in json.loads(self.path.read_text(encoding="utf-8"))]
        except (OSError, ValueError, TypeError):
            return
        if self.items:
            self.held = "the lab was started again"
