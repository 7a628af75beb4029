"""Every action of straw runs, and its options; imports nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

from straw.replay.options import Parser, command, json_option


def runs_options(commands: argparse._SubParsersAction[Parser]) -> None:
    """Every action of ``straw runs``."""
    runs = commands.add_parser("runs", help="list, show, tag, compare and check recordings")
    actions = runs.add_subparsers(title="commands", metavar="COMMAND", required=True)

    def action(name: str, text: str, *, run: bool = True) -> argparse.ArgumentParser:
        p = command(actions, name, text, module="runs")
        p.set_defaults(action=name)
        p.add_argument("--dir", type=Path, default=Path(), metavar="DIR", help="where the recordings are (.)")
        if run:
            p.add_argument("run", metavar="RUN", help="its file, its run id, or the start of its SHA-256")
        return p

    p = action("list", "list recordings", run=False)
    p.add_argument("--tag", metavar="TAG", help="only with this tag")
    p.add_argument("--specimen", metavar="NAME", help="only of this specimen")
    p.add_argument(
        "--where", default="", metavar="FILTER", help="a filter, as 'specimen = straw-7 and (cycle > 20 or starred)'"
    )
    p.add_argument("--sort", metavar="COLUMN", help="a column or key of the metadata; --sort=-start: latest first")
    p.add_argument("--rebuild", action="store_true", help="read every file again")
    json_option(p)
    p = action("show", "show all that is known of a recording, or the tracks made with a calibration (CAMERA.json)")
    p.add_argument("--events", type=int, default=20, metavar="N", help="number of events (20)")
    json_option(p)
    p = action("tag", "tag a recording")
    p.add_argument("tags", nargs="+", metavar="TAG", help="single words")
    p.add_argument("--remove", action="store_true", help="remove the tags")
    for name, text in (
        ("star", "star a recording"),
        ("archive", "hide a recording from the lab's table; the file stays"),
        ("lock", "protect a recording from being archived"),
    ):
        p = action(name, text)
        p.add_argument("--remove", action="store_true", help="undo it")
    p = action("note", "write a note beside a recording")
    p.add_argument("text", nargs="+", metavar="TEXT", help="the note")
    p = action("attach", "add a run's video and other files to its manifest")
    p.add_argument("files", nargs="+", type=Path, metavar="FILE", help="files that belong to the run")
    p = action("compare", "compare two recordings", run=False)
    p.add_argument("runs", nargs=2, metavar="RUN", help="each by its file, run id, or the start of its SHA-256")
    json_option(p)
    p = action("verify", "check every file against its SHA-256", run=False)
    p.add_argument("runs", nargs="*", metavar="RUN", help="only these (all)")
    json_option(p)
    p = action("export", "write an RO-Crate with everything that belongs to a run")
    p.add_argument("-o", "--output", type=Path, required=True, metavar="CRATE", help="a new folder, or a .zip")
    p.add_argument("--licence", default="", metavar="TEXT", help="licence for the use by others")
    p = action("recover", "make a readable run of a .part or a damaged file", run=False)
    p.add_argument("run", type=Path, metavar="FILE", help="the .part, or the damaged recording")
    p.add_argument("-o", "--output", type=Path, metavar="RUN.mcap", help="the recovered run (its name without .part)")
    json_option(p)
