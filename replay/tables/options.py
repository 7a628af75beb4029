"""Options of straw import and straw export; imports nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

#: Help of each role's flag. A test compares it with ``straw.rig.tables.roles.ROLES``.
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
    "valid": "0 or false where the tip is not valid",
    "frame": "number of the frame",
    "likelihood": "likelihood of a detection: the tip is valid from --least-likelihood on",
    "event": "text that becomes an event where it changes",
}
IMPORT = """Each column is named as its heading says, or by its number from 1; with its unit, as "P1 in mbar", where the
heading has none; with its file where several have it, as "tip.csv:Time in s"; "none" leaves a role out.

What is not stated is guessed from headings, their units and magnitudes. A guess is not written without confirmation:
the command prints its interpretation, draws it (RUN.import.png), lists each guess with the flag that would state it,
and ends with 1. State the guesses, or accept all with --yes. A unit in a heading or of a format (ESI is in mbar,
DeepLabCut in px), a flag and the mapping are no guesses. --dry-run shows the same and never writes.

Several tables make one run, each with its own clock: dates are aligned by themselves, clocks that count from 0 by
--offset (seconds after the run's 0 at which that table's 0 was). Tables of straw export are restored exactly and need
no flags. A mapping file says the same; --save-map writes one:

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
    _columns(p)
    _clocks(p)
    _format(p)
    _metadata(p)
    p.add_argument("--straw", type=Path, metavar="S.toml", help='a straw file whose readers = ["R.py"] are used')
    p.add_argument("--map", type=Path, metavar="M.toml", help="a mapping file; options override it")
    p.add_argument("--save-map", type=Path, metavar="M.toml", help="write the interpretation as a mapping file")
    p.add_argument("--as-stated", action="store_true", help="trust stated units although the values look implausible")
    p.add_argument("--yes", action="store_true", help="accept the guesses and write")
    p.add_argument("--dry-run", action="store_true", help="print and draw the interpretation, write no recording")
    p.add_argument(
        "--picture",
        type=Path,
        metavar="P.png",
        help="drawing of the interpretation (RUN.import.png where nothing is written)",
    )


def _columns(p: argparse.ArgumentParser) -> None:
    """Which column is what."""
    columns = p.add_argument_group("which column is what")
    for role, text in COLUMNS.items():
        columns.add_argument(
            f"--{role.replace('_', '-')}", dest=f"as_{role}", action="append", default=[], metavar="COLUMN", help=text
        )
    columns.add_argument("--points", nargs=2, metavar=("NEAR", "FAR"), help="x, z, phi from two points of a video")
    columns.add_argument("--points-unit", metavar="UNIT", help="unit of their coordinates, where the file does not say")
    columns.add_argument(
        "--least-likelihood", type=float, metavar="P", help="likelihood from which a point is valid (0.6)"
    )
    columns.add_argument("--mm-per-px", type=float, metavar="MM", help="scale of columns in px")
    columns.add_argument("--origin-px", metavar="U,V", help="the middle of the straw's base in the picture")
    columns.add_argument(
        "--tip-offset", type=float, metavar="MM", help="distance from the tip's face to the tracked point (0)"
    )


def _clocks(p: argparse.ArgumentParser) -> None:
    """Clocks of the tables."""
    clock = p.add_argument_group("clocks")
    clock.add_argument(
        "--rate",
        action="append",
        default=[],
        metavar="HZ",
        help="samples or frames per second, where there is no column of time",
    )
    clock.add_argument(
        "--offset", action="append", default=[], metavar="S", help="added to the times of a table; TABLE:S"
    )
    clock.add_argument("--start", default="", metavar="DATE", help='date of the run\'s zero, as "2026-05-03 14:02:11"')
    clock.add_argument("--time-zone", default="", metavar="ZONE", help="of dates without one: Europe/Berlin, +02:00")
    clock.add_argument("--date-order", choices=("dmy", "mdy"), help="order of dates like 3/4/2026")
    clock.add_argument(
        "--back", metavar="HOW", help="where time runs backwards: drop, sort, wrap (a counter), part:N; TABLE:HOW"
    )


def _format(p: argparse.ArgumentParser) -> None:
    """Format of the file, where it is not recognised."""
    written = p.add_argument_group("format of the file, where it is not recognised")
    written.add_argument(
        "--format", metavar="NAME", help="csv, esi, kinovea, tracker, deeplabcut, parquet, mat; or R.py"
    )
    written.add_argument("--separator", metavar="C", help="a character, or tab, semicolon, comma, bar, space")
    written.add_argument("--decimal", choices=(".", ","), help="decimal mark")
    written.add_argument(
        "--thousands",
        metavar="C",
        help="mark between thousands (if equal to the decimal mark, the last one is decimal)",
    )
    written.add_argument("--encoding", metavar="NAME", help="as latin-1 (detected)")
    written.add_argument("--skip", type=int, default=0, metavar="LINES", help="lines to skip at the top")


def _metadata(p: argparse.ArgumentParser) -> None:
    """What the run was."""
    run = p.add_argument_group("what the run was")
    run.add_argument("--specimen", metavar="NAME", help="which straw")
    run.add_argument("--deployed", metavar="CELLS", help='cells deployed at the start, as 1,4; "none"')
    run.add_argument("--cycle", type=int, metavar="N", help="number of earlier cycles")
    run.add_argument("--cells", type=int, metavar="N", help="number of cells (9)")
    run.add_argument("--run-id", metavar="NAME", help="name of the run (the file's)")
    run.add_argument("--meta", action="append", default=[], metavar="KEY=VALUE", help="any other fact, for the record")


def export_options(p: argparse.ArgumentParser) -> None:
    """Options of straw export."""
    p.add_argument("run", type=Path, metavar="RUN.mcap", help="the recording")
    p.add_argument(
        "--csv", type=Path, metavar="T.csv", help="one row per message; T.csv.json beside it holds what a table cannot"
    )
    p.add_argument("--parquet", type=Path, metavar="T.parquet", help="the same in one file")
    p.add_argument(
        "--topic", action="append", default=[], metavar="TOPIC", help="only this topic, as /tip/state; may repeat"
    )
