"""A recording in one file or several: GoPro chapters as one timeline, chained by their streams' length."""

from __future__ import annotations

import hashlib
import math
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

from straw.tracking.errors import TrackingError
from straw.tracking.gpmf import Telemetry, read_telemetry
from straw.tracking.video import Frame, VideoReader

_COMPARED = 1 << 20  # bytes compared at the beginning and in the middle; two different videos never agree in both
_CHAPTER = re.compile(r"G[HX](\d\d)(\d{4})\.(mp4|mov)", re.IGNORECASE)  # GH: H.264, GX: HEVC; chapter, then recording


def in_order(paths: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """Return the files of one recording in order: GoPro chapters by their numbers, anything else as given.

    TrackingError for chapters of two recordings, one named twice, or when one between the others is missing.
    """
    files = [Path(path) for path in paths]
    if not files:
        raise TrackingError("track: no video given; name its files")
    found = [_CHAPTER.fullmatch(file.name) for file in files]
    numbers = [(match[2], int(match[1])) for match in found if match]
    if len({file.resolve() for file in files}) < len(files):
        raise TrackingError(f"{files[0]}: a file is named twice; name each file of the recording once")
    if len(files) == 1 or len(numbers) < len(files):
        return files
    files = [file for _, file in sorted(zip(numbers, files, strict=True))]
    numbers.sort()
    if len({recording for recording, _ in numbers}) > 1:
        raise TrackingError(f"{files[0]} and {files[-1]}: chapters of two recordings; track each on its own")
    for (_, before), (_, after), file in zip(numbers, numbers[1:], files[1:], strict=False):
        if after != before + 1:
            raise TrackingError(
                f"{file}: chapter {after} follows chapter {before}; name every chapter in between, once"
            )
    return files


def siblings(paths: Sequence[Path]) -> list[Path]:
    """Return chapters of the same recording that lie beside the first file but are not among ``paths``."""
    match = _CHAPTER.fullmatch(paths[0].name)
    if not match:
        return []
    beside = [(other, _CHAPTER.fullmatch(other.name)) for other in paths[0].parent.iterdir()]
    return sorted(other for other, its in beside if its and its[2] == match[2] and other not in paths)


def copies(files: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Return pairs of files that hold the same, a copy and what it is a copy of."""
    known: dict[object, Path] = {}
    found = []
    for file in files:
        if not file.is_file():
            continue  # reported by whoever opens it
        size = file.stat().st_size
        with file.open("rb") as opened:
            head = opened.read(_COMPARED)
            opened.seek(max(size // 2 - _COMPARED // 2, 0))
            digest = hashlib.sha256(head + opened.read(_COMPARED)).digest()
        if (other := known.setdefault((size, digest), file)) is not file:
            found.append((file, other))
    return found


class Timeline:
    """The files of one recording as one stream of frames; use as a context manager, as ``VideoReader``.

    ``fps``: the rate it was filmed at, if its time stamps are those of slow motion (0: they are right). ``from_s`` and
    ``to_s``, on the true clock, leave out what is before and after.
    """

    def __init__(
        self,
        paths: Sequence[str | os.PathLike[str]],
        fps: float = 0.0,
        from_s: float = -math.inf,
        to_s: float = math.inf,
    ) -> None:
        self.paths = in_order(paths)
        self.from_s, self.to_s = from_s, to_s
        self.capture_rate = 0.0
        lengths: list[float] = []
        self.expected, self.telemetry = 0, Telemetry()
        for path in self.paths:
            with VideoReader(path) as video:
                size = (video.width, video.height)
                if not lengths:
                    self.width, self.height = size
                    self.period_s, self.codec = video.period_s, video.codec
                    self.capture_rate = video.capture_rate
                elif size != (self.width, self.height):
                    what = f"pictures are {size[0]}x{size[1]}, those of {self.paths[0].name} {self.width}x{self.height}"
                    raise TrackingError(f"{path}: {what}; they are not of one recording")
                lengths.append(video.duration_s)
                self.expected += video.expected
        self.telemetry = read_telemetry(self.paths[0])
        self.capture_rate = self.capture_rate or self.telemetry.rate
        self._slow = 1.0  # factor by which the time stamps are slower than real time
        if fps:
            self._slow, self.period_s = fps * self.period_s, 1 / fps
        whole_s = sum(lengths) / self._slow
        if max(from_s, 0.0) >= min(to_s, whole_s):
            what = f"{self.paths[0]}: no frame lies between {max(from_s, 0.0):g} and {min(to_s, whole_s):g} s"
            raise TrackingError(f"{what}; the video is {whole_s:.3f} s long")
        if math.isfinite(from_s) or math.isfinite(to_s):
            part_s = min(to_s, whole_s) - max(from_s, 0.0)
            self.expected = min(self.expected, round(part_s / self.period_s))
        self._starts_s = [sum(lengths[:k]) for k in range(len(lengths))]
        self._reader: VideoReader | None = None
        self.corrupt = self.repeated = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._reader:
            self._reader.__exit__(kind, error, at)

    def frames(self, after_s: float = float("-inf")) -> Iterator[Frame]:
        """Yield the frames of all files later than ``after_s``; ``corrupt`` and ``repeated`` count what was passed."""
        count, slow = 0, self._slow
        after_s = max(after_s, self.from_s - self.period_s / 4) * slow
        end_s = (self.to_s - self.period_s / 4) * slow
        for file, (path, start_s) in enumerate(zip(self.paths, self._starts_s, strict=True)):
            if file + 1 < len(self.paths) and after_s >= self._starts_s[file + 1] - self.period_s * slow / 2:
                continue
            if start_s >= end_s:
                return
            passed = self.corrupt
            with VideoReader(path) as self._reader:
                for frame in self._reader.frames(after_s - start_s):
                    time_s = start_s + frame.time_s
                    if time_s >= end_s:
                        break
                    self.corrupt = passed + frame.corrupt
                    yield replace(frame, index=count, time_s=time_s / slow, corrupt=self.corrupt, file=file)
                    count += 1
                report = self._reader.report()
                self.corrupt, self.repeated = passed + report.corrupt, self.repeated + report.repeated
            self._reader = None
