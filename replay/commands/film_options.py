"""Options of straw calibrate, track and clock; imports nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

from straw.replay.options import Parser, command, json_option, straw_options


def calibrate_command(commands: argparse._SubParsersAction[Parser]) -> None:
    """Register straw calibrate."""
    p = command(commands, "calibrate", "calibrate a lens from videos or stills of a checkerboard")
    p.add_argument("pictures", type=Path, nargs="+", metavar="VIDEO|IMAGE", help="videos or stills of a checkerboard")
    p.add_argument("-o", "--output", type=Path, required=True, metavar="CAMERA.json", help="the lens found")
    p.add_argument(
        "--board", metavar="CxR", help="squares along both sides (not inner corners); other grids are ignored"
    )
    p.add_argument("--name", default="", help="name of the lens (that of the output)")
    p.add_argument("--picture", type=Path, metavar="P.png", help="a map of the projection's uncertainty")
    json_option(p)


def track_command(commands: argparse._SubParsersAction[Parser]) -> None:
    """Register straw track."""
    p = command(commands, "track", "track the tip's X, Z and Phi in a video")
    p.add_argument("videos", type=Path, nargs="+", metavar="VIDEO", help="a file, or the chapters of one recording")
    p.add_argument(
        "--camera", type=Path, required=True, metavar="CAMERA.json", help="the lens, and its placement if known"
    )
    p.add_argument("-o", "--output", type=Path, required=True, metavar="TIP.mcap", help="the track, as a recording")
    p.add_argument(
        "--run", type=Path, metavar="RUN.mcap", help="the run that was filmed: gives clock, names and rest pose"
    )
    p.add_argument(
        "--start", type=float, default=0.0, metavar="S", help="time of the first frame, s after the run's zero (0)"
    )
    p.add_argument(
        "--fps", type=float, default=0.0, metavar="F", help="frame rate of filming, if saved as slow motion (as 240)"
    )
    p.add_argument(
        "--from",
        type=float,
        default=None,
        dest="from_s",
        metavar="S",
        help="skip what comes before, s after the run's zero",
    )
    p.add_argument("--to", type=float, default=None, dest="to_s", metavar="S", help="skip what comes after, likewise")
    p.add_argument(
        "--clock", type=Path, metavar="CLOCK.json", help="the camera's clock from straw clock, instead of --start"
    )
    p.add_argument(
        "--rest", metavar="X,Z,PHI", help="pose of the tip while at rest at the start, mm,mm,deg (from --run)"
    )
    p.add_argument(
        "--level", action="store_true", help="the camera stands level: measure phi at rest instead of taking it"
    )
    p.add_argument("--reference", type=Path, metavar="REF.json", help="a second, fixed board that places the camera")
    p.add_argument(
        "--board", default="8,38.5", metavar="N,MM", help="squares per side (or AxB), length of the side in mm (8,38.5)"
    )
    p.add_argument(
        "--mount",
        choices=("face", "side", "back"),
        help="where the board is: on the tip's face, or facing -Y (side) or +Y (back) (face)",
    )
    p.add_argument("--near", metavar="U,V", help="position of the board in the first frame, px, if there are several")
    p.add_argument(
        "--mend", type=Path, metavar="M.toml", help="corrections by hand: poses set or rejected, points to follow"
    )
    p.add_argument("--step", type=Path, metavar="S.html", help="a page for stepping through frames and writing M.toml")
    p.add_argument(
        "--step-frames", default="doubtful", metavar="A-B", help="frames of that page (those around doubtful ones)"
    )
    p.add_argument("--csv", type=Path, metavar="T.csv", help="the track as a table")
    p.add_argument("--overlay", type=Path, metavar="O.mp4", help="the video with corners, axes and figures drawn on it")
    p.add_argument("--report", type=Path, metavar="R.html", help="a page that shows how good the track is")
    p.add_argument(
        "--save-camera", type=Path, metavar="C.json", help="the camera with the placement and row time that were found"
    )
    straw_options(p, "the straw whose rest pose places the camera")
    json_option(p)


def clock_command(commands: argparse._SubParsersAction[Parser]) -> None:
    """Register straw clock."""
    p = command(commands, "clock", "find the camera's clock relative to the host's, from an LED or from the motion")
    p.add_argument("video", type=Path, metavar="VIDEO|TIP.mcap", help="a video with the LED in view, or a track")
    p.add_argument("--run", type=Path, required=True, metavar="RUN.mcap", help="the run that was filmed")
    p.add_argument("-o", "--output", type=Path, metavar="CLOCK.json", help="the clock, for straw track --clock")
    p.add_argument("--retimed", type=Path, metavar="OUT.mcap", help="the track with its times corrected")
    straw_options(p, "the straw whose motion is compared")
    json_option(p)
