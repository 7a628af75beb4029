"""Options of straw import and straw export; imports nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

#: By role: what its flag says in the help. A test holds it against ``straw.rig.tables.roles.ROLES``.
COLUMNS = {
    "time": "time: numbers, dates, times of day, Kinovea's time code",
    "command": "commanded gauge pressure; repeated: channels 1, 2, ...",
    "pressure": "measured gauge pressure; repeated: channels 1, 2, ...",
    "flow": "flow",
    "x": "tip, horizontal",
    "z": "tip, upwards",
    "phi": "tip's angle from upright, towards X",
    "sigma_pressure": "standard deviation of the pressure (also --sigma-x, --sigma-z, --sigma-phi)",
    "sigma_x": argparse.SUPPRESS,
    "sigma_z": argparse.SUPPRESS,
    "sigma_phi": argparse.SUPPRESS,
    "valid": "0 or false where the tip is not to be trusted",
    "frame": "number of the frame",
    "likelihood": "a column of chances: the tip is valid from --least-likelihood on",
    "event": "words to be kept as events, where they change",
}
IMPORT = """Each column is named as its heading says, or by its number from 1; with its unit, as "P1 in mbar", where the
heading has none; with its file where several have it, as "tip.csv:Time in s"; "none" leaves a role out.

What nobody states is guessed from headings, units in them and sizes. A guess is never written unasked: the command
prints what it understood, draws it (RUN.import.png), lists each guess with the flag that would state it, and ends
with 1. State them, or take them all with --yes. What a heading says of its unit, what a format says (ESI is in mbar,
DeepLabCut in px), a flag or the mapping is no guess. --dry-run shows the same and never writes.

Several tables make one run, each with its own clock: dates are laid over each other, clocks that count from 0 by
--offset (seconds after the run's 0 at which that table's 0 was). What straw export wrote comes back bit for bit and
needs no flag. A mapping file says the same; --save-map writes one:

  specimen = "straw-7"
  initial_deployed = [1, 4]
  time_zone = "Europe/Berlin"
  [[table]]
  file = "esi.txt"
  time = "Time in s"
  pressure = { column = "P1", unit = "mbar", zero = 1.5 }  # (value - zero) * factor
  [[table]]
  file = "tip.csv"
  rate_hz = 240                    # frames, no time
  offset_s = 0.132
  points = ["mount", "tip"]        # two points along the tip's axis
  mm_per_px = 0.11
  origin_px = [960, 1010]          # the middle of the straw's base
"""


def import_options(p: argparse.ArgumentParser) -> None:
    """Options of straw import."""
    p.formatter_class = argparse.RawDescriptionHelpFormatter
    p.epilog = IMPORT
    p.add_argument("tables", type=Path, nargs="+", metavar="TABLE", help="CSV, TSV, Parquet, ESI, Kinovea, Tracker, "
                   "DeepLabCut (CSV, H5), MAT, or what straw export wrote")  # fmt: skip
    p.add_argument("-o", "--output", type=Path, metavar="RUN.mcap", help="the recording (not with --dry-run)")
    columns = p.add_argument_group("which column is what")
    for role, text in COLUMNS.items():
        columns.add_argument(
            f"--{role.replace('_', '-')}", dest=f"as_{role}", action="append", default=[], metavar="COLUMN", help=text
        )
    columns.add_argument("--points", nargs=2, metavar=("NEAR", "FAR"), help="x, z, phi from two points of a video")
    columns.add_argument("--points-unit", metavar="UNIT", help="of their coordinates, where the file does not say")
    columns.add_argument("--least-likelihood", type=float, metavar="P", help="from here on a point is valid (0.6)")
    columns.add_argument("--mm-per-px", type=float, metavar="MM", help="scale of what is in px")
    columns.add_argument("--origin-px", metavar="U,V", help="the middle of the straw's base in the picture")
    columns.add_argument("--tip-offset", type=float, metavar="MM", help="from the tip's face to what was tracked (0)")
    clock = p.add_argument_group("clocks")
    clock.add_argument("--rate", action="append", default=[], metavar="HZ", help="samples or frames a second: no time")
    clock.add_argument("--offset", action="append", default=[], metavar="S", help="added to its times; TABLE:S")
    clock.add_argument("--start", default="", metavar="DATE", help='when the run\'s 0 was, as "2026-05-03 14:02:11"')
    clock.add_argument("--time-zone", default="", metavar="ZONE", help="of dates that say none: Europe/Berlin, +02:00")
    clock.add_argument("--date-order", choices=("dmy", "mdy"), help="of 3/4/2026")
    clock.add_argument("--back", metavar="HOW", help="time runs back: drop, sort, wrap (a counter), part:N; TABLE:HOW")
    written = p.add_argument_group("how the file is written, where that is not found out")
    written.add_argument(
        "--format",
        metavar="NAME",
        help="csv, esi, kinovea, tracker, deeplabcut, parquet, mat; or R.py",
    )
    written.add_argument("--separator", metavar="C", help="a character, or tab, semicolon, comma, bar, space")
    written.add_argument("--decimal", choices=(".", ","), help="decimal mark")
    written.add_argument(
        "--thousands", metavar="C", help="mark between thousands; the decimal mark: then the last is one"
    )
    written.add_argument("--encoding", metavar="NAME", help="as latin-1 (found out)")
    written.add_argument("--skip", type=int, default=0, metavar="LINES", help="lines on top to pass over")
    run = p.add_argument_group("what the run was")
    run.add_argument("--specimen", metavar="NAME", help="which straw")
    run.add_argument("--deployed", metavar="CELLS", help='cells deployed at the start, as 1,4; "none"')
    run.add_argument("--cycle", type=int, metavar="N", help="how often it was cycled before")
    run.add_argument("--cells", type=int, metavar="N", help="how many cells it has (9)")
    run.add_argument("--run-id", metavar="NAME", help="its name (the file's)")
    run.add_argument("--meta", action="append", default=[], metavar="KEY=VALUE", help="any other fact, for the record")
    p.add_argument("--straw", type=Path, metavar="S.toml", help='whose readers = ["R.py"] are known, too')
    p.add_argument("--map", type=Path, metavar="M.toml", help="a mapping file; flags go before it")
    p.add_argument("--save-map", type=Path, metavar="M.toml", help="write what was understood as a mapping file")
    p.add_argument("--as-stated", action="store_true", help="believe units although sizes look wrong")
    p.add_argument("--yes", action="store_true", help="the guesses are right: write")
    p.add_argument("--dry-run", action="store_true", help="print and draw, write no recording")
    p.add_argument(
        "--picture", type=Path, metavar="P.png", help="what would be written (RUN.import.png, if not written)"
    )


def export_options(p: argparse.ArgumentParser) -> None:
    """Options of straw export."""
    p.add_argument("run", type=Path, metavar="RUN.mcap")
    p.add_argument(
        "--csv", type=Path, metavar="T.csv", help="one row a message; beside it T.csv.json: what no table holds"
    )
    p.add_argument("--parquet", type=Path, metavar="T.parquet", help="the same in one file")
    p.add_argument("--topic", action="append", default=[], metavar="TOPIC", help="only this, as /tip/state; may repeat")
