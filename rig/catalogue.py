"""Catalogue: the recordings of a folder, rebuilt from the files at any time; its index only saves time."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError
from straw.rig.notes import SUFFIX, Notes, read_notes
from straw.rig.preview import Preview, preview_of
from straw.rig.run import Run
from straw.rig.run_read import read_fitting

CRATE = "ro-crate-metadata.json"  # other files beside it are copies for other programs
INDEX = ".straw-runs.json"
RECORDINGS = (".mcap", ".mcap.part")
#: Longer values of a recording's metadata (such as a straw's constants) stay in the recording only.
LONGEST = 200
#: Changes when an entry's meaning does: an index of another version is rebuilt.
VERSION = 2


@dataclass(frozen=True)
class Entry:
    """One recording. ``kind`` is run, track, prediction, part (unfinished) or unreadable; times in s, wall in ns."""

    name: str  # of the file, from the catalogue's folder
    size: int
    changed_ns: int
    kind: str
    sha256: str = ""
    run_id: str = ""
    specimen: str = ""
    protocol: str = ""
    start_ns: int = 0
    duration_s: float = 0.0
    status: str = ""
    parent: str = ""
    commit: str = ""
    problem: str = ""
    cycle: int = 0
    metadata: dict[str, str] = field(default_factory=dict, repr=False)
    preview: Preview = field(default_factory=dict, repr=False)
    said: str = ""  # time and size of its notes when they were read
    tags: tuple[str, ...] = ()
    marks: tuple[str, ...] = ()
    notes: tuple[tuple[str, str], ...] = ()


def catalogue(
    folder: Path, *, rebuild: bool = False, progress: Callable[[int, int], None] | None = None
) -> list[Entry]:
    """Every recording below a folder, oldest first; a file that has not changed is not read again unless ``rebuild``.

    RigError when the folder cannot be read; an unreadable recording is an entry that says so.
    """
    if not folder.is_dir():
        raise RigError(f"{folder} is not a folder; name the one that holds the recordings")
    entries = []
    for entry, done, total in scan(folder, {} if rebuild else known(folder)):
        entries.append(entry)
        if progress:
            progress(done, total)
    save(folder, entries)
    return sorted(entries, key=lambda entry: (entry.start_ns, entry.name))


def scan(
    folder: Path, known: dict[str, Entry], read: Callable[[Path, str], Entry] | None = None
) -> Iterator[tuple[Entry, int, int]]:
    """Entries below a folder as (entry, how many are done, of how many); ``read`` makes one, where it is not known."""
    read = read or entry_of
    paths = sorted(_files(folder))
    for done, (name, stat, said) in enumerate(paths, 1):
        entry = known.get(name)
        if entry is None or (entry.size, entry.changed_ns) != (stat.st_size, stat.st_mtime_ns):
            entry = read(folder / name, name)
        if entry.said != said:
            notes = read_notes(folder / name) if said else Notes()
            entry = replace(entry, said=said, tags=notes.tags, marks=notes.marks, notes=notes.notes)
        yield entry, done, len(paths)


def known(folder: Path) -> dict[str, Entry]:
    """The entries of a folder's index by name; empty where there is no usable one."""
    names = [one.name for one in fields(Entry)]
    try:
        data: Any = json.loads((folder / INDEX).read_text(encoding="utf-8"))
        if data["version"] != VERSION:
            return {}
        return {row["name"]: Entry(**{name: _tuples(name, row[name]) for name in names}) for row in data["recordings"]}
    except (OSError, ValueError, KeyError, TypeError):
        return {}  # it is rebuilt from the files


def save(folder: Path, entries: list[Entry]) -> None:
    """Write the index, for the next time."""
    data = {
        "version": VERSION,
        "recordings": [{one.name: getattr(entry, one.name) for one in fields(Entry)} for entry in entries],
    }
    part = folder / f"{INDEX}.{os.getpid()}.part"  # two processes may build it at once
    try:
        part.write_text(json.dumps(data), encoding="utf-8")
        part.replace(folder / INDEX)
    except OSError:  # a read-only folder has a catalogue as well, only slower
        with suppress(OSError):
            part.unlink()


