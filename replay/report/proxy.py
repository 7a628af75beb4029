"""A small proxy of a run's video for its page: one frame for each of the camera's, with the places of both tips."""

from __future__ import annotations

import base64
import json
import tempfile
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from straw.replay.compare.comparison import Comparison
from straw.replay.errors import ReplayError
from straw.replay.report.data import packed
from straw.tracking.camera import Camera, load_camera
from straw.tracking.chapters import Timeline
from straw.tracking.encode import VideoWriter
from straw.tracking.pose import apply

Floats = NDArray[np.float64]

WIDTH_PX = 480
#: Room around the tip's path, in widths of the picture.
ROOM = 0.12
#: Frames a second of the proxy's own time: browsers play slow motion from it between 1/16 and 16 times.
RATE = 60
#: Largest size of a proxy, bytes, and bits a second that suffice for a board.
MOST_BYTES, ENOUGH_BPS = 6e6, 0.7e6


def film(
    c: Comparison,
    videos: Sequence[Path],
    camera: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """The entry ``film`` of a run's data: H.264 without B-frames as a data URL, each frame's time, tips in px.

    The camera is the one the track was made with, unless given. ReplayError where track and video do not belong
    together, TrackingError where the video cannot be read.
    """
    tip = c.run.tip
    assert tip is not None
    placed = load_camera(camera) if camera else _camera_of(c)
    with tempfile.TemporaryDirectory() as folder, Timeline(videos) as timeline:
        said = np.column_stack([getattr(c.prediction, name)[-len(tip) :] for name in ("x_m", "z_m")])
        px = {"measured": _pixels(placed, np.column_stack([tip.x_m, tip.z_m])), "predicted": _pixels(placed, said)}
        left, top, right, bottom = _crop(px["measured"], timeline.width, timeline.height)
        scale = min(1.0, WIDTH_PX / (right - left))
        width, height = (2 * max(8, round(side * scale / 2)) for side in (right - left, bottom - top))
        frames = timeline.expected
        if frames < len(tip):
            raise ReplayError(
                f"{videos[0]}: {frames} frames, the track has {len(tip)}; give the video it was made from"
            )
        path = Path(folder) / "proxy.mp4"
        bitrate = min(ENOUGH_BPS, 8 * MOST_BYTES * RATE / frames)
        count = 0
        with VideoWriter(path, width, height, Fraction(RATE), bitrate, preset="veryfast") as writer:
            for frame in timeline.frames():
                seen = frame.luma[top:bottom, left:right]
                writer.write(cv2.resize(seen, (width, height), interpolation=cv2.INTER_AREA).astype(np.uint8))
                count += 1
                if progress:
                    progress(count, frames)
        src = "data:video/mp4;base64," + base64.b64encode(path.read_bytes()).decode()
    n = min(count, len(tip))
    return {
        "src": src,
        "rate": RATE,
        "width": width,
        "height": height,
        "time": packed(tip.time_s[:n]),
        **{name: packed(((where[:n] - (left, top) + 0.5) * scale).ravel()) for name, where in px.items()},
    }


def _crop(tips_px: Floats, width: int, height: int) -> tuple[int, int, int, int]:
    """The part of the picture (left, top, right, bottom) in which the tip moves, with room for the board around it."""
    room = ROOM * width
    low, high = np.nanmin(tips_px, axis=0) - room, np.nanmax(tips_px, axis=0) + room
    middle, half = (low + high) / 2, max(*(high - low), 1.0) / 2 * np.array([1.0, 0.62])
    left, top = np.clip(np.floor(middle - half), 0, None).astype(int).tolist()
    right, bottom = np.clip(np.ceil(middle + half), None, (width, height)).astype(int).tolist()
    return left, top, max(right, left + 16), max(bottom, top + 16)


def _camera_of(c: Comparison) -> Camera:
    data = c.run.attachments.get("camera.json")
    if data is None:
        raise ReplayError(
            f"{c.run.path}: its track names no camera; give --camera with its place (straw track --save-camera)"
        )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "camera.json"
        path.write_text(json.dumps(json.loads(data)), encoding="utf-8")
        return load_camera(path)


def _pixels(camera: Camera, tips_m: Floats) -> Floats:
    """Where tips (n, 2) of the plane of motion are on the picture, (n, 2) px."""
    if camera.world_from_camera is None:
        raise ReplayError("the camera file does not say where it stands; take the one of straw track --save-camera")
    points = np.column_stack([tips_m[:, 0], np.zeros(len(tips_m)), tips_m[:, 1]])
    to_camera = np.asarray(np.linalg.inv(camera.world_from_camera), dtype=np.float64)
    return np.asarray(camera.lens.project(apply(to_camera, points)), dtype=np.float64)
