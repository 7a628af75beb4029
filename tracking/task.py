"""What to track and with what; and the result, the tip's motion."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.errors import TrackingError
from straw.tracking.follow import Rest
from straw.tracking.gpmf import Telemetry
from straw.tracking.record import Record
from straw.tracking.trace import TipTrace
from straw.tracking.video import DecodeReport

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Track:
    """The tip's motion by a video.

    ``rms_px`` (n,): reprojection residual per coordinate and frame, ``corners`` (n,): how many corners it rests on (NaN
    and 0 where invalid), ``said`` (n,): why a frame is not valid, or who corrected
    it by hand; else "". ``camera``: the one used, with ``world_from_camera``, ``board_turn_rad`` and ``line_s`` as
    found; ``trace.time_s`` is when the shutter passed the board's middle. ``rest_frames``: how many still frames placed
    the camera (0 when its place was given).
    ``residual_px`` (corners, 2): the corners' mean residual over all frames, and ``spread_px`` (corners, 2)
    its standard deviation. ``exposure_s``: by the camera's telemetry, or by motion blur; ``lag_px``: the codec's lag,
    which is corrected (see ``noise``). ``never_seen``: corners of the board that no frame shows.
    ``part``: rate, beginning and end, as in ``Task``.
    """

    trace: TipTrace
    rms_px: Floats
    corners: NDArray[np.int64]
    decode: DecodeReport
    camera: Camera
    board: Board
    said: NDArray[np.object_]
    rest_frames: int
    turn_sigma_rad: tuple[float, float]
    line_sigma_s: float
    residual_px: Floats
    spread_px: Floats
    telemetry: Telemetry = field(default_factory=Telemetry)
    exposure_s: float = 0.0
    lag_px: float = 0.0
    never_seen: int = 0
    part: tuple[float, float, float] = (0.0, -math.inf, math.inf)
    record: Record | None = None

    @property
    def invalid(self) -> dict[str, int]:
        """How many frames are not valid, by reason, the commonest first."""
        return dict(Counter(self.said[~self.trace.valid].tolist()).most_common())

    @property
    def by_hand(self) -> dict[str, int]:
        """How many poses were set by hand, or found by a point that a hand named, by reason."""
        return dict(Counter(text for text in self.said[self.trace.valid].tolist() if text).most_common())


@dataclass(frozen=True)
class Task:
    """What to track and by what: the files of one recording, camera, board, and what places the camera.

    ``rest_pose`` (x_m, z_m, phi_rad) is the tip's known pose while the board stands still at the beginning; the
    camera's place is found from it, whatever ``camera`` says (see ``settle``). None takes ``camera.world_from_camera``.
    ``level``: the camera stands level, phi at rest is not taken from ``rest_pose``. ``near_px``: where the board is in
    the first picture, if several are in view. ``start_s`` is added to the time stamps. ``fps``: at which it was filmed,
    where the time stamps are of a slower replay (0: they are right); ``from_s`` and ``to_s``: the part of the film, s.
    """

    videos: tuple[Path, ...]
    camera: Camera
    board: Board
    rest_pose: Rest | None = None
    level: bool = False
    near_px: tuple[float, float] | None = None
    start_s: float = 0.0
    fps: float = 0.0
    from_s: float = -math.inf
    to_s: float = math.inf

    def __post_init__(self) -> None:
        if not math.isfinite(self.start_s) or not all(map(math.isfinite, self.rest_pose or ())):
            what = f"track: start_s {self.start_s} and rest_pose {self.rest_pose} must be finite"
            raise TrackingError(f"{what}; give s, and m, m, rad")
        if not (math.isfinite(self.fps) and self.fps >= 0):
            raise TrackingError(f"track: fps is {self.fps:g}; give the frames a second it was filmed at, as 240")

    def identity(self) -> dict[str, Any]:
        """What a record of followed corners depends on."""
        return {
            "videos": [(path.name, path.stat().st_size, path.stat().st_mtime_ns) for path in self.videos],
            "lens": self.camera.lens.to_json(),
            "camera": (self.camera.board_x_in_image, self.camera.mount, str(self.camera.world_from_camera)),
            "board": asdict(self.board),
            "rest": self.rest_pose,
            "near": self.near_px,
            "part": (self.fps, self.from_s, self.to_s),
        }
