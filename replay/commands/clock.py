"""straw clock: how the camera's clock runs against the host's, from the LED burst or from the motion."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterator

from straw.model.straw_file import load_straw
from straw.replay.compare.gather import read_whole
from straw.replay.errors import ReplayError
from straw.replay.film.clock_motion import clock_from_motion
from straw.replay.output import check_new, write_json
from straw.replay.progress import prepare, progress_bar, say
from straw.rig.camera_clock import CameraClock, bursts_of, clock_data, fit_led
from straw.rig.run import Run
from straw.rig.run_derived import write_tip
from straw.tracking.lamp import blocks_of, find_blinks
from straw.tracking.video import Frame, VideoReader


def run(args: argparse.Namespace) -> int:
    """Fit, print and write the clock."""
    recorded = read_whole(args.run)
    if args.video.suffix == ".mcap":
        clock = from_track(args, recorded)
    else:
        if args.retimed:
            raise ReplayError("--retimed corrects a track; give TIP.mcap in place of the video, or track with --clock")
        clock = from_video(args, recorded)
    for path in filter(None, (args.output, args.json)):
        write_json(path, clock_data(clock))
    print(clock)
    return 0


def from_video(args: argparse.Namespace, recorded: Run) -> CameraClock:
    """The LED's bursts, found in the video."""
    bursts = [times for times, _ in bursts_of(recorded)]
    with VideoReader(args.video) as video, progress_bar(f"look through {args.video.name}", "frame") as progress:

        def watched() -> Iterator[Frame]:
            for frame in video.frames():
                progress(frame.index + 1, video.expected)
                yield frame

        blocks = blocks_of(watched())
    blinks = find_blinks(blocks, bursts)
    say(f"the LED is at column {blinks.column_px}, row {blinks.row_px}; correlation {blinks.correlation:.2f}")
    return fit_led(recorded, blinks)


def from_track(args: argparse.Namespace, recorded: Run) -> CameraClock:
    """The motion of a track, against the model's prediction of the run."""
    tracked = read_whole(args.video)
    if tracked.tip is None:
        raise ReplayError(f"{args.video}: holds no /tip/state; track the video first")
    if args.retimed:
        check_new(args.retimed)
    prepare()
    shift_s = (tracked.zero_time_ns - recorded.zero_time_ns) * 1e-9
    tip = dataclasses.replace(tracked.tip, time_s=tracked.tip.time_s + shift_s)
    clock = clock_from_motion(recorded, tip, load_straw(args.straw))
    say("no LED: the clock is the one at which the model fits best, and inherits the model's own delays")
    if args.retimed:
        moved = dataclasses.replace(tip, time_s=clock.host_s(tip.time_s))
        metadata = {**tracked.metadata, "clock": str(clock)}
        write_tip(args.retimed, moved, metadata, recorded.sha256, recorded.zero_time_ns)
    return clock
