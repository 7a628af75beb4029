"""The ``straw`` command: parses the command line; nothing heavy is imported until a command runs."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from pathlib import Path

from straw.model.plugged import add_laws, files_named_in, laws_named_in, straw_of_rig
from straw.replay.commands.rig_options import drive_options
from straw.replay.commands.runs_options import runs_options
from straw.replay.errors import USER_ERRORS
from straw.replay.investigate.options import investigate_options
from straw.replay.options import (
    Parser,
    VersionAction,
    command,
    identified_options,
    json_option,
    rig_options,
    straw_options,
    whole_number,
    workers_options,
)
from straw.replay.shell.options import design_options, shell_options, solid_options
from straw.replay.tables.options import export_options, import_options


def parser() -> argparse.ArgumentParser:
    """Every command and its options."""
    top = Parser(
        prog="straw", description="Drive, film, track, compare and diagnose inflatable multistable structures."
    )
    top.add_argument("--version", action=VersionAction, nargs=0, help="the version, and in a clone the commit")
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)

    p = command(commands, "demo", "the whole loop without hardware: drive, film, track, compare, diagnose")
    p.add_argument("--out", type=Path, default=Path("demo"), metavar="DIR", help="folder for all results (demo)")
    p.add_argument("--measured", action="store_true", help="diagnose a measured recording instead")
    p.add_argument("--seed", type=whole_number, default=1, help="seed of the noise and of what is concealed (1)")
    json_option(p)

    p = command(commands, "simulate", "predict what a straw does under a protocol")
    straw_options(p)
    p.add_argument("--protocol", type=Path, required=True, metavar="P.toml")
    p.add_argument("-o", "--output", type=Path, required=True, metavar="OUT.mcap", help="the prediction")
    p.add_argument("--from", type=float, dest="start", metavar="S", help="start of the output, s after the run's zero")
    p.add_argument("--to", type=float, dest="end", metavar="S", help="end of the output, likewise")
    json_option(p)

    drive_options(commands)

    p = command(commands, "calibrate", "calibrate a lens from videos or stills of a checkerboard")
    p.add_argument("pictures", type=Path, nargs="+", metavar="VIDEO|IMAGE")
    p.add_argument("-o", "--output", type=Path, required=True, metavar="CAMERA.json")
    p.add_argument(
        "--board", metavar="CxR", help="squares along both sides (not inner corners); other grids are ignored"
    )
    p.add_argument("--name", default="", help="name of the lens (that of the output)")
    p.add_argument("--picture", type=Path, metavar="P.png", help="a map of the projection's uncertainty")
    json_option(p)

    runs_options(commands)
    p = command(commands, "import", "make a recording from the tables of another logger", module="import_")
    import_options(p)
    json_option(p)
    p = command(commands, "export", "write a recording as a table, which straw import reads back bit for bit")
    export_options(p)
    json_option(p)

    p = command(commands, "lab", "serve the catalogue and the operator's panel as a local page")
    p.add_argument(
        "folder", nargs="?", metavar="FOLDER", help="folder of the recordings (the rig's, else the current one)"
    )
    p.add_argument("--rig", type=Path, metavar="rig.toml", help="description of the rig")
    p.add_argument(
        "--emulate", action="store_true", help="no hardware: every run on an emulator with the straw behind it"
    )
    p.add_argument(
        "--listen", default="127.0.0.1:0", metavar="HOST:PORT", help="where to serve (127.0.0.1, any free port)"
    )
    p.add_argument("--remote", action="store_true", help="allow an address in --listen that other machines can reach")
    p.add_argument("--no-browser", action="store_true", help="print the address without opening a browser")

    p = command(
        commands,
        "investigate",
        "diagnose, run the most informative next experiment, and repeat until there is an answer",
    )
    p.add_argument(
        "folder", nargs="?", metavar="FOLDER", help="folder of the recordings (the rig's, else the current one)"
    )
    rig_options(p)
    investigate_options(p)
    straw_options(p, "the base model, whose own constants are refitted")
    json_option(p)

    p = command(commands, "track", "track the tip's X, Z and Phi in a video")
    p.add_argument("videos", type=Path, nargs="+", metavar="VIDEO", help="a file, or the chapters of one recording")
    p.add_argument(
        "--camera", type=Path, required=True, metavar="CAMERA.json", help="the lens, and its placement if known"
    )
    p.add_argument("-o", "--output", type=Path, required=True, metavar="TIP.mcap")
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

    identify = commands.add_parser("identify", help="determine constants of a straw from measurements")
    kinds = identify.add_subparsers(title="commands", metavar="COMMAND", required=True)
    p = command(kinds, "filling", "the channel's radius from a table of filling tests", module="identify")
    p.add_argument(
        "table", type=Path, metavar="TABLE.csv", help="columns volume_m3, pressure_difference_pa, filling_time_s"
    )
    identified_options(p)
    p = command(
        kinds, "geometry", "the frusta's zeta_01, zeta_02, h and E from lengths and snap pressures", module="identify"
    )
    for name, text in (
        ("folded-length-mm", "length of a folded cell"),
        ("deployed-length-mm", "length of a deployed cell"),
        ("fold-pressure-kpa", "gauge pressure at which cell 1 folds, all others folded"),
        ("deploy-pressure-kpa", "gauge pressure at which cell 1 deploys, all others deployed"),
    ):
        p.add_argument(f"--{name}", type=float, required=True, metavar="VALUE", help=text)
    p.add_argument(
        "--length-resolution-mm", type=float, default=0.01, metavar="MM", help="resolution of the caliper (0.01)"
    )
    p.add_argument(
        "--pressure-step-kpa",
        type=float,
        default=0.5,
        metavar="KPA",
        help="step in which the pressure was raised (0.5)",
    )
    p.add_argument("--whole-straw", action="store_true", help="let the other cells move with the pressure as well")
    identified_options(p)

    p = command(
        kinds, "runs", "damping c_zeta, c_phi and radius r_ch from recordings, fitted jointly", module="identify"
    )
    p.add_argument("runs", type=Path, nargs="+", metavar="RUN.mcap", help="runs, and tracks derived from them")
    p.add_argument(
        "--each",
        action="store_true",
        help="fit each run by itself as well: constants that differ point to missing physics",
    )
    workers_options(p)
    identified_options(p)

    p = command(
        commands, "diagnose", "find what the model leaves out, or which instrument is wrong, and show the improvement"
    )
    p.add_argument(
        "runs",
        type=Path,
        nargs="+",
        metavar="RUN.mcap",
        help="runs of one specimen and their tracks; with --system, its tables",
    )
    straw_options(p, "the base model, whose own constants are refitted")
    p.add_argument("--system", type=Path, metavar="S.py", help="a system of your own instead of a straw")
    p.add_argument(
        "--hold-out",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help="with --system: recordings that no fit sees",
    )
    p.add_argument(
        "--given",
        action="append",
        default=[],
        metavar="C=VALUE,LOW,HIGH",
        help="with --system: a constant known better than the file says",
    )
    p.add_argument(
        "--tolerance",
        metavar="x=0.1mm,phi=2mrad",
        help="RMS misfit that is good enough, by channel or as a share of the motion: 2%%",
    )
    p.add_argument("--report", type=Path, metavar="R.html", help="a page with the verdict and its evidence")
    p.add_argument("-o", "--output", type=Path, metavar="S.toml", help="the improved straw")
    p.add_argument(
        "--experiment",
        type=Path,
        metavar="P.toml",
        help="the protocol that would distinguish the hypotheses that survive",
    )
    p.add_argument(
        "--without", nargs="+", action="extend", default=[], metavar="CAUSE", help="leave causes out of the library"
    )
    workers_options(p)
    p.add_argument("--partial", action="store_true", help="use what is readable of damaged or cut recordings")
    json_option(p)

    p = command(commands, "paper", "print the paper's numbers beside the model's, and redraw its figures")
    p.add_argument("--out", type=Path, default=Path("paper"), metavar="DIR", help="folder for the figures (paper)")
    p.add_argument(
        "--shell", action="store_true", help="repeat the paper's finite elements as well (Figs. 4 b, c, S2; minutes)"
    )
    p.add_argument(
        "--filling", type=Path, metavar="TABLE.csv", help="filling tests (the shipped sample, which is synthetic)"
    )
    json_option(p)

    p = command(commands, "shell", "compute a frustum or a cell by finite elements, beside equation 7")
    shell_options(p)
    straw_options(p)
    json_option(p)
    p = command(commands, "design", "search geometries with wanted snap pressures, lengths and stable states")
    design_options(p)
    straw_options(p, "constants that are not varied")
    json_option(p)
    p = command(commands, "solid", "write the straw as a body for a printer (STL) or a mould (STEP)")
    solid_options(p)
    straw_options(p)

    p = command(commands, "check", "check a law, or another part of your own, against its contract")
    p.add_argument("part", type=Path, metavar="PART.py", help="a LAW, CONTROLLER, READER, FIGURE, or a system")
    p.add_argument("--on", type=Path, metavar="TABLE", help="a table of its logger, for a reader to be tried on")
    p.add_argument("--run", action="store_true", help="run the straw with the law as well: compiles, a minute or two")
    json_option(p)

    p = command(
        commands, "terms", "list the laws that can be added to a straw, and their effect on the paper's two runs"
    )
    json_option(p)

    p = command(commands, "clock", "find the camera's clock relative to the host's, from an LED or from the motion")
    p.add_argument("video", type=Path, metavar="VIDEO|TIP.mcap", help="a video with the LED in view, or a track")
    p.add_argument("--run", type=Path, required=True, metavar="RUN.mcap", help="the run that was filmed")
    p.add_argument("-o", "--output", type=Path, metavar="CLOCK.json", help="the clock, for straw track --clock")
    p.add_argument("--retimed", type=Path, metavar="OUT.mcap", help="the track with its times corrected")
    straw_options(p, "the straw whose motion is compared")
    json_option(p)

    p = command(commands, "replay", "compare recordings with the model's prediction: metrics and a page")
    p.add_argument("runs", type=Path, nargs="+", metavar="RUN.mcap", help="runs, and tracks derived from them")
    straw_options(p)
    p.add_argument("--figures", type=Path, nargs="+", default=[], metavar="F.py", help="figures of merit of your own")
    p.add_argument("--report", type=Path, default=Path("replay.html"), metavar="R.html", help="the page (replay.html)")
    p.add_argument("--partial", action="store_true", help="use what is readable of damaged or cut recordings")
    p.add_argument(
        "--fitted", nargs="+", default=[], metavar="RUN|JSON", help="runs that went into a fit, or the fit's JSON"
    )
    p.add_argument(
        "--uncertain",
        action="append",
        default=[],
        metavar="NAME=SIGMA",
        help="standard uncertainty of a constant, SI, as r_ch_m=2e-6",
    )
    p.add_argument(
        "--protocol",
        type=Path,
        nargs="?",
        const=Path(),
        metavar="P.toml",
        help="also run the protocol on the emulator and the model, and overlay all three (the recording's own)",
    )
    p.add_argument("--png", type=Path, metavar="P.png", help="the comparison as a figure (png, svg or pdf)")
    p.add_argument("--video", type=Path, nargs="+", metavar="VIDEO", help="the run's video, shown beside the straw")
    p.add_argument("--camera", type=Path, metavar="C.json", help="the camera with its placement (that of the track)")
    p.add_argument(
        "--predictions", type=Path, metavar="DIR", help="write each run's prediction as a recording on the run's clock"
    )
    json_option(p)
    return top


def plug(args: argparse.Namespace) -> None:
    """Register the user's own laws before a command loads the model: those named, and those of the straw file."""
    straw, rig = getattr(args, "straw", None), getattr(args, "rig", None)
    named = [*getattr(args, "laws", [])]
    if isinstance(rig, Path) and straw is None:
        straw = straw_of_rig(rig)
    if isinstance(straw, Path):
        named += laws_named_in(straw)
    if named:
        add_laws(*named)
    if isinstance(straw, Path) and (readers := files_named_in(straw, "readers")):
        from straw.rig.tables.reader import add_readers

        add_readers(*readers)
    figures = [*getattr(args, "figures", []), *(files_named_in(straw, "figures") if isinstance(straw, Path) else [])]
    if figures:
        from straw.replay.metrics.merit import add_figures

        add_figures(*figures)


def main(argv: list[str] | None = None) -> int:
    """Run one command; 0 ok, 1 the answer is no, 2 bad input in one line, 130 interrupted."""
    args = parser().parse_args(argv)
    try:
        plug(args)
        return int(importlib.import_module(f"straw.replay.commands.{args.module}").run(args))
    except USER_ERRORS as error:
        print(f"straw: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("straw: interrupted; what was finished is kept", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output has ended, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


if __name__ == "__main__":
    sys.exit(main())
