"""straw runs show: all that is known of a recording, or of a calibration and the tracks that were made with it."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from pathlib import Path

from straw.replay.output import write_json
from straw.replay.progress import progress_bar
from straw.rig.catalogue import Entry, catalogue, family, find, kind_of, span_s
from straw.rig.errors import RigError
from straw.rig.manifest import check, manifest_of, sha256_of
from straw.rig.notes import read_notes
from straw.rig.run_read import read_fitting
from straw.tracking.camera import load_camera


def show(args: argparse.Namespace) -> int:
    """All that is known of one recording."""
    path = find(args.dir, args.run)
    if path.suffix == ".json":
        return show_calibration(path, args)
    (found, _), notes = read_fitting(path), read_notes(path)
    start_s, end_s = span_s(found)
    try:
        files = {one.path.name: one.problem or "as recorded" for one in check(path)}
    except RigError as error:
        files = {manifest_of(path).name: str(error)}
    derived = [str(one) for one in family(path, args.dir)]
    data = {
        "file": str(path),
        "kind": kind_of(found),
        "sha256": found.sha256,
        "start": when(found.zero_time_ns + round(start_s * 1e9)),
        "duration_s": end_s - start_s,
        "samples": {
            "pressure": len(found.pressure or ()),
            "command": len(found.command or ()),
            "tip": len(found.tip or ()),
        },
        "metadata": dict(found.metadata),
        "software": dict(found.software),
        "attachments": sorted(found.attachments),
        "events": [{"time_s": event.time_s, "kind": event.kind, "text": event.text} for event in found.events],
        "tags": list(notes.tags),
        "notes": [f"{said} {text}" for said, text in notes.notes],
        "manifest": files,
        "derived": derived,
        "lost": list(found.lost),
    }
    if args.json:
        write_json(args.json, data)
    for key, value in data.items():
        if isinstance(value, dict):
            print(f"{key}:" + (" -" if not value else ""))
            for name, text in value.items():
                print(f"  {name:<20} {text}")
        elif key == "events":
            print("events:" + (" -" if not found.events else ""))
            for event in found.events[: args.events]:
                print(f"  {event.time_s:9.3f} s  {event.kind:<8} {event.text}")
            if len(found.events) > args.events:
                print(f"  ... and {len(found.events) - args.events} more (--events N)")
        elif isinstance(value, list):
            print(f"{key}: {', '.join(value) if key in ('tags', 'attachments') else ''}" + (" -" if not value else ""))
            if key not in ("tags", "attachments"):
                for text in value:
                    print(f"  {text}")
        else:
            print(f"{key}: {value:.3f}" if isinstance(value, float) else f"{key}: {value}")
    return 0


def show_calibration(path: Path, args: argparse.Namespace) -> int:
    """What a camera file is, and the tracks that were made with exactly this one."""
    lens, sha256 = load_camera(path).lens, sha256_of(path)
    tracks = [e.name for e in catalogue_of(args) if e.metadata.get("calibration_sha256") == sha256]
    if args.json:
        write_json(args.json, {"file": str(path), "kind": "calibration", "sha256": sha256, "tracks": tracks})
    print(f"file: {path}\nkind: calibration of {lens.name or 'a camera'}, {lens.kind}\nsha256: {sha256}")
    print("tracks:" + (" -" if not tracks else ""))
    for name in tracks:
        print(f"  {name}")
    return 0


def catalogue_of(args: argparse.Namespace, rebuild: bool = False) -> list[Entry]:
    """The recordings of the command's folder, with a bar while new ones are read."""
    with progress_bar(f"read {args.dir}", "recording") as progress:
        return catalogue(args.dir, rebuild=rebuild or getattr(args, "rebuild", False), progress=progress)


def when(wall_ns: int) -> str:
    """A time since the Unix epoch (ns) as UTC, in words."""
    return datetime.fromtimestamp(wall_ns * 1e-9, UTC).strftime("%Y-%m-%d %H:%M:%S") if wall_ns else "-"
