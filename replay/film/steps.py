"""A page to step through a video's frames as tracked, and to write corrections by hand."""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.errors import ReplayError
from straw.replay.output import finite
from straw.tracking.chapters import Timeline
from straw.tracking.overlay import draw
from straw.tracking.task import Track

MOST = 400  # frames on one page: some 10 MB
_AROUND = 10  # frames shown on either side of those that are not valid
_HALF_PX = 260  # of the picture that is shown, round the board


def frames_to_show(track: Track, text: str) -> list[int]:
    """The frames of ``A-B`` that the video has; for "doubtful" the invalid ones and some around them, the first
    ``MOST``."""
    n = len(track.trace)
    if text == "doubtful":
        bad = np.flatnonzero(~track.trace.valid)
        near = np.unique(np.clip(bad[:, None] + np.arange(-_AROUND, _AROUND + 1), 0, n - 1))
        return [int(k) for k in near[:MOST]] or list(range(min(n, MOST)))
    first, last = stretch_of(text, n)  # checked again, as a damaged video has fewer than it declares
    return list(range(first, last + 1))


def stretch_of(text: str, frames: int) -> tuple[int, int]:
    """The two numbers of ``A-B``; ReplayError for anything else, more than a page holds, or than the video has."""
    match = re.fullmatch(r"(\d+)-(\d+)", text)
    if not match:
        raise ReplayError(f"--step-frames {text}: expected the first and the last frame, as 100-160, or doubtful")
    first, last = int(match[1]), int(match[2])
    if last - first >= MOST:
        raise ReplayError(f"--step-frames {text}: a page holds {MOST} frames; take a part")
    if not first <= last < frames:
        raise ReplayError(f"--step-frames {text}: the video has frames 0 to {frames - 1}")
    return first, last


def steps_page(track: Track, videos: Sequence[Path], shown: Sequence[int]) -> str:
    """The HTML text; ``track.record`` must be open."""
    assert track.record is not None
    wanted, cards = set(shown), []
    middle = np.array((track.camera.lens.width / 2, track.camera.lens.height / 2))
    with Timeline(videos, *track.part) as timeline:
        for frame in timeline.frames():
            if frame.index > shown[-1]:
                break
            (row,) = track.record.rows(frame.index, frame.index + 1)
            middle = row["grid"].mean(axis=(0, 1)) if row["seen"] else middle
            if frame.index in wanted:
                picture = np.repeat(frame.luma[..., None], 3, axis=2)
                draw(picture, track, frame.index, row)
                cards.append(_card(track, frame.index, picture, middle))
    name = html.escape(", ".join(path.name for path in videos))
    filled = {"title": f"Frames of {name}", "data": json.dumps(finite({"frames": cards})).replace("<", "\\u003c")}
    template = files("straw.replay.film").joinpath("steps.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda place: filled[place[1]], template)


def _card(track: Track, index: int, picture: NDArray[np.uint8], middle: NDArray[Any]) -> dict[str, Any]:
    """One frame: its pose in mm and deg, its remark, and the part of the picture around the board."""
    import cv2

    height, width = picture.shape[:2]
    wide, high = min(2 * _HALF_PX, width), min(2 * _HALF_PX, height)
    left = int(np.clip(middle[0] - wide / 2, 0, width - wide))
    top = int(np.clip(middle[1] - high / 2, 0, height - high))
    _, jpeg = cv2.imencode(".jpg", picture[top : top + high, left : left + wide], [cv2.IMWRITE_JPEG_QUALITY, 80])
    trace = track.trace
    pose = [trace.x_m[index] * 1e3, trace.z_m[index] * 1e3, np.degrees(trace.phi_rad[index])]
    return {
        "frame": index,
        "time_s": float(trace.time_s[index]),
        "pose": [float(value) for value in pose] if trace.valid[index] else None,
        "said": str(track.said[index]),
        "left": left,
        "top": top,
        "width": wide,
        "height": high,
        "jpeg": "data:image/jpeg;base64," + base64.b64encode(jpeg.tobytes()).decode("ascii"),
    }
