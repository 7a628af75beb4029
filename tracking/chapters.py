"""A recording in one file or several: GoPro chapters as one timeline, chained by their streams' length."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

from tracking.errors import TrackingError
from tracking.gpmf import Telemetry, read_telemetry
from tracking.video import Frame, VideoReader

_CHAPTER = re.compile(r"G[HX](\d\d)(\d{4})\.(mp4|mov)", re.IGNORECASE)  # GH: H.264, GX: HEVC; chapter, then recording


def in_order(paths: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """Return the files of one recording in order: GoPro chapters by their numbers, anything else as given.

    TrackingError for chapters of two recordings, or when one between the others is missing.
    """
    files = [Path(path) for path in paths]
    if not files:
        raise TrackingError("track: no video given; name its files")
    found = [_CHAPTER.fullmatch(file.name) for file in files]
    numbers = [(match[2], int(match[1])) for match in found if match]
    if len(files) == 1 or len(numbers) < len(files):
        return files
    files = [file for _, file in sorted(zip(numbers, files, strict=True))]
    numbers.sort()
    if len({recording for recording, _ in numbers}) > 1:
        raise TrackingError(f"{files[0]} and {files[-1]}: chapters of two recordings; track each on its own")
    for (_, before), (_, after), file in zip(numbers, numbers[1:], files[1:], strict=False):
        if after != before + 1:
            raise TrackingError(f"{file}: chapter {after} follows on chapter {before}; name each in between, once")
    return files


def siblings(paths: Sequence[Path]) -> list[Path]:
    """Return chapters of the same recording that lie beside the first file but are not among ``paths``."""
    match = _CHAPTER.fullmatch(paths[0].name)
    if not match:
        return []
    beside = [(other, _CHAPTER.fullmatch(other.name)) for other in paths[0].parent.iterdir()]
    return sorted(other for other, its in beside if its and its[2] == match[2] and other not in paths)


class Timeline:
    """The files of one recording as one stream of frames; use as a context manager, as ``VideoReader``."""

    def __init__(self, paths: Sequence[str | os.PathLike[str]]) -> None:
        self.paths = in_order(paths)
        lengths: list[float] = []
        self.expected, self.telemetry = 0, Telemetry()
        for path in self.paths:
            with VideoReader(path) as video:
                size = (video.width, video.height)
                if not lengths:
                    self.width, self.height = size
                    self.period_s, self.codec = video.period_s, video.codec
                elif size != (self.width, self.height):
                    what = f"pictures are {size[0]}x{size[1]}, those of {self.paths[0].name} {self.width}x{self.height}"
                    raise TrackingError(f"{path}: {what}; they are not of one recording")
                lengths.append(video.duration_s)
                self.expected += video.expected
        self.telemetry = read_telemetry(self.paths[0])
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
        count = 0
        for file, (path, start_s) in enumerate(zip(self.paths, self._starts_s, strict=True)):
            if file + 1 < len(self.paths) and after_s >= self._starts_s[file + 1] - self.period_s / 2:
                continue
            passed = self.corrupt
            with VideoReader(path) as self._reader:
                for frame in self._reader.frames(after_s - start_s):
                    self.corrupt = passed + frame.corrupt
                    yield replace(frame, index=count, time_s=start_s + frame.time_s, corrupt=self.corrupt, file=file)
                    count += 1
                report = self._reader.report()
                self.corrupt, self.repeated = passed + report.corrupt, self.repeated + report.repeated
            self._reader = None
