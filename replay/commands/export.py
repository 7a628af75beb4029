"""straw export: a recording as a table, CSV or Parquet, which straw import restores exactly."""

from __future__ import annotations

import argparse

from straw.replay.errors import ReplayError
from straw.replay.output import check_new, write_json
from straw.rig.tables import export_table
from straw.rig.tables.own_files import side_of


def run(args: argparse.Namespace) -> int:
    """Write the table, and report what it does not hold."""
    if not (args.csv or args.parquet):
        raise ReplayError("straw export: no output; give --csv T.csv or --parquet T.parquet")
    outputs = [path for path in (args.csv, args.csv and side_of(args.csv), args.parquet) if path]
    for path in outputs:
        check_new(path)
    rows, others = export_table(args.run, csv=args.csv, parquet=args.parquet, topics=args.topic)
    if args.json:
        write_json(args.json, {"rows": rows, "others": others, "files": [str(path) for path in outputs]})
    print(f"{', '.join(map(str, outputs))}: {rows} rows, one per message")
    where = side_of(args.csv).name if args.csv else "the Parquet file's metadata"
    more = f", and {others} messages that are no plain fields" if others else ""
    print(f"what a table cannot hold is in {where}: metadata, attachments, schemas{more}")
    return 0
