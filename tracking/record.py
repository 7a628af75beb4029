"""What was detected in each frame, on disk: memory does not grow with the video, and work can continue later."""

from __future__ import annotations

import hashlib
import json
import os
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from straw.tracking.corners import Sighting
from straw.tracking.errors import TrackingError
from straw.tracking.fields import reason
from straw.tracking.video import Frame

Rows = NDArray[Any]

SEEN = 0  # the status of a frame in which the board was seen; others count reasons from 1
_FLUSH = 240  # frames lost at most when the program is killed
CHUNK = 512  # frames worked on at a time


class Record:
    """One row a frame in a file: time, place in its video, status, corners (about 0.5 kB).

    The file opens with a digest of what it is a record of: ``Record(path, identity, shape)`` continues a file of the
    same identity and overwrites any other. ``seen`` False comes with the reason in words.
    """

    def __init__(self, path: Path, identity: Mapping[str, Any], shape: tuple[int, int]) -> None:
        self.path, self.shape = path, shape
        self.dtype = np.dtype(
            [
                ("time_s", "f8"),
                ("frame", "i8"),
                ("file", "i4"),
                ("corrupt", "i4"),
                ("key", "?"),
                ("between", "?"),
                ("seen", "?"),
                ("reason", "S60"),
                ("contrast", "f4"),
                ("rms_px", "f4"),
                ("widths", "f4", 2),
                ("homography", "f8", 9),
                ("grid", "f4", (*shape, 2)),
                ("used", "?", shape),
            ]
        )
        head = json.dumps(dict(identity), sort_keys=True).encode()
        self._head = hashlib.sha256(head + str(self.dtype).encode()).digest()
        self._waiting, self._buffer = 0, np.zeros(_FLUSH, self.dtype)
        self._columns = {name: self._buffer[name] for name in self.dtype.names or ()}
        self._reading = threading.Lock()
        try:
            self._file: IO[bytes] = self._opened()
        except OSError as error:
            raise TrackingError(f"{path}: cannot be written ({reason(error)}); check the folder") from None

    def _opened(self) -> IO[bytes]:
        if self.path.exists():
            file = self.path.open("r+b")
            if file.read(len(self._head)) == self._head:
                whole = (self.path.stat().st_size - len(self._head)) // self.dtype.itemsize
                file.truncate(len(self._head) + whole * self.dtype.itemsize)  # a row that was cut short
                file.seek(0, os.SEEK_END)
                self._count = whole
                return file
            file.close()
        self._count = 0
        file = self.path.open("w+b")
        file.write(self._head)
        return file

    def __len__(self) -> int:
        return self._count

    def add(self, frame: Frame, corrupt: int, found: Sighting | str) -> None:
        """Append what one frame showed; ``corrupt``: packets lost before it."""
        k, column = self._waiting, self._columns
        column["time_s"][k], column["frame"][k], column["file"][k] = frame.time_s, self._count, frame.file
        column["corrupt"][k], column["key"][k], column["between"][k] = corrupt, frame.key, frame.between
        if isinstance(found, Sighting):
            column["seen"][k], column["contrast"][k], column["rms_px"][k] = True, found.contrast, found.rms_px
            for name in ("widths", "homography", "grid", "used"):
                column[name][k] = getattr(found, name)
        else:
            column["reason"][k] = found.encode()[:60]
        self._waiting += 1
        self._count += 1
        if self._waiting == _FLUSH:
            self.flush()

    def flush(self) -> None:
        """Bring all rows to the file."""
        try:
            self._file.write(self._buffer[: self._waiting].tobytes())
            self._file.flush()
        except OSError as error:
            raise TrackingError(f"{self.path}: cannot be written ({reason(error)}); check the disk's space") from None
        self._buffer[: self._waiting] = 0
        self._waiting = 0

    def rows(self, start: int, stop: int) -> Rows:
        """Return rows ``start`` to ``stop`` (clipped to what there is); threads may ask at the same time."""
        start, stop = max(start, 0), min(stop, self._count)
        with self._reading:
            self.flush()
            self._file.seek(len(self._head) + start * self.dtype.itemsize)
            data = self._file.read(max(stop - start, 0) * self.dtype.itemsize)
            self._file.seek(0, os.SEEK_END)
        return np.frombuffer(data, self.dtype)

    def chunks(self) -> Iterator[tuple[int, Rows]]:
        """Yield (start, rows) over the whole record."""
        for start in range(0, self._count, CHUNK):
            yield start, self.rows(start, start + CHUNK)

    def ends(self) -> tuple[Sighting, list[tuple[float, Sighting]], int] | None:
        """Return the first sighting, the last two that follow on one another, and the frames since; None if none."""
        first, last, since = None, np.empty(0, self.dtype), 0
        for _, rows in self.chunks():
            seen = np.flatnonzero(rows["seen"])
            since = len(rows) - 1 - int(seen[-1]) if len(seen) else since + len(rows)
            if len(seen):
                first, last = first or _sighting(rows[seen[0]]), rows[seen[-2:]]
        if first is None:
            return None
        if len(last) == 2 and last["frame"][1] - last["frame"][0] > 1:
            last = last[1:]
        return first, [(float(row["time_s"]), _sighting(row)) for row in last], since

    def close(self) -> None:
        """Close the file; it stays on disk."""
        if not self._file.closed:
            self.flush()
            self._file.close()

    def remove(self) -> None:
        """Close and delete the file."""
        self._waiting = 0
        self._file.close()
        self.path.unlink(missing_ok=True)


def _sighting(row: Any) -> Sighting:
    grid = row["grid"].astype(np.float64)
    return Sighting(
        grid=grid,
        used=row["used"].copy(),
        homography=row["homography"].copy(),
        widths=row["widths"].astype(np.float64),
        pitch_px=min(float(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min()) for axis in (0, 1)),
        contrast=float(row["contrast"]),
        rms_px=float(row["rms_px"]),
    )
