"""Lineage: a recording's sources and derived files by SHA-256: run, video, calibration, track, findings."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from straw.replay.lab.findings import findings
from straw.replay.lab.library import Library
from straw.rig.catalogue import Entry
from straw.rig.errors import RigError
from straw.rig.manifest import read_manifest


def lineage(library: Library, entry: Entry, work: Path | None) -> list[dict[str, str]]:
    """A recording's sources and derived files, each as (relation, name, SHA-256)."""
    by_sha = {e.sha256: e for e in library.entries if e.sha256}
    found = []
    above, seen = entry, {entry.sha256}
    while above.parent and above.parent not in seen:
        seen.add(above.parent)
        parent = by_sha.get(above.parent)
        relation = "derived from" if above is entry else "which was derived from"
        found.append({"relation": relation, "name": parent.name if parent else "", "sha256": above.parent})
        if parent is None:
            break
        above = parent
    path = library.path(entry)
    with suppress(RigError):
        for name, digest in read_manifest(path).items():
            if name != path.name:
                found.append({"relation": "belongs to it", "name": "", "file": name, "sha256": digest})
    found += _calibrations(library, [entry])
    waiting, made = [entry.sha256], list[Entry]()
    while waiting:
        sha = waiting.pop()
        for child in library.entries:
            if sha and child.parent == sha and child.sha256 not in seen:
                seen.add(child.sha256)
                waiting.append(child.sha256)
                found.append({"relation": child.kind, "name": child.name, "sha256": child.sha256})
                made.append(child)
    found += _calibrations(library, made)
    for one in findings(work):
        if entry.sha256 in one["inputs"].values():
            found.append({"relation": one["title"], "name": "", "job": one["id"], "says": one["verdict"]})
    return found


def _calibrations(library: Library, tracks: Sequence[Entry]) -> list[dict[str, str]]:
    """The camera files that tracks were made with, each once, and how many tracks of the folder each made."""
    shas = {t.metadata["calibration_sha256"]: t for t in tracks if t.metadata.get("calibration_sha256")}
    found = []
    for sha, track in shas.items():
        count = sum(e.metadata.get("calibration_sha256") == sha for e in library.entries)
        says = f"{count} track{'s' if count > 1 else ''} with it"
        name = track.metadata.get("calibration", "")
        found.append(
            {"relation": "calibration", "name": "", "file": name, "sha256": sha, "calibration": sha, "says": says}
        )
    return found
