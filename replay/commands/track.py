"""straw track: from a video to the tip's X, Z and Phi, as a recording on the run's clock."""

from __future__ import annotations

import argparse
import dataclasses
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.kinematics import tip_pose
from model.parameters import StrawParameters, load_straw
from model.rest import rest_state
from replay.errors import ReplayError
from replay.gather import read_whole
from replay.output import check_new, write_json, write_text
from replay.progress import prepare, progress_bar, say
from rig.camera_clock import CameraClock, load_clock
from rig.run import Run
from rig.run_track import write_track
from tracking.board import Board
from tracking.camera import Camera, camera_json, load_camera, save_camera
from tracking.chapters import in_order, siblings
from tracking.reference import place_by_reference
from tracking.task import Track
from tracking.track import track

Pose = tuple[float, float, float]
_MISFIT, _MISFIT_PX = 3.0, 0.1  # how much more than a board by itself, and at least, tells of a wrong lens or place


def run(args: argparse.Namespace) -> int:
    """Track the video; say how much of it can be trusted."""
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
    outputs = [path for path in (args.csv, args.overlay, args.report, args.save_camera) if path]
    for path in outputs:
        check_folder(path)
    tracked = track_to_file(args.videos, camera, rest, args.output, filmed, args.start, board=board, **task)
    assert tracked.record is not None
    try:
        if args.csv:
            write_text(args.csv, as_csv(tracked))
        if args.save_camera:
            save_camera(args.save_camera, tracked.camera)
        if args.report:
            from replay.track_report import page  # matplotlib takes its time

            write_text(args.report, page(tracked, [path.name for path in in_order(args.videos)]))
        if args.overlay:
            from tracking.overlay import write_overlay

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
    """Raise ReplayError where a file could not be written: before the work, not after it."""
    if not path.parent.is_dir() or path.is_dir():
        raise ReplayError(f"{path}: cannot be written there; make the folder {path.parent} or choose another name")


def rest_of(text: str | None, filmed: Run | None, camera: Camera, straw: StrawParameters) -> Pose | None:
    """The tip's pose while still: as given, or the model's for the run's configuration; None if the camera's place is
    known. ReplayError where nothing says it.
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
            "nothing says where the camera stands: give --rest X,Z,PHI, or --run with initial_deployed in its "
            "metadata, or --reference, or world_from_camera in the camera file"
        )
    return model_rest(straw, filmed.initial_deployed)


def model_rest(straw: StrawParameters, deployed: tuple[int, ...]) -> Pose:
    """Tip pose (m, m, rad) of a straw at rest."""
    return tip_pose(straw.constants(), rest_state(straw, deployed))


def track_to_file(
    videos: Sequence[Path] | Path,
    camera: Camera,
    rest: Pose | None,
    output: Path,
    filmed: Run | None,
    start_s: float,
    *,
    board: Board | None = None,
    clock: CameraClock | None = None,
    **task: Any,
) -> Track:
    """Track a video and write the tip on the run's clock; without a run, on the wall clock of now.

    The track's record is left open, for more to be made of it; an interrupted one stays beside ``output``.
    """
    check_new(output)
    files = in_order([videos] if isinstance(videos, Path) else videos)
    record = output.with_name(output.name + ".corners")
    if beside := siblings(files):
        say(f"{files[0].name}: {', '.join(path.name for path in beside)} beside it belong to it; name all to join them")
    with progress_bar(f"track {files[0].name}", "frame") as progress:
        try:
            known: dict[str, Any] = {"rest_pose": rest, "start_s": 0.0 if clock else start_s, "record": record}
            tracked = track(files, camera, board or Board(), progress=progress, **known, **task)
        except KeyboardInterrupt:
            say(f"{files[0].name}: what was tracked is kept in {record}; the same command goes on from there")
            raise
    if clock:
        trace = dataclasses.replace(tracked.trace, time_s=clock.host_s(tracked.trace.time_s))
        tracked = dataclasses.replace(tracked, trace=trace)
    assert tracked.record is not None
    metadata = dict(filmed.metadata) if filmed else {"run_id": files[0].stem}
    metadata |= {
        "video": ", ".join(path.name for path in files),
        "decode": str(tracked.decode),
        "clock": str(clock or f"first frame given at {start_s:g} s"),
        "camera": str(tracked.telemetry),
    }
    if not filmed:
        say(f"{files[0].name}: without --run nothing says when it was filmed; its times count from now")
    zero_ns = filmed.zero_time_ns if filmed else time.time_ns()
    try:
        write_track(
            output,
            tracked.trace,
            quality(tracked),
            corners(tracked),
            lens_of(tracked.camera),
            metadata,
            {"camera.json": camera_json(tracked.camera).encode()},
            filmed.sha256 if filmed else "",
            zero_ns,
        )
    except BaseException:
        tracked.record.close()
        raise
    own_px = float(np.median(np.concatenate([rows["rms_px"][rows["seen"]] for _, rows in tracked.record.chunks()])))
    left_px = float(np.nanmedian(tracked.rms_px))
    if left_px > max(_MISFIT * own_px, _MISFIT_PX):
        what = f"corners miss the plane of motion by {left_px:.2f} px, one another by {own_px:.2f} px"
        say(f"{files[0].name}: {what}: check the lens, the rest pose, the board's size and its mount")
    for reason, count in tracked.invalid.items():
        say(f"{files[0].name}: {count} frames without a trustworthy board: {reason}")
    return tracked


def quality(tracked: Track) -> dict[str, Any]:
    """The columns of ``/tip/quality``."""
    assert tracked.record is not None
    kept: list[tuple[NDArray[Any], ...]] = []
    for _, rows in tracked.record.chunks():
        reasons = [reason.decode() for reason in rows["reason"]]
        kept.append((rows["contrast"], rows["widths"].max(axis=1), np.array(reasons, dtype=object)))
    contrast, blur, reason = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    said = np.where((reason == "") & ~tracked.trace.valid, "the corners fit no pose, or a repeated picture", reason)
    grades = {"rms_px": tracked.rms_px, "corners": tracked.corners, "contrast": contrast.astype(float)}
    return {**grades, "blur_px": blur.astype(float), "reason": said}


def corners(tracked: Track) -> Iterator[tuple[NDArray[np.float64], NDArray[np.bool_]] | None]:
    """Each frame's corners and which were used; None where the board was not seen."""
    assert tracked.record is not None
    for _, rows in tracked.record.chunks():
        for row in rows:
            yield (row["grid"].reshape(-1, 2), row["used"].ravel()) if row["seen"] else None


