"""straw runs: the catalogue of recordings: list, show, tag, note, attach, compare, verify, export, recover."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from straw.replay.commands.runs_compare import compare_runs
from straw.replay.commands.runs_show import catalogue_of, show, when
from straw.replay.output import write_json
from straw.rig.catalogue import Entry, family, find
from straw.rig.columns import COLUMNS, metadata_names, ordered
from straw.rig.crate import export
from straw.rig.errors import RigError
from straw.rig.filter import compiled
from straw.rig.manifest import check, manifest_of, read_manifest, seal
from straw.rig.notes import notes_of, read_notes, say
from straw.rig.recover import recover
from straw.rig.run_read import read_fitting


def run(args: argparse.Namespace) -> int:
    """Call the function of the action."""
    return ACTIONS[args.action](args)


def list_runs(args: argparse.Namespace) -> int:
    """One line for each recording."""
    entries = [entry for entry in catalogue_of(args) if _wanted(entry, args)]
    where = compiled(args.where, metadata_names(entries))
    entries = [entry for entry in entries if where(entry)]
    if args.sort:
        check_column(args.sort.removeprefix("-"), entries)
        entries = ordered(entries, args.sort)
    if args.json:
        write_json(args.json, [asdict(entry) for entry in entries])
    if not entries:
        print(f"no recordings in {args.dir}" + (" that match" if args.tag or args.specimen or args.where else ""))
        return 0
    rows = [("start (UTC)", "kind", "run", "specimen", "s", "status", "tags", "file")]
    rows += [
        (
            when(entry.start_ns),
            entry.kind,
            entry.run_id or "?",
            entry.specimen or "-",
            f"{entry.duration_s:.1f}",
            "damaged" if entry.problem else entry.status or "-",
            ",".join(entry.tags) or "-",
            entry.name,
        )
        for entry in entries
    ]
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    return 0


def tag(args: argparse.Namespace) -> int:
    """Add tags to a recording, or remove them."""
    path = find(args.dir, args.run)
    for word in args.tags:
        say(path, "untag" if args.remove else "tag", word)
    print(f"{path}: tags {', '.join(read_notes(path).tags) or 'none'}")
    return 0


def mark(args: argparse.Namespace) -> int:
    """Star, archive or lock a recording, or take that back."""
    path = find(args.dir, args.run)
    say(path, "unmark" if args.remove else "mark", args.action)
    print(f"{path}: {', '.join(read_notes(path).marks) or 'no star, not archived, not locked'}")
    return 0


def note(args: argparse.Namespace) -> int:
    """Write a note beside a recording."""
    path = find(args.dir, args.run)
    say(path, "note", " ".join(args.text))
    print(f"noted in {notes_of(path)}")
    return 0


def attach(args: argparse.Namespace) -> int:
    """Enter files that belong to a run, such as a video, into its manifest."""
    path = find(args.dir, args.run)
    seal(path, args.files)
    print(f"{manifest_of(path)}: {len(read_manifest(path))} files")
    return 0


def verify(args: argparse.Namespace) -> int:
    """Every file against its sum, every recording against its checksums; 1 when something is wrong."""
    entries = catalogue_of(args, rebuild=True)
    wanted = {find(args.dir, name, entries).resolve() for name in args.runs}
    problems: list[str] = []
    recorded: list[Path] = []
    unknown: list[Path] = []
    copies: dict[str, str] = {}
    known = {entry.sha256 for entry in entries}
    entered = _entered(args.dir / entry.name for entry in entries)
    for entry in entries:
        path = args.dir / entry.name
        if wanted and path.resolve() not in wanted:
            continue
        if entry.problem:
            problems.append(f"{path}: {entry.problem}")
        if entry.parent and entry.parent not in known:
            problems.append(f"{path}: the run it was derived from (sha256 {entry.parent[:12]}...) is not in {args.dir}")
        if entry.sha256 and (first := copies.setdefault(entry.sha256, entry.name)) != entry.name:
            print(f"{path}: the same recording as {args.dir / first}")
        try:
            checked = check(path)
        except RigError as error:
            problems.append(str(error))
            unknown.append(path)
            continue
        recorded += [one.path for one in checked if not one.problem]
        problems += [f"{one.path}: {one.problem} since it was entered in {manifest_of(path)}"
                     for one in checked if one.problem and not (one.path == path and entry.problem)]  # fmt: skip
        if path.resolve() not in entered:
            unknown.append(path)
    if args.json:
        names = {"recorded": [str(one) for one in recorded], "unknown": [str(one) for one in unknown]}
        write_json(args.json, {"files": len(recorded) + len(unknown), **names, "problems": problems})
    for text in problems:
        print(text)
    counts = f"{len(recorded)} files as recorded, {len(problems)} changed or damaged, {len(unknown)} unknown"
    print(counts + _unknown(unknown))
    return 1 if problems else 0


def _entered(runs: Iterable[Path]) -> set[Path]:
    """Every file that some run's manifest lists; a manifest that cannot be read lists none."""
    found: set[Path] = set()
    for run in runs:
        with suppress(RigError):
            found |= {(run.parent / name).resolve() for name in read_manifest(run)}
    return found


def _unknown(files: list[Path]) -> str:
    if not files:
        return ""
    names = ", ".join(path.name for path in files[:3]) + (", ..." if len(files) > 3 else "")
    return f": no checksum was kept of {names} (straw runs attach RUN FILE keeps one)"


def export_run(args: argparse.Namespace) -> int:
    """An RO-Crate with all that belongs to a run."""
    path = find(args.dir, args.run)
    found, _ = read_fitting(path)
    bad = [one for one in check(path) if one.problem]
    if bad:
        raise RigError(f"{bad[0].path} {bad[0].problem}, so the run cannot be exported as recorded; restore it first")
    beside = [p for p in (manifest_of(path), notes_of(path)) if p.exists()]
    files = [path.parent / name for name in read_manifest(path) if name != path.name]
    held = export(found, [*beside, *files, *family(path, args.dir)], args.output, args.licence)
    print(f"{args.output}: RO-Crate with {len(held)} files: {', '.join(map(str, held))}")
    return 0


def recover_runs(args: argparse.Namespace) -> int:
    """Make a readable run from a .part or a damaged file, and print what was lost."""
    done = recover(args.run, args.output)
    if args.json:
        write_json(args.json, {"recording": str(done.path), "messages": done.messages, "lost": list(done.lost)})
    print(f"{done.path}: {done.messages} messages recovered from {args.run}, which stays")
    for text in done.lost:
        print(f"lost: {text}")
    return 0


def _wanted(entry: Entry, args: argparse.Namespace) -> bool:
    return (not args.tag or args.tag in entry.tags) and (not args.specimen or args.specimen == entry.specimen)


def check_column(name: str, entries: list[Entry]) -> None:
    """Raise RigError where a name is neither a column nor among the recordings' metadata."""
    if name not in COLUMNS and name not in metadata_names(entries):
        raise RigError(f"no such column: {name}; known: {', '.join(COLUMNS)}, and the keys of the recordings' metadata")


ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "list": list_runs,
    "show": show,
    "tag": tag,
    "note": note,
    "star": mark,
    "archive": mark,
    "lock": mark,
    "attach": attach,
    "compare": compare_runs,
    "verify": verify,
    "export": export_run,
    "recover": recover_runs,
}
