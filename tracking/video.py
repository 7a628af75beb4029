"""Video files: luma pictures with their true times, and a report of what was missing or broken."""

from __future__ import annotations

import contextlib
import os
import queue
import threading
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import av
import numpy as np
from av.video.frame import PictureType
from numpy.typing import NDArray

from straw.tracking.errors import TrackingError
from straw.tracking.fields import reason

T = TypeVar("T")
Picture = NDArray[np.uint8]

_LUMA_8 = ("yuv420p", "yuvj420p", "yuv422p", "yuvj422p", "yuv444p", "yuvj444p", "nv12", "nv21", "gray")
_LUMA_10 = ("yuv420p10le", "yuv422p10le", "yuv444p10le", "p010le", "gray10le")
# Android's MediaMuxer writes the first, other phones and converters the others.
_CAPTURE_TAGS = ("android.capture.fps", "capture_fps", "capture_rate", "capture-frame-rate", "framerate.capture")
_ROUNDING_S = 1e-6  # tolerance of times that were added up over chapters
_SHIFT_10 = {"p010le": 8}  # p010 keeps its 10 bits at the top of the word


@dataclass(frozen=True)
class Gap:
    """A hole in the time stamps: ``missing`` frames after ``after_s`` (seconds since the video's first frame)."""

    after_s: float
    missing: int


@dataclass(frozen=True)
class DecodeReport:
    """What became of a video's frames: ``decoded`` of ``expected``, holes in time, packets that would not decode."""

    decoded: int
    expected: int
    gaps: tuple[Gap, ...]
    corrupt: int
    repeated: int  # frames dropped because their time did not advance

    def __str__(self) -> str:
        text = f"decoded {self.decoded} of {self.expected} frames"
        missing = sum(gap.missing for gap in self.gaps)
        text += f", {missing} missing in {len(self.gaps)} gaps" if self.gaps else ""
        text += f", {self.corrupt} corrupt packets" if self.corrupt else ""
        return text + (f", {self.repeated} with a repeated time" if self.repeated else "")


@dataclass(frozen=True)
class Frame:
    """One picture: its count from 0 as decoded, its time since the recording's start, its luma (height, width).

    ``corrupt`` counts the packets before it that would not decode; ``file`` is the chapter it comes from; ``key``:
    a keyframe rather than a picture that the codec predicted; ``between``: one that it predicted from pictures before
    and after (a B picture).
    """

    index: int
    time_s: float
    luma: Picture
    corrupt: int = 0
    file: int = 0
    key: bool = False
    between: bool = False


def frames_missing(before_s: float, now_s: float, period_s: float) -> int:
    """Return how many frames would fit between two time stamps."""
    return max(round((now_s - before_s) / period_s) - 1, 0)