def find(folder: Path, wanted: str, entries: list[Entry] | None = None) -> Path:
    """A recording by its path, its run id, or the beginning of its SHA-256 (6 digits or more); RigError otherwise."""
    if Path(wanted).is_file():
        return Path(wanted)
    entries = catalogue(folder) if entries is None else entries
    named = [e for e in entries if wanted in (e.name, e.run_id)]
    matches = [e for e in named if e.kind == "run"] or named  # a run before its tracks, and before what was cut
    matches = matches or [e for e in entries if len(wanted) >= 6 and e.sha256.startswith(wanted)]
    if not matches:
        raise RigError(f"run {wanted!r} is not in {folder}; straw runs list shows its runs")
    if len(matches) > 1:
        names = ", ".join(entry.name for entry in matches[:4])
        raise RigError(f"run {wanted!r} is the name of {len(matches)} recordings ({names}); give the file")
    return folder / matches[0].name


def family(path: Path, folder: Path) -> Iterator[Path]:
    """Recordings below a folder that were derived from this one, and from those."""
    entries = catalogue(folder)
    parents = {entry.sha256 for entry in entries if (folder / entry.name).resolve() == path.resolve()}
    while grown := [e for e in entries if e.parent and e.parent in parents and e.sha256 not in parents]:
        for entry in grown:
            if entry.sha256 not in parents:
                parents.add(entry.sha256)
                yield folder / entry.name


def latest_tracks(entries: Iterable[Entry]) -> dict[str, Entry]:
    """Of the tracks of each run the one that was made last and is not archived, by the run's SHA-256."""
    tracks = [e for e in entries if e.kind == "track" and e.parent and "archive" not in e.marks]
    return {track.parent: track for track in sorted(tracks, key=lambda e: (e.changed_ns, e.name))}


def kind_of(run: Run) -> str:
    """What a recording is."""
    if run.predictions:
        return "prediction"
    if run.path.name.endswith(".part"):
        return "part"
    return "track" if run.metadata.get("parent_sha256") or run.pressure is None else "run"


def span_s(run: Run) -> tuple[float, float]:
    """First and last time (s since the run's zero) of all its logs."""
    logs = [run.pressure, run.command, run.tip, *(p for m in run.predictions.values() for p in (m.tip, m.pressure))]
    times = [float(t) for log in logs if log is not None for t in (log.time_s[0], log.time_s[-1])]
    times += [event.time_s for event in run.events]
    return (min(times), max(times)) if times else (0.0, 0.0)


def entry_of(path: Path, name: str) -> Entry:
    """The entry of one recording, read whole; what cannot be read is an entry that says so."""
    try:
        stat = path.stat()
    except OSError as error:
        return Entry(name, 0, 0, "unreadable", problem=f"cannot be read: {error.strerror}")
    bare = Entry(name, stat.st_size, stat.st_mtime_ns, "unreadable")
    try:
        run, _ = read_fitting(path)
    except RigError as error:
        return replace(bare, problem=str(error))
    start_s, end_s = span_s(run)
    return replace(
        bare,
        kind=kind_of(run),
        sha256=run.sha256,
        run_id=run.run_id,
        specimen=run.specimen,
        protocol=run.metadata.get("protocol", ""),
        start_ns=run.zero_time_ns + round(start_s * 1e9),
        duration_s=end_s - start_s,
        status=run.metadata.get("exit_status", ""),
        parent=run.metadata.get("parent_sha256", ""),
        commit=run.software.get("git_commit", ""),
        problem=run.damage[0] if run.damage else "",
        cycle=run.cycle,
        metadata={key: value for key, value in run.metadata.items() if len(value) <= LONGEST},
        preview=preview_of(run),
    )


def _files(folder: Path) -> Iterator[tuple[str, os.stat_result, str]]:
    """Name, stat, and time and size of the notes of every recording below a folder."""
    waiting = [(folder, "")]
    while waiting:
        here, prefix = waiting.pop()
        try:
            found = {item.name: item for item in os.scandir(here)}
        except OSError:  # a folder that was removed meanwhile, or is not readable
            continue
        if CRATE in found:
            continue
        for name, item in found.items():
            if item.is_dir(follow_symlinks=False):
                waiting.append((here / name, f"{prefix}{name}/"))
            elif name.endswith(RECORDINGS) and item.is_file():
                notes = found.get(name + SUFFIX)
                with suppress(OSError):
                    about = notes.stat() if notes else None
                    yield prefix + name, item.stat(), f"{about.st_mtime_ns}:{about.st_size}" if about else ""


def _tuples(name: str, value: Any) -> Any:
    if name == "notes":
        return tuple((when, text) for when, text in value)
    return tuple(value) if name in ("tags", "marks") else value
