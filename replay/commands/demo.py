"""straw demo: the whole loop without hardware: drive an emulated rig, film its straw, track the film, replay it."""

from __future__ import annotations

import argparse
import math
import os
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from model.parameters import StrawParameters
from replay.commands import replay
from replay.commands.rig_run import drive, emulation
from replay.commands.track import model_rest, summary
from replay.compare import CHANNELS, Comparison, compare
from replay.errors import ReplayError
from replay.gather import gather
from replay.output import write_json, write_text
from replay.progress import progress_bar, say
from replay.report.page import page
from replay.report.proxy import film as film_proxy
from replay.track_file import track_to_file
from rig.guarded import GuardedController
from rig.protocol import PressureProtocol, load_protocol
from rig.run_read import read_run
from rig.twin import TwinHistory
from tracking.camera import Camera, save_camera
from tracking.lens import shipped_lens
from tracking.synthetic import camera_looking_at, paint_video
from tracking.trace import TipTrace

Floats = NDArray[np.float64]

LENS = "gopro_hero6_wide_1080p240"
DISTANCE_M = 0.212
OBLIQUITY_RAD = math.radians(25)
LINE_S = 3.7e-6  # rolling shutter: from one row to the next
MARKER = ".straw-demo"  # a folder with this file is one that the demo may use again
MADE = ("run.mcap", "camera.json", "video.mp4", "tip.mcap", "replay.html", "demo.json")


@dataclass(frozen=True)
class Error:
    """Tracked minus painted, over all valid frames: RMS and largest, SI, and mean square in sigmas."""

    rms: float
    largest: float
    normalised: float


def run(args: argparse.Namespace) -> int:
    """Drive, film, track, replay; print how well each step did and where to look."""
    out = clear_folder(args.out)
    straw = StrawParameters()
    with as_file(files("rig") / "protocols" / "fold-25kPa.toml") as path:
        protocol = load_protocol(path)

    say("1/4 drive: the paper's folding run on an emulated OB1 MK4, through the serial driver")
    truth = drive_emulated(straw, protocol, out / "run.mcap")
    recorded = read_run(out / "run.mcap")

    say("2/4 film: painting what a GoPro HERO6 sees at 240 frames/s")
    camera = Camera(shipped_lens(LENS))
    save_camera(out / "camera.json", camera)
    start_s = -protocol.zero_s
    motion = Motion(truth, recorded.zero_time_ns + round(start_s * 1e9))
    rest = model_rest(straw, protocol.initial_deployed)
    film(out / "video.mp4", camera, motion, rest, protocol.duration_s, args.seed)

    say("3/4 track: finding the board in every frame")
    tracked = track_to_file(out / "video.mp4", camera, rest, out / "tip.mcap", recorded, start_s)
    if tracked.record:
        tracked.record.remove()
    errors = errors_of(tracked.trace, motion, start_s)

    say("4/4 replay: the model under the measured pressure, laid over the track")
    (run_with_tip,) = gather([out / "run.mcap", out / "tip.mcap"])
    comparison = compare(run_with_tip, straw)
    with progress_bar("proxy", "frame") as progress:
        filmed = film_proxy(comparison, [out / "video.mp4"], progress=progress)
    write_text(out / "replay.html", page([comparison], more={run_with_tip.sha256: {"film": filmed}}))
    for path in filter(None, (out / "demo.json", args.json)):
        write_json(path, as_data(errors, comparison))
    print(
        f"recorded  {len(recorded.pressure or ())} pressure readings, {len(recorded.events)} events: {out / 'run.mcap'}"
    )
    print(f"tracked   {summary(tracked)}: {out / 'tip.mcap'}")
    print(figures(errors, comparison))
    print(f"look at   {out / 'replay.html'}")
    return 0


def clear_folder(out: Path) -> Path:
    """The demo's folder without an earlier demo's files; ReplayError rather than touch a folder that is not one."""
    try:
        if out.is_dir() and any(out.iterdir()) and not (out / MARKER).exists():
            raise ReplayError(f"{out}: is not empty and not an earlier demo; choose another folder with --out")
        out.mkdir(parents=True, exist_ok=True)
        for name in MADE:  # and nothing else: somebody may keep a recording of their own here by now
            (out / name).unlink(missing_ok=True)
            (out / f"{name}.part").unlink(missing_ok=True)  # of one that was killed
        (out / MARKER).write_text(f"straw demo makes anew: {', '.join(MADE)}\n", encoding="utf-8")
    except OSError as error:
        raise ReplayError(f"{out}: cannot be the demo's folder: {error.strerror}; choose another with --out") from None
    return out


