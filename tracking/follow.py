"""Follows the board from frame to frame: predict, sharpen, check; search again when lost, never guess."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.board import Board
from tracking.camera import IMAGE_DIRECTIONS, Camera
from tracking.corners import find_board, quarter_turns, read_squares, right_handed, sharpen, smallest_pitch
from tracking.errors import TrackingError
from tracking.pose import Plane, TipPose, apply, free_pose, world_from_tip

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

SEARCH_EVERY = 24  # frames between searches of the whole picture: at 0.1 s each they cost 4 ms a frame at most
_NEAR_SEARCHES = 3  # searches around the last place right after a loss: a few ms each
LARGEST_RESIDUAL = 0.05  # of the pitch: 1 px at 20 px a square, ten times what motion blur was seen to do
_PROVISIONAL = 3.0  # times that, until ``settle`` knows how askew the board is glued: 5 degrees pass
_LEAST_CONTRAST = 15.0  # grey levels between the colours' medians: below it there is no print to see
_FACING = 0.8  # cosine between board y and world Y: quarter turns give 0, the half turn -1

NOT_DUE = "lost, next search not yet due"
NO_FIT = "the corners fit no pose"


@dataclass(frozen=True)
class Sighting:
    """One trusted view of the board: corners (n, n, 2) px in board order, and the pose that explains them."""

    grid: Floats
    pose: TipPose


class Follower:
    """Follows one board through one video. State: the plane, the last two poses, and how long the board is lost.

    Without ``world_from_camera`` the first sighting is equated with ``rest_pose`` (x_m, z_m, phi_rad), which fixes the
    camera's place well enough to follow by; ``settle`` does better with more frames.
    """

    def __init__(self, camera: Camera, board: Board, rest_pose: tuple[float, float, float] | None) -> None:
        self.board, self.camera, self.rest_pose = board, camera, rest_pose
        self.plane: Plane | None = None
        if rest_pose is None:
            if camera.world_from_camera is None:
                raise TrackingError("track: the camera's place is unknown; give a rest pose, or world_from_camera")
            self.plane = Plane(camera.lens, camera.world_from_camera)
        self.points_m = apply(camera.tip_from_board, board.corner_points_m())
        self.centres_m = apply(camera.tip_from_board, board.square_centres_m())
        # A grid slipped by one square along a diagonal still fits (n-1)^2 true corners: ask for more than that.
        self.fewest = (board.corners - 1) ** 2 + 2
        self.polarity = 0.0  # sign of the board's contrast, learnt at the first sighting
        self.recent: list[tuple[float, Floats]] = []  # (time_s, pose), the last two
        self.lost = 0  # frames since the last sighting
        self.residual = LARGEST_RESIDUAL * (1.0 if rest_pose is None else _PROVISIONAL)

    def look(self, picture: Picture, time_s: float) -> Sighting | str:
        """Return the board in this picture, or the reason why it is not to be trusted."""
        outcome: Sighting | str = "no board in the picture"
        for start in self._predictions(time_s) if self.lost == 0 else ():
            assert self.plane is not None
            guess = self.plane.project(start, self.points_m).reshape(self.board.corners, self.board.corners, 2)
            outcome = self._check(picture, guess, start)
            if isinstance(outcome, Sighting):
                return self._keep(outcome, time_s)
        found = self._search(picture)
        if isinstance(found, Sighting):
            return self._keep(found, time_s)
        self.lost += 1
        return found or outcome

    def _keep(self, sighting: Sighting, time_s: float) -> Sighting:
        if self.lost:
            self.recent = []  # a velocity across a hole says nothing
        self.recent = [*self.recent[-1:], (time_s, sighting.pose.vector)]
        self.lost = 0
        return sighting

    def _predictions(self, time_s: float) -> list[Floats]:
        """Return the poses to try: constant velocity, then standing still (right after a snap has ended)."""
        if not self.recent:
            return []
        last_s, last = self.recent[-1]
        if len(self.recent) < 2:
            return [last]
        before_s, before = self.recent[0]
        return [last + (last - before) * (time_s - last_s) / (last_s - before_s), last]

    def _check(self, picture: Picture, guess: Floats, start: Floats) -> Sighting | str:
        """Sharpen a guessed grid (n, n, 2), fit it, and pass it through every gate."""
        assert self.plane is not None
        grid = sharpen(picture, guess) if np.all(np.isfinite(guess)) else None
        if grid is None:
            return "the board leaves the picture"
        pixels = grid.reshape(-1, 2)
        pose = self.plane.fit(pixels, self.points_m, start)
        if pose is None:
            return NO_FIT
        squares = self.board.squares
        centres = self.plane.project(pose.vector, self.centres_m).reshape(squares, squares, 2)
        contrast, whole = read_squares(picture, centres)
        if abs(contrast) < _LEAST_CONTRAST:
            return "too little contrast"
        if contrast * self.polarity < 0:
            return "black and white are swapped"
        if not whole.all():  # covered corners may have pulled at the first fit
            pose = self.plane.fit(pixels, self.points_m, pose.vector, whole.ravel())
        if pose is None or pose.used.sum() < self.fewest:
            return "too few corners to trust"
        if pose.rms_px > self.residual * smallest_pitch(grid):
            return NO_FIT
        self.polarity = float(np.sign(contrast))
        return Sighting(grid, pose)

    def _search(self, picture: Picture) -> Sighting | str | None:
        """Search around the last place, or now and then in the whole picture; None when it is not yet time."""
        n = self.board.corners
        if self.recent and self.plane and self.lost < _NEAR_SEARCHES:
            last = self.plane.project(self.recent[-1][1], self.points_m)
            reach = 0.6 * (last.max(axis=0) - last.min(axis=0)).max()
            left, top = np.maximum(np.floor(last.min(axis=0) - reach), 0).astype(int)
            right, bottom = np.ceil(last.max(axis=0) + reach).astype(int)
            found = find_board(np.ascontiguousarray(picture[top:bottom, left:right]), (n, n), halve=False)
            found = None if found is None else found + np.array((left, top))
        elif self.lost % SEARCH_EVERY == 0:
            found = find_board(picture, (n, n), halve=True)
        else:
            return NOT_DUE
        grid = None if found is None else sharpen(picture, right_handed(found))
        if grid is None:
            return None
        placed = self._orient(grid)
        outcome = self._check(picture, *placed) if placed else "the board faces out of the plane"
        if isinstance(outcome, str) and self.rest_pose and not self.recent:
            self.plane = None  # what it was placed by was no board
        return outcome

    def _orient(self, grid: Floats) -> tuple[Floats, Floats] | None:
        """Choose among the four quarter turns of a grid; return it in board order with its planar pose, or None."""
        turns, to_board = quarter_turns(grid), np.linalg.inv(self.camera.tip_from_board)
        points = self.board.corner_points_m()
        if self.plane is None:
            assert self.rest_pose is not None
            along_x = np.array(IMAGE_DIRECTIONS[self.camera.board_x_in_image])
            grid = max(turns, key=lambda turn: float((turn[-1].mean(axis=0) - turn[0].mean(axis=0)) @ along_x))
            free = free_pose(self.camera.lens, points, grid.reshape(-1, 2))
            if free is None:
                return None
            self.plane = plane_at_rest(self.camera, free[0], self.rest_pose)
            return grid, np.array(self.rest_pose)
        for turn in turns:
            free = free_pose(self.camera.lens, points, turn.reshape(-1, 2))
            if free is not None:
                start, facing = self.plane.pose_of(free[0] @ to_board)
                if facing > _FACING:
                    return turn, start
        return None


def plane_at_rest(camera: Camera, camera_from_board: Floats, rest_pose: tuple[float, float, float]) -> Plane:
    """Return the plane in which a board seen at ``camera_from_board`` (4x4) is the board of a tip at ``rest_pose``."""
    return Plane(camera.lens, world_from_tip(*rest_pose) @ camera.tip_from_board @ np.linalg.inv(camera_from_board))
