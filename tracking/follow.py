"""Follows the board from frame to frame: predict, refine, check; search again when it is lost."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.corners import Print, Sighting, find_boards
from straw.tracking.errors import TrackingError
from straw.tracking.pose import Plane, apply, free_pose, world_from_tip
from straw.tracking.sharpen import LARGEST_RESIDUAL

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]
Rest = tuple[float, float, float]

SEARCH_EVERY = 24  # frames between searches of the whole picture: at 0.1 s each they cost 4 ms a frame
_NEAR_SEARCHES = 3  # searches around the last place right after a loss: a few ms each
_TRY_EVERY = 3  # frames between correlation searches during the second after a loss: 3 ms each
_NEAR_EVERY = 6  # and between searches around the last place, 15 ms each: within ten frames of its return it is found
_NEAR_FOR = 240
_AGAIN = 2  # searches directly after one that found a grid but no board (OpenCV may skip rows): at most 12 ms a frame
# factor on the allowed residual of the planar fit until ``settle`` has estimated how the board is glued
_PROVISIONAL = 3.0
_STEADY = 0.7  # of a square: with less motion from frame to frame a grid cannot slip, which takes 1.4
_FACING = 0.8  # cosine between tip y and world Y: quarter turns of a board on the face give 0, the half turn -1

NOT_DUE = "lost, next search not yet due"


class Follower:
    """Follows one board through one video. State: the last two homographies, the edges' widths, frames since its loss.

    Corners are followed in the picture alone; the plane of motion is used only when a board is first found, to choose
    between several and between its orientations. Without ``world_from_camera`` the first sighting is equated with
    ``rest_pose`` (x_m, z_m, phi_rad), which is good enough for that. ``near_px`` (u, v): the board meant, where several
    start.
    """

    def __init__(
        self, camera: Camera, board: Board, rest_pose: Rest | None, near_px: tuple[float, float] | None = None
    ) -> None:
        self.board, self.camera, self.rest_pose, self.near_px = board, camera, rest_pose, near_px
        self.plane: Plane | None = None  # None until the first sighting, where a rest pose places the camera
        if camera.world_from_camera is not None and rest_pose is None:
            self.plane = Plane(camera.lens, camera.world_from_camera)
        elif rest_pose is None:
            raise TrackingError("track: the camera's place is unknown; give a rest pose, or world_from_camera")
        self.points_m = apply(camera.tip_from_board, board.corner_points_m())
        self.print = Print(board, camera.lens)
        self.sign = 0.0  # of the board's contrast, learnt at the first sighting
        self.phi_rad = rest_pose[2] if rest_pose else None  # when last taken up
        self.recent: list[tuple[float, Sighting]] = []  # (time_s, sighting), the last two
        self.lost = 0  # frames since the last sighting
        self.again = 0  # whole searches that may follow at once

    def look(self, picture: Picture, time_s: float) -> Sighting | str:
        """Return the board in this picture, or the reason why it is not to be trusted."""
        outcome: Sighting | str = "no board in the picture"
        if self.recent and self.lost == 0:
            last = self.recent[-1][1]
            guess = self._predicted(time_s)
            steady = self._apart(guess, last) < _STEADY
            outcome = self.print.sharpen(picture, guess, last.widths, self.sign, steady=steady)
            if isinstance(outcome, str) and len(self.recent) == 2:  # right after a snap has ended it stands still
                outcome = self.print.sharpen(picture, last.homography, last.widths, self.sign, steady=True)
            if isinstance(outcome, str):
                outcome = self.print.sharpen(picture, guess, None, self.sign)
            if isinstance(outcome, str):
                shifted = self.print.shifted(picture, guess, self.sign)
                outcome = self.print.sharpen(picture, shifted, None, self.sign)
        if isinstance(outcome, str) and self.recent and 0 < self.lost < _NEAR_FOR and self.lost % _TRY_EVERY == 0:
            outcome = self._where_it_was(picture)
        if isinstance(outcome, str):
            outcome = self._search(picture, time_s) or outcome
        if isinstance(outcome, str):
            self.lost += 1
        else:
            self.resume(time_s, outcome)
        return outcome

    def resume(self, time_s: float, sighting: Sighting) -> None:
        """Go on from a sighting."""
        if self.lost:
            self.recent = []  # across a gap the velocity is unknown
        self.recent = [*self.recent[-1:], (time_s, sighting)]
        self.lost, self.again, self.sign = 0, 0, float(np.sign(sighting.contrast))

    def take_over(self, first: Sighting, recent: list[tuple[float, Sighting]], lost: int) -> None:
        """Go on after frames that another follower has looked at: its first and last sightings, and how long ago."""
        if self.plane is None:
            self._place(first)
        self.sign, self.recent, self.lost = float(np.sign(first.contrast)), recent, lost
        self.phi_rad = self._in_plane(recent[-1][1]) or self.phi_rad

    def _where_it_was(self, picture: Picture) -> Sighting | str:
        """Return the board within two squares of its last place, seen in parts, too, which no search finds."""
        shifted = self.print.shifted(picture, self.recent[-1][1].homography, self.sign)
        outcome = self.print.sharpen(picture, shifted, None, self.sign)
        if isinstance(outcome, Sighting) and self.plane and self._in_plane(outcome) is None:
            return "the board faces out of the plane"
        return outcome

    def _predicted(self, time_s: float) -> Floats:
        """Return the homography at constant velocity."""
        last_s, last = self.recent[-1]
        if len(self.recent) < 2:
            return last.homography
        before_s, before = self.recent[0]
        ahead = (time_s - last_s) / (last_s - before_s)
        return last.homography + min(ahead, 2.0) * (last.homography - before.homography)

    def _apart(self, guess: Floats, last: Sighting) -> float:
        """Return how far, in squares, the guess has the board's middle from where it was."""
        lens = self.camera.lens
        (u, v, w), (u0, v0, w0) = guess[2::3].tolist(), last.homography[2::3].tolist()
        moved_px = math.hypot(lens.fx * (u / w - u0 / w0), lens.fy * (v / w - v0 / w0))
        return moved_px / last.pitch_px

    def _search(self, picture: Picture, time_s: float) -> Sighting | str | None:
        """Search around the last place, or now and then in the whole picture; None when nothing was found."""
        whole = self.lost >= _NEAR_SEARCHES and self.lost % SEARCH_EVERY == 0
        near = self.lost < _NEAR_SEARCHES or (self.lost < _NEAR_FOR and self.lost % _NEAR_EVERY == 0)
        if self.recent and near and not whole and not self.again:
            corners = self.recent[-1][1].grid.reshape(-1, 2)
            low, high = corners.min(axis=0), corners.max(axis=0)
            reach = 0.6 * (high - low).max()
            left, top = np.maximum(np.floor(low - reach), 0).astype(int)
            right, bottom = np.ceil(high + reach).astype(int)
            region, corner = np.ascontiguousarray(picture[top:bottom, left:right]), np.array((left, top))
            again = int(self.again)  # none are due
        elif self.lost % SEARCH_EVERY == 0 or self.again:
            region, corner = picture, np.zeros(2)
            again = _AGAIN if self.lost % SEARCH_EVERY == 0 else self.again - 1
        else:
            return NOT_DUE
        outcome: str | None = None
        boards = (grid + corner for grid in find_boards(region))
        for grid in _nearest_first(boards, self._wanted(picture)):
            seen = self._take_up(picture, grid, self._expected_phi(time_s))
            if isinstance(seen, Sighting):
                return seen
            outcome = outcome or seen
        self.again = again if outcome else 0
        return outcome

    def _wanted(self, picture: Picture) -> Floats:
        """Return where the board is expected, px."""
        if self.recent:
            return np.asarray(self.recent[-1][1].grid.mean(axis=(0, 1)))
        return np.array(self.near_px or (picture.shape[1] / 2, picture.shape[0] / 2))

    def _expected_phi(self, time_s: float) -> float | None:
        """Return phi when last seen, gone on at its rate for less than half a turn; None before the first sighting."""
        if self.plane is None or not self.recent:
            return self.phi_rad
        (before_s, before), (last_s, last) = self.recent[0], self.recent[-1]
        here, there = self._in_plane(last), self._in_plane(before)
        if here is None or there is None:
            return here if here is not None else self.phi_rad
        turned = _wrapped(here - there) / max(last_s - before_s, 1e-9) * (time_s - last_s)
        return here + turned if abs(turned) < np.pi else here

    def _take_up(self, picture: Picture, grid: Floats, expected_rad: float | None) -> Sighting | str:
        """Choose among the quarter turns of a grid the one that the colours and the plane of motion allow.

        Of two that differ by half a turn, the one nearer to the expected phi.
        """
        outcome: Sighting | str = "no board in the picture"
        placed: list[tuple[float, Sighting, float]] = []
        for turn in range(4):
            seen = self.print.lay(picture, grid, turn, self.sign)
            if isinstance(seen, str):
                outcome = seen
                continue
            phi_rad = self._in_plane(seen) if self.plane else 0.0
            if phi_rad is None:
                outcome = "the board faces out of the plane"
            elif expected_rad is None or self.plane is None:  # for the first time: as the camera file says
                along = np.diff(seen.grid, axis=0).mean(axis=(0, 1))
                placed.append((-float(along @ self.camera.image_x), seen, phi_rad))
            else:
                placed.append((abs(_wrapped(phi_rad - expected_rad)), seen, phi_rad))
        if not placed:
            return outcome
        _, seen, phi_rad = min(placed, key=lambda one: one[0])
        if self.plane is None:
            return seen if self._place(seen) else "the corners fit no pose"
        self.phi_rad = phi_rad
        return seen

    def _place(self, seen: Sighting) -> bool:
        """Equate a sighting with the rest pose, which tells the plane of motion."""
        free = self._free(seen)
        if free is not None and self.rest_pose is not None:
            self.plane = plane_at_rest(self.camera, free, self.rest_pose)
        return self.plane is not None

    def _free(self, seen: Sighting) -> Floats | None:
        used = seen.used.ravel()
        free = free_pose(self.camera.lens, self.board.corner_points_m()[used], seen.grid.reshape(-1, 2)[used])
        return free[0] if free else None

    def _in_plane(self, seen: Sighting) -> float | None:
        """Return phi when the board's pose is one that the tip can take in the plane of motion."""
        assert self.plane is not None
        free = self._free(seen)
        if free is None:
            return None
        start, facing = self.plane.pose_of(free @ np.linalg.inv(self.camera.tip_from_board))
        if facing < _FACING:
            return None
        pose = self.plane.fit(seen.grid.reshape(-1, 2), self.points_m, start, seen.used.ravel())
        good = pose is not None and pose.rms_px < _PROVISIONAL * LARGEST_RESIDUAL * seen.pitch_px
        return pose.phi_rad if pose and good else None


def _nearest_first(boards: Iterator[Floats], wanted: Floats) -> Iterator[Floats]:
    """Yield grids (r, c, 2) by their middle's distance from ``wanted`` (2,), px.

    A search takes 0.05 s: before the next one, a board is yielded that is nearer than any beside it can be.
    """
    others: list[tuple[float, Floats]] = []
    for grid in boards:
        away = float(np.hypot(*(grid.mean(axis=(0, 1)) - wanted)))
        across, down = (np.linalg.norm(side, axis=-1).min() for side in (grid[-1] - grid[0], grid[:, -1] - grid[:, 0]))
        if away < min(across, down) / 4:
            yield grid
        else:
            others.append((away, grid))
    yield from (grid for _, grid in sorted(others, key=lambda one: one[0]))


def plane_at_rest(camera: Camera, camera_from_board: Floats, rest_pose: Rest) -> Plane:
    """Return the plane in which a board seen at ``camera_from_board`` (4x4) is the board of a tip at ``rest_pose``."""
    return Plane(camera.lens, world_from_tip(*rest_pose) @ camera.tip_from_board @ np.linalg.inv(camera_from_board))


def _wrapped(angle_rad: float) -> float:
    return float((angle_rad + np.pi) % (2 * np.pi) - np.pi)
