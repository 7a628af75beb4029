"""straw track: from a video to the tip's X, Z and Phi, as a recording on the run's clock."""

from __future__ import annotations

import argparse
import dataclasses
import math
import time
from pathlib import Path

import numpy as np

from model.kinematics import tip_pose
from model.parameters import StrawParameters, load_straw
from model.rest import rest_state
from replay.errors import ReplayError
from replay.gather import read_whole
from replay.output import check_new, write_json
from replay.progress import prepare, progress_bar, say
from rig.camera_clock import CameraClock, load_clock
from rig.run import Run
from rig.run_derived import write_tip
from tracking.board import Board
from tracking.camera import Camera, load_camera
from tracking.track import Track, track

Pose = tuple[float, float, float]


def run(args: argparse.Namespace) -> int:
    """Track the video; say how much of it can be trusted."""
    camera = load_camera(args.camera)
    filmed = read_whole(args.run) if args.run else None
    prepare()
    rest = rest_of(args.rest, filmed, camera, load_straw(args.straw))
    clock = load_clock(args.clock) if args.clock else None
    tracked = track_to_file(args.video, camera, rest, args.output, filmed, args.start, clock)
    if args.json:
        write_json(args.json, as_data(tracked, args.output))
    print(f"{summary(tracked)}; written to {args.output}")
    return 0


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
            "metadata, or world_from_camera in the camera file"
        )
    return model_rest(straw, filmed.initial_deployed)


def model_rest(straw: StrawParameters, deployed: tuple[int, ...]) -> Pose:
    """Tip pose (m, m, rad) of a straw at rest."""
    return tip_pose(straw.constants(), rest_state(straw, deployed))


def track_to_file(
    video: Path,
    camera: Camera,
    rest: Pose | None,
    output: Path,
    filmed: Run | None,
    start_s: float,
    clock: CameraClock | None = None,
) -> Track:
    """Track a video and write the tip on the run's clock; without a run, on the wall clock of now."""
    check_new(output)
    with progress_bar(f"track {video.name}", "frame") as progress:
        tracked = track(video, camera, Board(), rest_pose=rest, start_s=0.0 if clock else start_s, progress=progress)
    if clock:
        trace = dataclasses.replace(tracked.trace, time_s=clock.host_s(tracked.trace.time_s))
        tracked = dataclasses.replace(tracked, trace=trace)
    metadata = dict(filmed.metadata) if filmed else {"run_id": video.stem}
    metadata |= {
        "video": video.name,
        "decode": str(tracked.decode),
        "clock": str(clock or f"first frame given at {start_s:g} s"),
    }
    if not filmed:
        say(f"{video.name}: without --run nothing says when it was filmed; its times count from now")
    zero_ns = filmed.zero_time_ns if filmed else time.time_ns()
    write_tip(output, tracked.trace, metadata, filmed.sha256 if filmed else "", zero_ns)
    if tracked.invalid:
        for reason, count in tracked.invalid.items():
            say(f"{video.name}: {count} frames without a trustworthy board: {reason}")
    return tracked


def summary(tracked: Track) -> str:
    """One sentence on how much of the video was tracked and how well."""
    valid = tracked.trace.valid
    return (
        f"{tracked.decode}; {np.count_nonzero(valid)} tracked, corner residual "
        f"{float(np.nanmedian(tracked.rms_px)):.3f} px"
    )


def as_data(tracked: Track, output: Path) -> dict[str, object]:
    """The account of a track for JSON."""
    decode = tracked.decode
    return {
        "track": str(output),
        "frames": len(tracked.trace),
        "valid": int(np.count_nonzero(tracked.trace.valid)),
        "invalid": dict(tracked.invalid),
        "decode": dataclasses.asdict(decode),
        "corner_rms_px": float(np.nanmedian(tracked.rms_px)),
    }