def drive_emulated(straw: StrawParameters, protocol: PressureProtocol, output: Path) -> TwinHistory:
    """Run the protocol on the emulator over a real wire: a serial terminal where there is one, TCP elsewhere."""
    addresses = ("pty", "127.0.0.1:0") if os.name == "posix" else ("127.0.0.1:0",)
    with emulation(straw, protocol.initial_deployed, "ob1-mk4", *addresses) as emulated:
        say(f"    the controller answers at {' and '.join(emulated.urls)}; driving {emulated.url}")
        rig = GuardedController("ob1-mk4", emulated.url)
        drive(rig, protocol, output, straw.cells, run_id=protocol.name, specimen="twin")
    return emulated.twin.history


class Motion:
    """What the twin's tip really did, at seconds since the video's first frame; smooth between its milliseconds."""

    def __init__(self, truth: TwinHistory, video_start_ns: int) -> None:
        self._spline = CubicSpline(
            truth.time_s - (video_start_ns - truth.zero_wall_ns) / 1e9,
            np.column_stack([truth.x_m, truth.z_m, truth.phi_rad]),
        )

    def __call__(self, time_s: Floats) -> tuple[Floats, Floats, Floats]:
        """Tip x_m, z_m, phi_rad, each of the shape of ``time_s``."""
        x_m, z_m, phi_rad = np.moveaxis(np.asarray(self._spline(time_s), dtype=np.float64), -1, 0)
        return x_m, z_m, phi_rad


def film(
    path: Path, camera: Camera, motion: Motion, rest: tuple[float, float, float], duration_s: float, seed: int
) -> None:
    """Paint the video from 212 mm, 25 degrees to the side of the board's normal."""
    target = (rest[0] + camera.tip_offset_m, 0.0, rest[1])
    place = camera_looking_at(target, DISTANCE_M, OBLIQUITY_RAD, 0.0)
    placed = Camera(camera.lens, place, camera.tip_offset_m)
    with progress_bar("film", "frame") as progress:
        paint_video(path, placed, motion, duration_s, seed=seed, line_s=LINE_S, progress=progress)


def errors_of(trace: TipTrace, motion: Motion, start_s: float) -> dict[str, Error]:
    """Tracking error by channel against the painted truth."""
    valid = trace.valid
    found = {}
    for channel, truth in zip(CHANNELS, motion(trace.time_s[valid] - start_s), strict=True):
        error = getattr(trace, channel)[valid] - truth
        sigma = getattr(trace, f"sigma_{channel}")[valid]
        found[channel] = Error(
            rms=float(np.sqrt(np.mean(error**2))),
            largest=float(np.abs(error).max()),
            normalised=float(np.mean((error / sigma) ** 2)),
        )
    return found


def as_data(errors: dict[str, Error], comparison: Comparison) -> dict[str, object]:
    """The demo's figures for machines, SI."""
    return {
        "tracking_error": {name: vars(error) for name, error in errors.items()},
        "model_residual": replay.as_data([comparison])["runs"],
    }


def figures(errors: dict[str, Error], comparison: Comparison) -> str:
    """Tracking error and model residual in units people read."""
    lines = ["                              X / um    Z / um   Phi / mrad"]
    scale = dict(zip(CHANNELS, (1e6, 1e6, 1e3), strict=True))
    for label, values in (
        ("tracking error, RMS", {name: e.rms for name, e in errors.items()}),
        ("tracking error, largest", {name: e.largest for name, e in errors.items()}),
        ("model residual, RMS", {name: s.metrics.rmse for name, s in comparison.signals.items()}),
        ("model residual, largest", {name: s.metrics.max_abs for name, s in comparison.signals.items()}),
    ):
        x, z, phi = (values[name] * scale[name] for name in CHANNELS)
        lines.append(f"{label:<26}{x:10.1f}{z:10.1f}{phi:13.2f}")
    return "\n".join(lines)
