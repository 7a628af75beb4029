"""straw import: tables of other loggers as a recording; what is guessed is shown, drawn, confirmed, then written."""

from __future__ import annotations

import argparse
from pathlib import Path

from straw.replay.errors import ReplayError
from straw.replay.output import check_new, write_json, write_text
from straw.replay.progress import progress_bar
from straw.replay.tables.flags import metadata_of, told
from straw.replay.tables.picture import draw
from straw.replay.tables.words import data, lines
from straw.rig.tables import import_own, is_own_table, understand, write
from straw.rig.tables.mapping import to_toml


def run(args: argparse.Namespace) -> int:
    """Write the recording; 1 where guesses must be confirmed first."""
    if args.output is None and not args.dry_run:
        raise ReplayError("straw import: no output; give -o RUN.mcap for the recording, or --dry-run to write none")
    if args.output is not None:
        check_new(args.output)
    if args.straw:
        from straw.model.straw_file import load_straw  # loads the compiler

        load_straw(args.straw)  # a file that names readers must be valid
    own = [is_own_table(path) for path in args.tables]
    if any(own):
        return _own(args, own)
    tables, mapping = told(args)
    plan = understand(tables, mapping)
    for line in lines(plan):
        print(line)
    if "initial_deployed" not in plan.mapping.metadata:
        print("note: the cells deployed at the start are missing; replay and diagnose need --deployed 1,4 (or none)")
    if args.save_map:
        check_new(args.save_map)
        write_text(args.save_map, to_toml(plan.mapping))
        print(f"the interpretation is in {args.save_map}, for --map")
    waiting = bool(plan.doubts) and not args.yes
    picture = args.picture
    if picture is None and (waiting or args.dry_run):
        picture = (args.output or Path(args.tables[0].name)).with_suffix(".import.png")
    if picture:
        draw(plan, picture)
        print(f"drawn in {picture}")
    if args.json:
        write_json(args.json, data(plan) | {"written": None if waiting or args.dry_run else str(args.output)})
    if plan.doubts:
        print("guessed:" if waiting or args.dry_run else "guessed, and confirmed by --yes:")
        for doubt in plan.doubts:
            print(f"  {doubt.what}; to state it: {doubt.say}")
    if args.dry_run:
        print("nothing is written (--dry-run)")
        return 0
    if waiting:
        print(f"{args.output} is not written: check {picture}; state the guesses, or add --yes if all are right")
        return 1
    with progress_bar(f"write {args.output.name}", "message") as progress:
        count = write(plan, args.output, progress)
    print(f"{args.output}: {count} messages")
    return 0


def _own(args: argparse.Namespace, own: list[bool]) -> int:
    """A table that straw export wrote, which needs no mapping."""
    if len(own) > 1:
        raise ReplayError(
            f"{args.tables[own.index(True)]}: straw export wrote it; import it alone, it is a whole recording"
        )
    table = args.tables[0]
    if args.dry_run:
        print(f"{table}: written by straw export, and restored as it was. Nothing is written (--dry-run)")
        return 0
    count, whole = import_own(table, args.output, metadata_of(args))
    if args.json:
        write_json(args.json, {"written": str(args.output), "messages": count, "side": whole, "guesses": []})
    print(f"{args.output}: {count} messages" + (", as they were" if whole else ""))
    if not whole:
        print(f"note: {table.name}.json is not beside it: metadata, attachments and other topics are missing")
    return 0
