"""A second board, fixed in the world, that gives the camera's place."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.tracking.board import Board
from straw.tracking.camera import Camera, check_rigid
from straw.tracking.chapters import Timeline
from straw.tracking.corners import Print, Sighting, find_boards
from straw.tracking.errors import TrackingError
from straw.tracking.fields import Fields
from straw.tracking.pose import free_pose

Floats = NDArray[np.float64]

_FRAMES = 12  # frames used: their mean corner is far more accurate than the lens
_UPRIGHT = "up"


def place_by_reference(
    videos: Sequence[str | os.PathLike[str]], camera: Camera, reference: str | os.PathLike[str]
) -> Camera:
    """Return the camera placed by the reference board in the video's first frames.

    REF.json: ``squares``, ``squares_y`` and ``size_m`` as in ``Board``, ``world_from_board`` (4x4), and
    ``board_x_in_image`` as in ``Camera``. The board must differ from the tip's in its number of squares, which is how
    the two are told apart. TrackingError when the file is malformed or the board is not seen.
    """
    fields = Fields.load(reference)
    across = fields.integer("squares_y") if "squares_y" in fields else 0
    board = Board(fields.integer("squares"), fields.number("size_m"), across)
    world_from_board = np.array(fields.matrix("world_from_board", 4))
    check_rigid(world_from_board, f"{reference}: world_from_board")
    along = dataclasses.replace(camera, board_x_in_image=fields.text("board_x_in_image", _UPRIGHT)).image_x
    with Timeline(videos) as timeline:
        seen = []
        for frame in timeline.frames():
            if frame.index == _FRAMES:
                break
            found = _seen(Print(board, camera.lens), frame.luma, along)
            if found is not None:
                seen.append(found.grid)
    if not seen:
        what = f"{videos[0]}: the reference board of {board} is in none of the first {_FRAMES} frames"
        raise TrackingError(f"{what}; it must differ from the tip's board in its squares, and be fully visible")
    free = free_pose(camera.lens, board.corner_points_m(), np.median(seen, axis=0).reshape(-1, 2))
    if free is None:
        raise TrackingError(f"{reference}: the board's corners fit no pose; check that the lens is this camera's")
    return dataclasses.replace(camera, world_from_camera=world_from_board @ np.linalg.inv(free[0]))


def _seen(printed: Print, picture: NDArray[np.uint8], along: Floats) -> Sighting | None:
    """Return the board, seen whole, with its x along a direction of the picture."""
    for grid in find_boards(picture):
        if sorted(grid.shape[:2]) != sorted(printed.board.shape):
            continue
        laid = [printed.lay(picture, grid, turn, 0.0) for turn in range(4)]
        good = [found for found in laid if isinstance(found, Sighting) and found.used.all()]
        if good:
            return max(good, key=lambda found: float((found.grid[-1] - found.grid[0]).mean(axis=0) @ along))
    return None
