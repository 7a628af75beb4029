"""straw track: from a video to the tip's X, Z and Phi, as a recording on the run's clock."""

from __future__ import annotations

import argparse
import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np

from straw.model.kinematics import tip_pose
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.model.straw_file import load_straw
from straw.replay.compare.gather import read_whole
from straw.replay.errors import ReplayError
from straw.replay.film.expected import against_model
from straw.replay.film.steps import frames_to_show, steps_page, stretch_of
from straw.replay.film.track import as_csv, track_to_file
from straw.replay.output import write_json, write_text
from straw.replay.progress import prepare, progress_bar, say
from straw.rig.camera_clock import load_clock
from straw.rig.run import Run
from straw.tracking.board import Board
from straw.tracking.camera import Camera, load_camera, save_camera
from straw.tracking.chapters import Timeline, in_order
from straw.tracking.follow import Rest
from straw.tracking.reference import place_by_reference
from straw.tracking.task import Track


def run(args: argparse.Namespace) -> int:
    """Track the video; print how many frames are valid."""
    camera, board = load_camera(args.camera), board_of(args.board)
    if args.mount:
        camera = dataclasses.replace(camera, mount=args.mount)
    filmed = read_whole(args.run) if args.run else None
    if args.reference:
        camera = place_by_reference(in_order(args.videos), camera, args.reference)
    prepare()
    rest = rest_of(args.rest, filmed, camera, load_straw(args.straw))
    clock = load_clock(args.clock) if args.clock else None
    task: dict[str, Any] = {"level": args.level, "clock": clock, "near_px": pair(args.near) if args.near else None}
    task |= {"fps": args.fps, "mend": args.mend}
    task |= {name: value for name in ("from_s", "to_s") if (value := getattr(args, name)) is not None}
    outputs = [path for path in (args.csv, args.overlay, args.report, args.step, args.save_camera) if path]
    if args.step_frames != "doubtful":
        part = {name: task[name] for name in ("fps", "from_s", "to_s") if name in task}
        with Timeline(args.videos, **part) as film:  # refused before the work starts
            stretch_of(args.step_frames, film.expected)
    for path in outputs:
        check_folder(path)
    task |= {"board": board, "calibration": args.camera}
    tracked = track_to_file(args.videos, camera, rest, args.output, filmed, args.start, **task)
    assert tracked.record is not None
    if filmed:
        for line in against_model(filmed, tracked.trace, load_straw(args.straw), tracked.camera):
            say(f"{in_order(args.videos)[0].name}: {line}")
    try:
        if args.csv:
            write_text(args.csv, as_csv(tracked))
        if args.save_camera:
            save_camera(args.save_camera, tracked.camera)
        if args.report:
            from straw.replay.film.report import page  # matplotlib is slow to import

            write_text(args.report, page(tracked, [path.name for path in in_order(args.videos)]))
        if args.step:
            shown = frames_to_show(tracked, args.step_frames)
            write_text(args.step, steps_page(tracked, in_order(args.videos), shown))
        if args.overlay:
            from straw.tracking.overlay import write_overlay

            with progress_bar("overlay", "frame") as progress:
                write_overlay(args.overlay, args.videos, tracked, progress)
    finally:
        tracked.record.remove()
    if args.json:
        write_json(args.json, as_data(tracked, args.output))
    print(f"{summary(tracked)}; written to {', '.join(str(path) for path in (args.output, *outputs))}")
    return 0


def board_of(text: str) -> Board:
    """The board of ``SQUARES,SIDE`` or ``XxY,SIDE``, the side along x in mm; ReplayError for anything else."""
    counts, _, side = text.partition(",")
    try:
        x, _, y = counts.partition("x")
        return Board(int(x), float(side) / 1e3, int(y or 0))
    except ValueError:
        raise ReplayError(f"--board {text}: expected squares and side in mm, as 8,38.5 or 10x7,250") from None


def pair(text: str) -> tuple[float, float]:
    """Two numbers with a comma between."""
    try:
        u, v = (float(part) for part in text.split(","))
    except ValueError:
        raise ReplayError(f"--near {text}: expected U,V in px, as 960,540") from None
    return u, v


def check_folder(path: Path) -> None:
    """Raise ReplayError where a file could not be written, before the work starts."""
    if not path.parent.is_dir() or path.is_dir():
        raise ReplayError(f"{path}: cannot be written there; make the folder {path.parent} or choose another name")


def rest_of(text: str | None, filmed: Run | None, camera: Camera, straw: StrawParameters) -> Rest | None:
    """The tip's pose while still: as given, or the model's for the run's configuration; None if the camera's place is
    known. ReplayError where it is unknown.
    """
    if text is not None:
        try:
            x_mm, z_mm, phi_deg = (float(part) for part in text.split(","))
        except ValueError:
            raise ReplayError(f"--rest {text}: expected three numbers with commas between: mm, mm, deg") from None
        return x_mm / 1e3, z_mm / 1e3, math.radians(phi_deg)
    if camera.world_from_camera is not None:
        return None
    if filmed is None or filmed.initial_deployed is None:
        raise ReplayError(
            "the camera's place is unknown: give --rest X,Z,PHI, or --run with initial_deployed in its "
            "metadata, or --reference, or world_from_camera in the camera file"
        )
    return model_rest(straw, filmed.initial_deployed)


def model_rest(straw: StrawParameters, deployed: tuple[int, ...]) -> Rest:
    """Tip pose (m, m, rad) of a straw at rest."""
    return tip_pose(straw.constants(), rest_state(straw, deployed))


def summary(tracked: Track) -> str:
    """One sentence on how much of the video was tracked and how well."""
    valid = tracked.trace.valid
    return (
        f"{tracked.decode}; {np.count_nonzero(valid)} tracked, corner residual "
        f"{float(np.nanmedian(tracked.rms_px)):.3f} px"
    )


def as_data(tracked: Track, output: Path) -> dict[str, object]:
    """Summary of a track for JSON."""
    trace = tracked.trace
    sigmas = {name: float(np.nanmedian(getattr(trace, name))) for name in ("sigma_x_m", "sigma_z_m", "sigma_phi_rad")}
    return {
        "track": str(output),
        "frames": len(trace),
        "valid": int(np.count_nonzero(trace.valid)),
        "invalid": tracked.invalid,
        "by_hand": tracked.by_hand,
        "decode": dataclasses.asdict(tracked.decode),
        "corner_rms_px": float(np.nanmedian(tracked.rms_px)),
        **sigmas,
        "rest_frames": tracked.rest_frames,
        "board_turn_rad": tracked.camera.board_turn_rad,
        "board_turn_sigma_rad": tracked.turn_sigma_rad,
        "line_s": tracked.camera.line_s,
        "line_sigma_s": tracked.line_sigma_s,
        "exposure_s": tracked.exposure_s,
        "codec_lag_px": tracked.lag_px,
        "camera": str(tracked.telemetry),
    }
