"""The demo's video: the tip painted as a GoPro sees it, and the track's error against the painted truth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from straw.replay.compare.comparison import CHANNELS
from straw.replay.diagnose.systems.straw.instrument import Instrument
from straw.replay.progress import progress_bar
from straw.rig.twin import TwinHistory
from straw.tracking.camera import Camera
from straw.tracking.follow import Rest
from straw.tracking.lens import shipped_lens
from straw.tracking.synthetic import camera_looking_at, paint_video
from straw.tracking.trace import TipTrace

Floats = NDArray[np.float64]

LENS = "gopro_hero6_wide_1080p240"
DISTANCE_M = 0.212
OBLIQUITY_RAD = math.radians(25)
LINE_S = 3.7e-6  # rolling shutter: from one row to the next


class Motion:
    """The true motion of the tip, at seconds since the video's first frame; smooth between its milliseconds."""

    def __init__(self, truth: TwinHistory, video_start_ns: int) -> None:
        self._spline = CubicSpline(
            truth.time_s - (video_start_ns - truth.zero_wall_ns) / 1e9,
            np.column_stack([truth.x_m, truth.z_m, truth.phi_rad]),
        )

    def __call__(self, time_s: Floats) -> tuple[Floats, Floats, Floats]:
        """Tip x_m, z_m, phi_rad, each of the shape of ``time_s``."""
        x_m, z_m, phi_rad = np.moveaxis(np.asarray(self._spline(time_s), dtype=np.float64), -1, 0)
        return x_m, z_m, phi_rad


def lens_alone() -> Camera:
    """The camera as its user knows it: a lens, no place."""
    return Camera(shipped_lens(LENS))


def film(path: Path, motion: Motion, rest: Rest, duration_s: float, seed: int) -> None:
    """Paint the video from 212 mm, 25 degrees to the side of the board's normal, looking at where a tip rests."""
    camera = lens_alone()
    place = camera_looking_at((rest[0] + camera.tip_offset_m, 0.0, rest[1]), DISTANCE_M, OBLIQUITY_RAD, 0.0)
    placed = Camera(camera.lens, place, camera.tip_offset_m)
    with progress_bar(f"film {path.name}", "frame") as progress:
        paint_video(path, placed, motion, duration_s, seed=seed, line_s=LINE_S, progress=progress)


@dataclass(frozen=True)
class Error:
    """Tracked minus painted, over all valid frames: RMS and largest, SI, and mean square in sigmas."""

    rms: float
    largest: float
    normalised: float


def errors_of(trace: TipTrace, motion: Motion, start_s: float, instrument: Instrument) -> dict[str, Error]:
    """Tracking error by channel against the painted truth; a concealed fault of the camera is not the tracker's."""
    valid = trace.valid
    run_s = instrument.true_time(trace.time_s[valid])
    truth = instrument.seen(np.stack(motion(run_s - start_s)), run_s)
    found = {}
    for channel, true in zip(CHANNELS, truth, strict=True):
        error = getattr(trace, channel)[valid] - true
        sigma = getattr(trace, f"sigma_{channel}")[valid]
        found[channel] = Error(
            rms=float(np.sqrt(np.mean(error**2))),
            largest=float(np.abs(error).max()),
            normalised=float(np.mean((error / sigma) ** 2)),
        )
    return found
