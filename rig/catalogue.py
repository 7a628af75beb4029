"""Catalogue: what recordings a folder holds, rebuilt from the files at will; its index only saves time."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from rig.errors import RigError
from rig.notes import read_notes
from rig.run import Run
from rig.run_read import read_run

CRATE = "ro-crate-metadata.json"  # what lies beside it is a copy for others
INDEX = ".straw-runs.json"
RECORDINGS = (".mcap", ".mcap.part")
#: Changes when an entry's meaning does: an index of another version is built anew.
VERSION = 1


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
    tags: tuple[str, ...] = ()


def catalogue(
    folder: Path, *, rebuild: bool = False, progress: Callable[[int, int], None] | None = None
) -> list[Entry]:
    """Every recording below a folder, oldest first; a file that has not changed is not read again unless ``rebuild``.

    RigError when the folder cannot be read; a recording that cannot is an entry that says so.
    """
    if not folder.is_dir():
        raise RigError(f"{folder} is not a folder; name the one that holds the recordings")
    found = (path for path in folder.rglob("*.mcap*") if path.name.endswith(RECORDINGS) and path.is_file())
    paths = sorted(path for path in found if not (path.parent / CRATE).exists())
    known = {} if rebuild else {entry.name: entry for entry in _read_index(folder)}
    entries = []
    for number, path in enumerate(paths, 1):
        name, stat = path.relative_to(folder).as_posix(), path.stat()
        entry = known.get(name)
        if entry is None or (entry.size, entry.changed_ns) != (stat.st_size, stat.st_mtime_ns):
            entry = _entry(path, name)
        entries.append(replace(entry, tags=read_notes(path).tags))
        if progress:
            progress(number, len(paths))
    _write_index(folder, entries)
    return sorted(entries, key=lambda entry: (entry.start_ns, entry.name))


def find(folder: Path, wanted: str, entries: list[Entry] | None = None) -> Path:
    """A recording by its path, its run id, or the beginning of its SHA-256 (6 digits or more); RigError otherwise."""
    if Path(wanted).is_file():
        return Path(wanted)
    entries = catalogue(folder) if entries is None else entries
    named = [e for e in entries if wanted in (e.name, e.run_id)]
    matches = [e for e in named if e.kind == "run"] or named  # a run before its tracks, and before what was cut
    matches = matches or [e for e in entries if len(wanted) >= 6 and e.sha256.startswith(wanted)]
    if not matches:
        raise RigError(f"run {wanted!r} is not in {folder}; straw runs list shows what is")
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


def _entry(path: Path, name: str) -> Entry:
    stat = path.stat()
    bare = Entry(name, stat.st_size, stat.st_mtime_ns, "unreadable")
    try:
        run = read_run(path)
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
    )


def _read_index(folder: Path) -> list[Entry]:
    names = [field.name for field in fields(Entry) if field.name != "tags"]
    try:
        data: Any = json.loads((folder / INDEX).read_text(encoding="utf-8"))
        if data["version"] != VERSION:
            return []
        return [Entry(*(row[name] for name in names)) for row in data["recordings"]]
    except (OSError, ValueError, KeyError, TypeError):
        return []  # it is built anew from the files, which know better


def _write_index(folder: Path, entries: list[Entry]) -> None:
    data = {"version": VERSION, "recordings": [asdict(entry) for entry in entries]}
    part = folder / (INDEX + ".part")
    with suppress(OSError):  # a folder one may only read has a catalogue as well, only slower
        part.write_text(json.dumps(data), encoding="utf-8")
        part.replace(folder / INDEX)
