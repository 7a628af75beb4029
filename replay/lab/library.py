"""Library: the recordings of one folder, kept up to date while the lab is open; an index of files, no database."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

from straw.rig.catalogue import Entry, entry_of, known, save, scan
from straw.rig.columns import metadata_names
from straw.rig.errors import RigError
from straw.rig.notes import read_notes, say
from straw.rig.orders import running

#: Pause between scans of the folder, in durations of the last scan, so that scans take a bounded share of the time.
REST = 10.0
SHORTEST_S = 1.0
#: New entries are shown after so long, not only when all are read.
SHOW_S = 0.5
#: Views of the table that are kept.
REMEMBERED = 30
T = TypeVar("T")


class Library:
    """Entries by name; ``version`` grows with every change. A thread looks at the folder, a process reads new files."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.version = 0
        self.reading: tuple[int, int] | None = None  # (done, of how many) while new files are read
        self.problem = ""
        self._entries: dict[str, Entry] = known(folder)
        self._metadata: list[str] = []
        self._lock = threading.Lock()
        self._look = threading.Event()
        self._closed = False
        self._pool: ProcessPoolExecutor | None = None
        self._details: dict[tuple[str, int, int], dict[str, Any]] = {}
        self._answers: tuple[int, dict[Hashable, Any]] = (0, {})
        self._changed({})

    def open(self) -> None:
        """Begin to look."""
        threading.Thread(target=self._watch, name="library", daemon=True).start()

    def close(self) -> None:
        """Stop looking."""
        self._closed = True
        self._look.set()
        if self._pool:
            self._pool.shutdown(cancel_futures=True)

    def look(self) -> None:
        """Request an early scan, as something happened in the folder."""
        self._look.set()

    @property
    def entries(self) -> list[Entry]:
        """All recordings, in no particular order."""
        with self._lock:
            return list(self._entries.values())

    def __len__(self) -> int:
        return len(self._entries)

    def remembered(self, key: Hashable, made: Callable[[], T]) -> T:
        """A result cached for this version under a key, as a table is requested in many windows."""
        version, answers = self._answers
        if version != self.version or len(answers) > REMEMBERED:
            version, answers = self._answers = (self.version, {})
        if key not in answers:
            answers[key] = made()
        found: T = answers[key]
        return found

    @property
    def metadata(self) -> list[str]:
        """Keys of metadata that any recording has."""
        return self._metadata

    def entry(self, name: str) -> Entry:
        """The entry of a file's name, a run id or the start of a SHA-256; RigError where there is none."""
        with self._lock:
            found = self._entries.get(name)
            if found is None:
                named = [e for e in self._entries.values() if name in (e.run_id, e.sha256)]
                found = next((e for e in named if e.kind == "run"), named[0] if named else None)
        if found is None:
            raise RigError(f"{name!r} is not in {self.folder}; it may have been moved: reload the table")
        return found

    def path(self, entry: Entry) -> Path:
        """Where a recording is."""
        return self.folder / entry.name

    def details(self, entry: Entry, read: Callable[[Path], dict[str, Any]]) -> dict[str, Any]:
        """The contents of a recording, read in the reading process and cached; where unreadable, the reason."""
        if entry.kind == "running":
            return {}
        key = (entry.name, entry.size, entry.changed_ns)
        if key not in self._details:
            try:
                said = self._pooled(read, self.path(entry))
            except RigError as error:
                return {"lost": [str(error)]}
            while len(self._details) >= REMEMBERED:
                self._details.pop(next(iter(self._details)))
            self._details[key] = said
        return self._details[key]

    def say(self, name: str, kind: str, text: str, **more: object) -> Entry:
        """Write a note, tag or mark beside a recording; the entry as it then is."""
        entry = self.entry(name)
        say(self.path(entry), kind, text, **more)
        notes = read_notes(self.path(entry))
        changed = replace(entry, said="", tags=notes.tags, marks=notes.marks, notes=notes.notes)
        self._changed({entry.name: changed})
        self.look()
        return changed

    def _watch(self) -> None:
        while not self._closed:
            began_s = time.monotonic()
            try:
                self._refresh()
                self.problem = ""
            except Exception as error:  # the lab continues with its entries, and reports it
                self.problem = f"{self.folder} cannot be scanned: {error}"
            took_s = time.monotonic() - began_s
            self._look.wait(max(SHORTEST_S, REST * took_s))
            self._look.clear()

    def _refresh(self) -> None:
        with self._lock:
            before = dict(self._entries)
        found: dict[str, Entry] = {}
        new: dict[str, Entry] = {}
        shown_s = time.monotonic()
        settled = {name: entry for name, entry in before.items() if entry.kind != "running"}
        for entry, done, total in scan(self.folder, settled, self._read):
            found[entry.name] = entry
            if entry is not before.get(entry.name):
                new[entry.name] = entry
            if new and time.monotonic() - shown_s > SHOW_S:
                self.reading, shown_s = (done, total), time.monotonic()
                self._changed(new)
                new = {}
            if self._closed:
                return
        gone = before.keys() - found.keys()
        was_reading, self.reading = self.reading, None
        if new or gone or was_reading:
            self._changed(new, gone)
            save(self.folder, [entry for entry in found.values() if entry.kind != "running"])

    def _changed(self, new: dict[str, Entry], gone: Any = ()) -> None:
        with self._lock:
            self._entries.update(new)
            for name in gone:
                self._entries.pop(name, None)
            self._metadata = metadata_names(self._entries.values())
            self.version += 1

    def _read(self, path: Path, name: str) -> Entry:
        if name.endswith(".part") and (said := running(path)):
            return running_entry(name, said)
        entry: Entry = self._pooled(entry_of, path, name)
        return entry

    def _pooled(self, does: Callable[..., Any], *arguments: Any) -> Any:
        """In a process of its own, as decoding must delay neither the page nor its VENT."""
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), max_tasks_per_child=2000)
        try:
            return self._pool.submit(does, *arguments).result()
        except BrokenProcessPool:  # it was killed, or the machine ran out of memory
            self._pool = None
            raise RigError("the process that reads recordings ended; try again") from None


def running_entry(name: str, said: dict[str, Any]) -> Entry:
    """The entry of a run in progress, from its own status: its file is not finished."""
    return Entry(
        name,
        0,
        int(said["since_ns"]),
        "running",
        run_id=Path(name).name.removesuffix(".part").removesuffix(".mcap"),
        specimen=str(said.get("specimen", "")),
        protocol=str(said.get("protocol", "")),
        start_ns=int(said["since_ns"]),
        status=str(said["state"]),
        metadata={"limits": str(said.get("limits", ""))},
    )
