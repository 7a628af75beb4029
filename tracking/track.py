"""Track: from a video file to the tip's path, with an account of every frame that is not in it."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tracking.board import Board
from tracking.camera import Camera
from tracking.errors import TrackingError
from tracking.follow import NO_FIT, NOT_DUE, Follower, Sighting
from tracking.pose import TipPose
from tracking.settle import INDEPENDENT, Seen, settle
from tracking.trace import TipTrace
from tracking.video import DecodeReport, VideoReader, ahead

Floats = NDArray[np.float64]

Row = tuple[float, ...]  # x, z, phi, their sigmas, rms px
_NOWHERE: Row = (math.nan,) * 7


@dataclass(frozen=True)
class Track:
    """What a video says about the tip.

    ``rms_px`` (n,): reprojection residual per coordinate and frame (NaN where invalid). ``camera``: the one used, with
    ``world_from_camera`` filled and ``board_turn_rad`` as found. ``invalid``: how many frames are not valid, by reason.
    ``rest_frames``: how many still frames placed the camera (0, and sigmas NaN, when its place was given).
    """

    trace: TipTrace
    rms_px: Floats
    decode: DecodeReport
    camera: Camera
    invalid: Mapping[str, int]
    rest_frames: int
    turn_sigma_rad: tuple[float, float]


def track(
    video_path: str | os.PathLike[str],
    camera: Camera,
    board: Board,
    *,
    rest_pose: tuple[float, float, float] | None = None,
    start_s: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> Track:
    """Track the board through a video; ``time_s`` = ``start_s`` + the frame's time stamp.

    ``rest_pose`` (x_m, z_m, phi_rad) is the tip's known pose while the board stands still at the beginning; the
    camera's place is found from it, whatever ``camera`` says (see ``settle``). None takes ``camera.world_from_camera``
    and ``camera.board_turn_rad``. ``frame`` in the trace counts decoded frames from 0. Sigmas include what the corners'
    errors have in common (measured on painted clips), not a wrong lens, rest pose, turn or tip offset. Memory: 0.7 kB a
    frame. Raises TrackingError for a bad file, a lens for another picture size, no rest, or no board.
    """
    if not math.isfinite(start_s) or not all(map(math.isfinite, rest_pose or ())):
        raise TrackingError(f"track: start_s {start_s} and rest_pose {rest_pose} must be finite; give m, m, rad")
    follower = Follower(camera, board, rest_pose)
    times: list[float] = []
    rows: list[Row] = []
    seen: list[Seen] = []
    reasons: Counter[str] = Counter()
    with VideoReader(video_path) as video:
        _check_size(video, camera)
        pictures = ahead(video.frames())
        try:
            for frame in pictures:
                found = follower.look(frame.luma, frame.time_s)
                times.append(frame.time_s)
                if isinstance(found, Sighting):
                    rows.append(_row(found.pose))
                    if rest_pose:  # all corners are fitted again once the camera has its place
                        corners = found.grid.reshape(-1, 2).astype(np.float32)
                        seen.append(Seen(corners, found.pose.used, found.pose.vector))
                else:
                    rows.append(_NOWHERE)
                    reasons[found] += 1
                if progress:
                    progress(len(rows), max(video.expected, len(rows)))
        finally:
            pictures.close()  # stops the decoder before its file is closed
        decode = video.report()
    if not rows:
        raise TrackingError(f"{video_path}: not one of {video.expected} frames could be decoded; copy the file again")
    table = np.array(rows)
    valid = np.isfinite(table[:, 0])
    if not valid.any():
        commonest = next((text for text, _ in reasons.most_common() if text != NOT_DUE), "nothing seen")
        what = f"{video_path}: no board of {board.squares}x{board.squares} squares in any of {len(rows)} frames"
        raise TrackingError(f"{what} ({commonest}); check light, focus, the board's squares and the camera's place")
    rest_frames, turn_sigma_rad = 0, (math.nan, math.nan)
    if rest_pose:
        settled = settle(camera, board, rest_pose, seen)
        camera, rest_frames, turn_sigma_rad = settled.camera, settled.rest_frames, settled.turn_sigma_rad
        table[valid] = [_row(pose) if pose else _NOWHERE for pose in settled.poses]
        reasons[NO_FIT] += sum(pose is None for pose in settled.poses)
    x, z, phi, sigma_x, sigma_z, sigma_phi, rms_px = table.T
    valid, frames = np.isfinite(x), np.arange(len(rows))
    trace = TipTrace(start_s + np.array(times), x, z, phi, sigma_x, sigma_z, sigma_phi, valid, frames)
    return Track(trace, rms_px, decode, camera, MappingProxyType(dict(+reasons)), rest_frames, turn_sigma_rad)


def _check_size(video: VideoReader, camera: Camera) -> None:
    lens = camera.lens
    if (video.width, video.height) != (lens.width, lens.height):
        what = f"pictures are {video.width}x{video.height}, the lens is for {lens.width}x{lens.height}"
        raise TrackingError(f"{video.path}: {what}; calibrate in the mode of the recording")


def _row(pose: TipPose) -> Row:
    sigma = np.sqrt(np.diag(pose.covariance) / INDEPENDENT)
    return (pose.x_m, pose.z_m, pose.phi_rad, *map(float, sigma), pose.rms_px)
