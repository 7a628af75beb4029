"""Record: the data of the lab's pages of one recording, of several side by side, and of a specimen's history."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from straw.replay.lab.findings import findings
from straw.replay.lab.library import Library
from straw.replay.lab.lineage import lineage
from straw.replay.lab.table import UNTELLING, row
from straw.rig.catalogue import Entry, latest_tracks
from straw.rig.columns import COLUMNS, value_of
from straw.rig.errors import RigError
from straw.rig.notes import read_notes
from straw.rig.run_channels import details

#: Runs whose curves are laid over each other at a time.
MOST = 24
FACTS = ("run", "start", "specimen", "protocol", "cycle", "deployed", "duration", "lowest", "highest", "status")


def record(library: Library, name: str, work: Path | None) -> dict[str, Any]:
    """The data of one recording's page."""
    entry = library.entry(name)
    notes = read_notes(library.path(entry))
    said = library.details(entry, details)
    tracks = _tracks(library, entry)
    return {
        "name": entry.name,
        "kind": entry.kind,
        "sha256": entry.sha256,
        "problem": entry.problem,
        "facts": {COLUMNS[key].title: _plain(value_of(entry, key)) for key in FACTS},
        "tags": entry.tags,
        "marks": entry.marks,
        "notes": [[line, when, text] for line, (when, text) in zip(notes.lines, notes.notes, strict=True)],
        "tracks": [track.name for track in tracks],
        "lineage": lineage(library, entry, work),
        **said,
        "signals": _signals(library, entry),
    }


def compared(library: Library, names: Sequence[str]) -> dict[str, Any]:
    """Curves of several runs, with their tracks' tips, and the settings in which they differ."""
    if not names or len(names) > MOST:
        raise RigError(f"{len(names)} recordings are chosen; choose 1 to {MOST} to lay over each other")
    entries = [library.entry(name) for name in names]
    keys = sorted({key for e in entries for key in e.metadata} - UNTELLING - {"initial_deployed"})
    settings = {}
    for key in ("specimen", "protocol", "cycle", "deployed", *keys):
        values = [_plain(value_of(entry, key)) for entry in entries]
        if len(set(values)) > 1:
            settings[key] = values
    varies = next(iter(settings), "")
    runs = []
    for entry in entries:
        value = _plain(value_of(entry, varies)) if varies else ""
        label = f"{entry.run_id or entry.name}{f' · {varies} {value}' if value else ''}"
        runs.append({"name": entry.name, "label": label, "signals": _signals(library, entry)})
    return {"runs": runs, "settings": settings}


def specimen(library: Library, name: str, work: Path | None) -> dict[str, Any]:
    """A specimen's runs in order, its cycles, the constants and findings so far."""
    mine = [e for e in library.entries if e.specimen == name]
    runs = sorted((e for e in mine if e.kind in ("run", "part", "running")), key=lambda e: e.start_ns)
    if not runs:
        raise RigError(f"no run of a specimen {name!r} is in {library.folder}")
    shas = {e.sha256 for e in mine if e.sha256}
    made = [m for m in findings(work) if shas & set(m["inputs"].values())]
    return {
        "name": name,
        "runs": [row(e, ["run", "start", "protocol", "cycle", "status", "tag"], "", {}) for e in runs],
        "cycles": max((e.cycle + 1 for e in runs), default=0),
        "first": _plain(value_of(runs[0], "start")),
        "last": _plain(value_of(runs[-1], "start")),
        "seconds": sum(e.duration_s for e in runs),
        "findings": [{key: m[key] for key in ("id", "title", "verdict", "causes")} for m in made],
        "constants": _constants(made, runs),
    }


def _constants(made: list[dict[str, Any]], runs: list[Entry]) -> dict[str, list[dict[str, Any]]]:
    """Points of each constant over cycles: value with its band, from ``straw identify runs`` and ``straw diagnose``."""
    cycle = {e.run_id: e.cycle for e in runs}
    points: dict[str, list[dict[str, Any]]] = {}

    def add(name: str, names: Sequence[str], value: float, low: float, high: float, job: str) -> None:
        at = max((cycle.get(run, 0) for run in names), default=0)
        points.setdefault(name, []).append({"cycle": at, "value": value, "low": low, "high": high, "job": job})

    for one in made:
        said = one["said"]
        with suppress(KeyError, TypeError, AttributeError):
            for fit in [*said.get("each", []), *([said["joint"]] if "joint" in said and not said.get("each") else [])]:
                for name, c in fit["constants"].items():
                    add(name, fit["runs"], c["value"], c["low"], c["high"], one["id"])
            for cause, constants in said.get("parameters", {}).items():
                for name, c in constants.items():
                    low, high = c["value"] - 2 * c["sigma"], c["value"] + 2 * c["sigma"]
                    add(f"{cause}: {name}", said["fit"]["train"]["runs"], c["value"], low, high, one["id"])
    return points


def _tracks(library: Library, entry: Entry) -> list[Entry]:
    return [e for e in library.entries if e.parent == entry.sha256 and e.kind == "track"] if entry.sha256 else []


def _signals(library: Library, entry: Entry) -> dict[str, Any]:
    """A recording's signals, with the tip of its track on its own clock."""
    said = library.details(entry, details)
    signals = dict(said.get("signals", {}))
    if track := latest_tracks(library.entries).get(entry.sha256):
        signals |= _shifted(library.details(track, details), int(said.get("zero_ns", 0)))
    return signals


def _shifted(said: dict[str, Any], zero_ns: int) -> dict[str, Any]:
    """Signals of a track on the clock of its run."""
    shift_s = (int(said.get("zero_ns", zero_ns)) - zero_ns) * 1e-9
    tips = {name: s for name, s in said.get("signals", {}).items() if name in ("X", "Z", "Phi")}
    return {name: {**s, "time_s": [round(t + shift_s, 5) for t in s["time_s"]]} for name, s in tips.items()}


def _plain(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else ", ".join(value) if isinstance(value, tuple) else str(value)
