"""Writes luma pictures as the kind of MP4 a GoPro writes: for the painter, the overlay, the demo, and tests."""

from __future__ import annotations

import os
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Self, cast

import av
import numpy as np
from av.video.stream import VideoStream
from numpy.typing import NDArray

from straw.tracking.errors import TrackingError

GOPRO_RATE = Fraction(240_000, 1001)  # "240 fps"; exact, so that frame times are exact


class VideoWriter:
    """Writes luma pictures as a GoPro does: H.264 (libx264) or HEVC (libx265), full range, no B-frames, exact times.

    Writes to PATH.part and renames when the block ends well; after an exception nothing is left behind.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        width: int,
        height: int,
        rate: Fraction = GOPRO_RATE,
        bitrate: float = 60e6,
        codec: str = "libx264",
        preset: str = "ultrafast",
    ) -> None:
        if width % 2 or height % 2 or min(width, height) < 16:
            raise TrackingError(f"{path}: {width}x{height} cannot be written as H.264; both sides must be even, >= 16")
        self.path = Path(path)
        if not self.path.parent.is_dir():  # the library would report it only at the first picture
            raise TrackingError(f"{path}: cannot write the video (no such folder); make the folder first")
        self._part = self.path.with_name(self.path.name + ".part")
        self._size, self._step, self._count = (width, height), rate.denominator, 0
        try:
            self._container = av.open(str(self._part), "w", format="mp4")
        except (av.error.FFmpegError, OSError) as error:
            raise TrackingError(f"{path}: cannot write the video ({error.strerror}); check the folder") from error
        options = {"preset": preset, "bf": "0"} | (
            {"x265-params": "log-level=none:bframes=0"} if codec == "libx265" else {}
        )
        stream = cast(VideoStream, self._container.add_stream(codec, rate=rate, options=options))
        stream.width, stream.height, stream.pix_fmt = width, height, "yuvj420p"
        stream.bit_rate, stream.thread_type = round(bitrate), "AUTO"
        # A tick of 1/numerator makes every PTS a whole number of ticks: times are never rounded.
        stream.time_base = stream.codec_context.time_base = Fraction(1, rate.numerator)
        stream.codec_context.gop_size = 30
        self._stream = stream

    def __enter__(self) -> Self:
        return self

    def write_colour(self, bgr: NDArray[np.uint8]) -> None:
        """Append one picture (height, width, 3)."""
        self._append(av.VideoFrame.from_ndarray(bgr, format="bgr24").reformat(format="yuvj420p"))

    def write(self, luma: NDArray[np.uint8], *, skip: int = 0) -> None:
        """Append one picture (height, width); ``skip`` leaves that many frame times empty before it."""
        width, height = self._size
        if luma.shape != (height, width) or luma.dtype != np.uint8:
            raise TrackingError(f"{self.path}: picture is {luma.dtype} {luma.shape}, expected uint8 {(height, width)}")
        frame = av.VideoFrame(width, height, "yuvj420p")
        for index, plane in enumerate(frame.planes):
            rows = np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size)
            rows[: plane.height, : plane.width] = 128 if index else luma  # grey has no colour
        self._count += skip
        self._append(frame)

    def _append(self, frame: av.VideoFrame) -> None:
        frame.pts, frame.time_base = (
            self._count * self._step,
            Fraction(1, self._stream.codec_context.time_base.denominator),
        )
        self._count += 1
        try:
            self._container.mux(self._stream.encode(frame))
        except (av.error.FFmpegError, OSError) as error:
            raise TrackingError(
                f"{self.path}: cannot write the video ({error}); check the folder and its space"
            ) from error

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        try:
            if kind is None:
                self._container.mux(self._stream.encode(None))
            self._container.close()
            if kind is None:
                self._part.replace(self.path)
        except (av.error.FFmpegError, OSError) as trouble:
            raise TrackingError(f"{self.path}: cannot finish the video ({trouble}); is the disk full?") from trouble
        finally:
            self._part.unlink(missing_ok=True)
