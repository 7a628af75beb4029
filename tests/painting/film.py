"""Encodes pictures as a camera or a converter does, at exact times."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from tests.painting.scene import Camera, Scene

RATE = Fraction(240_000, 1001)


def film(scene: Scene, seconds: float) -> Iterable[NDArray[np.uint8]]:
    """Yield the pictures of a scene."""
    camera = Camera(scene)
    for k in range(round(seconds * RATE)):
        yield camera.take(float(k / RATE))


def encode(
    path: Path,
    pictures: Iterable[NDArray[np.uint8]],
    *,
    codec: str = "libx264",
    bitrate: float = 30e6,
    preset: str = "veryfast",
    b_frames: int = 0,
    rate: Fraction = RATE,
    ticks: Iterable[float] | None = None,
    gop: int = 30,
) -> Path:
    """Write an MP4; ``ticks``: each picture's time in frames, where some are missing or late (0, 1, 2 ...)."""
    container, stream = av.open(str(path), "w"), None
    times = iter(ticks) if ticks is not None else None
    for k, luma in enumerate(pictures):
        if stream is None:
            options = {"preset": preset, "bf": str(b_frames)}
            stream = container.add_stream(codec, rate=rate, options=options)
            stream.height, stream.width = luma.shape
            stream.pix_fmt, stream.bit_rate = "yuv420p", round(bitrate)
            stream.time_base = stream.codec_context.time_base = 1 / (rate * 1001)
            stream.codec_context.gop_size = gop
        frame = av.VideoFrame.from_ndarray(
            np.concatenate((luma, np.full((luma.shape[0] // 2, luma.shape[1]), 128, np.uint8))), format="yuv420p"
        )
        frame.pts, frame.time_base = round(1001 * (next(times) if times else k)), stream.time_base
        container.mux(stream.encode(frame))
    container.mux(stream.encode(None))
    container.close()
    return path