class VideoReader:
    """Reads one video file front to back; use as a context manager, iterate ``frames()`` once, then ask ``report()``.

    Luma is the decoder's plane 0 as stored (no colour conversion), contiguous; it lives as long as its frame.
    Times are the container's PTS from the stream's start. Display rotation is not applied: the lens belongs to the
    sensor. Raises TrackingError when the file cannot be opened or holds no pictures.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        try:
            size_bytes = self.path.stat().st_size
        except OSError as error:
            raise TrackingError(f"{path}: cannot read the video ({reason(error)}); check the path") from error
        if not self.path.is_file():
            raise TrackingError(f"{path}: not a file; name the video itself")
        if size_bytes == 0:
            raise TrackingError(f"{path}: the video is empty (0 bytes); copy it from the camera again")
        try:
            self._container = av.open(str(self.path), metadata_errors="replace")
        except (av.error.FFmpegError, OSError) as error:
            what = f"{path}: not a readable video ({error.strerror})"
            raise TrackingError(f"{what}; if the recording was cut short, copy it again or repair it") from error
        if not self._container.streams.video:
            self._container.close()
            raise TrackingError(f"{path}: contains no pictures (audio or data only); give the camera's video file")
        self._stream = self._container.streams.video[0]
        codec: Any = self._stream.codec_context
        if codec is None:  # no decoder for it in this build
            self._container.close()
            raise TrackingError(f"{path}: no decoder for its pictures in this build; convert it to H.264")
        self._stream.thread_type = "AUTO"
        self.width, self.height = codec.width, codec.height
        self.rate = self._stream.average_rate or self._stream.guessed_rate or Fraction(0)
        self._median_s = self._median_step_s()
        self.capture_rate = self._tagged_rate()
        duration = float((self._stream.duration or 0) * (self._stream.time_base or 0))
        self.duration_s = duration
        self.expected = self._stream.frames or round(duration * float(self.rate))
        self.codec = str(codec.name)
        self._decoded = self._corrupt = self._repeated = 0
        self._gaps: list[Gap] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._container.close()

    def report(self) -> DecodeReport:
        """Return the report so far."""
        expected = max(self.expected, self._decoded)
        return DecodeReport(self._decoded, expected, tuple(self._gaps), self._corrupt, self._repeated)

    @property
    def period_s(self) -> float:
        """Seconds from frame to frame where none is missing: the median by the file's index.

        The mean would rise with what is missing; the library's guess is far off for a variable rate.
        """
        if self._median_s > 0:
            return self._median_s
        rate = self._stream.guessed_rate or self.rate
        return float(1 / rate) if rate else float("inf")

    def _median_step_s(self) -> float:
        """Return the median step of the index's time stamps (s); 0 for files without an index."""
        stamps = np.sort([entry.timestamp for entry in self._stream.index_entries])
        steps = np.diff(stamps)
        return float(np.median(steps) * (self._stream.time_base or 0)) if len(steps) else 0.0

    def _tagged_rate(self) -> float:
        """Return at what rate (frames/s) the file's tags say it was filmed; 0 where they do not."""
        tags = {**self._container.metadata, **self._stream.metadata}
        for name, text in tags.items():
            if name.lower().endswith(_CAPTURE_TAGS):
                with contextlib.suppress(ValueError):
                    return max(float(text), 0.0)
        return 0.0

    def frames(self, after_s: float = float("-inf")) -> Iterator[Frame]:
        """Yield every frame later than ``after_s`` that decodes, in order of time.

        A broken packet is counted and passed over. Counts begin with the first frame after ``after_s``.
        """
        start, before_s = self._stream.start_time or 0, after_s + _ROUNDING_S
        if after_s > 0 and self._stream.time_base:  # to the last keyframe before it
            self._container.seek(start + int(after_s / float(self._stream.time_base)), stream=self._stream)
        for picture in self._pictures():
            if picture.pts is None or picture.time_base is None:
                self._corrupt += 1
                continue
            time_s = float((picture.pts - start) * picture.time_base)
            if time_s <= before_s:
                self._repeated += time_s > after_s + _ROUNDING_S
                continue
            if self._decoded and (missing := frames_missing(before_s, time_s, self.period_s)):
                self._gaps.append(Gap(before_s, missing))
            before_s = time_s
            coded = {"key": bool(picture.key_frame), "between": picture.pict_type == PictureType.B}
            yield Frame(self._decoded, time_s, self._luma(picture), self._corrupt, **coded)
            self._decoded += 1

    def _pictures(self) -> Iterator[Any]:
        packets = self._container.demux(self._stream)
        while True:
            try:
                packet = next(packets)
            except StopIteration:
                return
            except (av.error.FFmpegError, OSError):  # the file ends in the middle of a packet
                self._corrupt += 1
                return
            try:
                pictures = packet.decode()
            except av.error.FFmpegError:
                self._corrupt += 1
                continue
            self._corrupt += sum(picture.is_corrupt for picture in pictures)
            yield from (picture for picture in pictures if not picture.is_corrupt)

    def _luma(self, picture: Any) -> Picture:
        name, plane = picture.format.name, picture.planes[0]
        if (picture.width, picture.height) != (self.width, self.height):
            raise TrackingError(f"{self.path}: the picture size changes in mid-video; split the file where it does")
        if name in _LUMA_8:  # rows may be padded to line_size; with the gaps numba would compile the tracker once more
            rows = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)
            return np.ascontiguousarray(rows[: self.height, : self.width])
        if name in _LUMA_10:
            words = np.frombuffer(plane, "<u2").reshape(-1, plane.line_size // 2)[: self.height, : self.width]
            return (words >> _SHIFT_10.get(name, 2)).astype(np.uint8)
        raise TrackingError(f"{self.path}: pixel format {name} has no luma plane; convert it to H.264 yuv420p")


def ahead(items: Iterator[T], depth: int = 6) -> Generator[T, None, None]:
    """Yield from ``items`` while a thread fetches up to ``depth`` more: decoding and tracking share the time."""
    waiting: queue.Queue[T | BaseException | None] = queue.Queue(depth)
    stop = threading.Event()

    def put(item: T | BaseException | None) -> None:
        while not stop.is_set():
            with contextlib.suppress(queue.Full):
                waiting.put(item, timeout=0.1)
                return

    def fetch() -> None:
        try:
            for item in items:
                put(item)
                if stop.is_set():
                    return
            put(None)
        except BaseException as error:  # carried over to the thread that asked
            put(error)

    thread = threading.Thread(target=fetch, name="decode", daemon=True)
    thread.start()
    try:
        while (item := waiting.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item
    finally:
        stop.set()
        thread.join()
