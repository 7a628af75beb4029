"""The overlay: the video again, with what the tracker saw in it drawn on top."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from straw.tracking.chapters import Timeline
from straw.tracking.encode import VideoWriter
from straw.tracking.pose import apply, world_from_tip
from straw.tracking.task import Track

Floats = NDArray[np.float64]
Colour = tuple[int, int, int]

_GREEN, _RED, _YELLOW, _WHITE, _BLUE = (80, 220, 60), (60, 60, 240), (40, 220, 250), (255, 255, 255), (250, 160, 60)
_FINE = 4  # drawing at sixteenths of a pixel: cv2's "shift"
_ARROW = 0.6  # of the board's side


def write_overlay(
    path: str | os.PathLike[str],
    videos: Sequence[str | os.PathLike[str]],
    track: Track,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write the video with corners (green: used, red: not), the tip's axes, X, Z, Phi and valid or not, at 30 frames/s.

    ``track.record`` must be open; every frame is shown, so that a snap can be watched in slow motion.
    """
    assert track.record is not None
    with (
        Timeline(videos, *track.part) as timeline,
        VideoWriter(path, timeline.width, timeline.height, Fraction(30), 12e6) as video,
    ):
        rows, start = track.record.rows(0, 0), 0
        for frame in timeline.frames():
            if frame.index >= start + len(rows):
                start, rows = frame.index, track.record.rows(frame.index, frame.index + 256)
            picture = np.repeat(frame.luma[..., None], 3, axis=2)
            draw(picture, track, frame.index, rows[frame.index - start])
            video.write_colour(picture)
            if progress:
                progress(frame.index + 1, len(track.trace))


def draw(picture: NDArray[np.uint8], track: Track, index: int, row: Any) -> None:
    """Draw one frame's corners, axes and figures on its picture (height, width, 3)."""
    trace, valid = track.trace, bool(track.trace.valid[index])
    if row["seen"]:
        for (u, v), used in zip(row["grid"].reshape(-1, 2), row["used"].ravel(), strict=True):
            _dot(picture, (u, v), 4, _GREEN if used and valid else _RED)
    text = f"{index:6d}  {trace.time_s[index]:9.4f} s   "
    if valid:
        x, z, phi = trace.x_m[index], trace.z_m[index], trace.phi_rad[index]
        _axes(picture, track, x, z, phi)
        text += f"X {x * 1e3:8.3f} mm  Z {z * 1e3:8.3f} mm  Phi {np.degrees(phi):7.2f} deg"
    else:
        text += f"not valid: {track.said[index]}"
    cv2.rectangle(picture, (0, 0), (picture.shape[1], 46), (0, 0, 0), -1)
    cv2.putText(picture, text, (12, 32), cv2.FONT_HERSHEY_SIMPLEX, 0.9, _WHITE if valid else _RED, 2, cv2.LINE_AA)


def _axes(picture: NDArray[np.uint8], track: Track, x: float, z: float, phi: float) -> None:
    """Draw the tip with its axis (yellow), the direction across (blue), and the board's middle."""
    assert track.camera.world_from_camera is not None
    reach = _ARROW * track.board.size_m
    points: Floats = np.array(((0.0, 0.0, 0.0), (0.0, 0.0, reach), (reach, 0.0, 0.0)))
    to_camera = np.asarray(np.linalg.inv(track.camera.world_from_camera), dtype=np.float64)
    seen = apply(to_camera, apply(world_from_tip(x, z, phi), points))
    tip, ahead, across = track.camera.lens.project(seen)
    if np.isfinite((tip, ahead, across)).all():
        _line(picture, tip, ahead, _YELLOW)
        _line(picture, tip, across, _BLUE)
        _dot(picture, tip, 7, _YELLOW)


def _dot(picture: NDArray[np.uint8], at: Sequence[float], radius: int, colour: Colour) -> None:
    u, v = (round(float(value) * 2**_FINE) for value in at)
    cv2.circle(picture, (u, v), radius << _FINE, colour, 2, cv2.LINE_AA, _FINE)


def _line(picture: NDArray[np.uint8], start: Floats, end: Floats, colour: Colour) -> None:
    one, other = ([round(float(value) * 2**_FINE) for value in point] for point in (start, end))
    cv2.line(picture, one, other, colour, 3, cv2.LINE_AA, _FINE)
