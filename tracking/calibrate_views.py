"""What a lens is calibrated from: the checkerboards in stills and videos, with their corners to sub-pixel."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from straw.tracking.corners import find_boards
from straw.tracking.edges import measure_all
from straw.tracking.errors import TrackingError
from straw.tracking.lattice import chequered
from straw.tracking.lens_fit import View
from straw.tracking.sharpen import FEWEST_CORNERS
from straw.tracking.video import VideoReader

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

STILLS = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp")
_LOOKED_AT = 48  # frames of each video, evenly spread: the search for boards takes most of the time
_ALIKE = 1.5  # grey levels, mean over a small picture: nothing has moved since the last frame looked at
_THUMB = (64, 36)


def pictures(paths: Sequence[str | os.PathLike[str]]) -> Iterator[tuple[str, Picture, int]]:
    """Yield (name, luma, how many there may be) of every still, and of frames spread over each video."""
    for path in map(Path, paths):
        if path.suffix.lower() in STILLS:
            picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) if path.is_file() else None
            if picture is None:
                raise TrackingError(f"{path}: not a readable picture; check the path and the file")
            yield path.name, np.asarray(picture, dtype=np.uint8), len(paths)
            continue
        with VideoReader(path) as video:
            every, last = max(-(-video.expected // _LOOKED_AT), 1), None
            for frame in video.frames():
                if frame.index % every == 0:
                    small = cv2.resize(frame.luma, _THUMB, interpolation=cv2.INTER_AREA).astype(np.float64)
                    if last is None or np.abs(small - last).mean() > _ALIKE:
                        last = small
                        yield f"{path.name} at {frame.time_s:.2f} s", frame.luma, -(-video.expected // every)


def views_in(name: str, picture: Picture, board: tuple[int, int] | None) -> list[View]:
    """Return the boards in a picture, with refined corners; boards of more squares than ``board`` are left out."""
    found = []
    for seen in find_boards(picture):
        grid = chequered(picture, seen)
        if grid is None or (board and not _fits(grid.shape[:2], board)):
            continue
        pixels, used = sharpened(picture, grid)
        if np.count_nonzero(used) >= FEWEST_CORNERS:
            i, j = np.indices(grid.shape[:2])
            points = (
                np.column_stack((i.ravel(), j.ravel(), np.zeros(i.size))) - np.array((*grid.shape[:2], 1.0)) / 2 + 0.5
            )
            found.append(View(np.asarray(points[used], dtype=np.float64), pixels[used], name))
    return found


def _fits(corners: tuple[int, ...], board: tuple[int, int]) -> bool:
    """Return whether a grid of corners can be a part of a board of so many squares, in either orientation."""
    return all(few < many for few, many in zip(sorted(corners), sorted(board), strict=True))


def sharpened(picture: Picture, grid: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the corners (n, 2) of a grid (r, c, 2) to sub-pixel; edge directions come from neighbours, not a lens."""
    r, c = grid.shape[:2]
    i, j = np.indices((r, c))
    parity = np.where((i + j) % 2 == 0, 1.0, -1.0).ravel()
    pixels, explained = grid.reshape(-1, 2).copy(), np.empty(r * c)
    used, widths = np.ones(r * c, np.bool_), np.full(2, 2.5)
    for _ in range(4):
        here = pixels.reshape(r, c, 2)
        along, across = np.gradient(here, axis=0), np.gradient(here, axis=1)
        where = np.concatenate((here, along, across, np.zeros((r, c, 2))), axis=-1).reshape(-1, 8)
        seen = np.empty_like(pixels)
        measure_all(picture, where, parity, widths, 1, seen, explained, used)
        pixels = np.where(used[:, None], seen, pixels)
    return pixels, used