def lens_of(camera: Camera) -> tuple[tuple[int, int], str, Sequence[float], NDArray[np.float64]]:
    """A lens as viewers know it: picture size, distortion model in ROS's words, coefficients, matrix."""
    lens = camera.lens
    model = "kannala_brandt" if lens.kind == "fisheye" else "plumb_bob"
    matrix = np.array(((lens.fx, 0, lens.cx), (0, lens.fy, lens.cy), (0, 0, 1.0)))
    return (lens.width, lens.height), model, lens.distortion, matrix


def as_csv(tracked: Track) -> str:
    """The track as a table: SI, one line a frame, empty where not valid."""
    trace = tracked.trace
    names = ("frame", "time_s", "valid", "x_m", "z_m", "phi_rad", "sigma_x_m", "sigma_z_m", "sigma_phi_rad")
    columns = [getattr(trace, name).tolist() for name in names] + [tracked.rms_px.tolist(), tracked.corners.tolist()]
    lines = [",".join((*names, "rms_px", "corners"))]
    for frame, time_s, valid, *rest in zip(*columns, strict=True):
        numbers = ("" if isinstance(value, float) and math.isnan(value) else f"{value:.9g}" for value in rest)
        lines.append(",".join((str(frame), f"{time_s:.9f}", str(int(valid)), *numbers)))
    return "\n".join(lines) + "\n"


def summary(tracked: Track) -> str:
    """One sentence on how much of the video was tracked and how well."""
    valid = tracked.trace.valid
    return (
        f"{tracked.decode}; {np.count_nonzero(valid)} tracked, corner residual "
        f"{float(np.nanmedian(tracked.rms_px)):.3f} px"
    )


def as_data(tracked: Track, output: Path) -> dict[str, object]:
    """The account of a track for JSON."""
    trace = tracked.trace
    sigmas = {name: float(np.nanmedian(getattr(trace, name))) for name in ("sigma_x_m", "sigma_z_m", "sigma_phi_rad")}
    return {
        "track": str(output),
        "frames": len(trace),
        "valid": int(np.count_nonzero(trace.valid)),
        "invalid": dict(tracked.invalid),
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
