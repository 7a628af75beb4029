"""Settles a followed video: places the camera by the still frames, finds how the board is glued, fits all anew."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracking.board import Board
from tracking.camera import Camera
from tracking.corners import smallest_pitch
from tracking.errors import TrackingError
from tracking.follow import LARGEST_RESIDUAL, plane_at_rest
from tracking.pose import Plane, TipPose, apply, free_pose

Floats = NDArray[np.float64]

# Corners of one row or column share their pixel phase and their codec blocks, so their errors are shared too: 14 lines
# of 49 corners would make the share of independent ones 0.29; painted and encoded clips say 0.2.
INDEPENDENT = 0.2
REST_FRAMES = 60  # at most; a quarter of a second brings the noise of the mean corner below what H.264 leaves in it
_FEWEST_REST_FRAMES = 5
_STILL_PX = 0.2  # shift of the board's centre that ends the rest: ten times the centre's noise
_GLUED_RAD = 0.02  # how askew a careful hand glues: without motion to tell, the turn stays near zero
_SPREAD = 40  # frames for each of x, z and phi that the turn is found from


@dataclass(frozen=True)
class Seen:
    """The corners of one frame (n, 2) px in board order, which of them count (n,), and the pose followed by (3,)."""

    pixels: NDArray[np.float32]
    used: NDArray[np.bool_]
    pose: Floats


@dataclass(frozen=True)
class Settled:
    """The camera with its place and the board's turn found, the turn's sigma, and the pose of each frame."""

    camera: Camera
    turn_sigma_rad: tuple[float, float]
    rest_frames: int
    poses: list[TipPose | None]


def settle(camera: Camera, board: Board, rest_pose: tuple[float, float, float], seen: Sequence[Seen]) -> Settled:
    """Equate the board at rest with the known tip pose, let the motion tell the board's turn, and fit all frames.

    The board's free pose at rest (six unknowns) fixes all but how the board is glued. Taking it for square when it is
    not tilts the world: at 25 degrees of obliquity every degree makes x 4 % too long or short. But then the size of the
    board in the picture contradicts its sideways travel, and that tells the two turns about its x and z.
    """
    still = _still(seen)
    if still < _FEWEST_REST_FRAMES:
        what = f"track: only {still} still frames at the start, {_FEWEST_REST_FRAMES} are needed for the rest pose"
        raise TrackingError(f"{what}; start the camera earlier, or give world_from_camera")
    # The median over frames: one frame with a fly on the board must not move the world.
    corners = np.median([frame.pixels for frame in seen[:still]], axis=0).astype(np.float64)
    free = free_pose(camera.lens, board.corner_points_m(), corners)
    if free is None:
        raise TrackingError("track: the board at rest fits no pose; check that the lens is this camera's")
    glue = _Glue(camera, board, rest_pose, free[0])
    turn, sigma = glue.find([seen[k] for k in _spread(np.array([frame.pose for frame in seen]))])
    camera = glue.camera(turn)
    plane, points_m = glue.plane(turn)
    poses = [_final(frame, plane, points_m, board.corners) for frame in seen]
    placed = dataclasses.replace(camera, world_from_camera=plane.world_from_camera)
    return Settled(placed, sigma, still, poses)


def _final(frame: Seen, plane: Plane, points_m: Floats, n: int) -> TipPose | None:
    pixels = frame.pixels.astype(np.float64)
    pose = plane.fit(pixels, points_m, frame.pose, frame.used)
    good = pose is not None and pose.rms_px <= LARGEST_RESIDUAL * smallest_pitch(pixels.reshape(n, n, 2))
    return pose if good else None


def _still(seen: Sequence[Seen]) -> int:
    """Count the frames at the start in which the board's centre stays where it was."""
    centres = np.array([frame.pixels.mean(axis=0, dtype=np.float64) for frame in seen[:REST_FRAMES]])
    moved = np.hypot(*(centres - centres[0]).T) > _STILL_PX
    return int(np.argmax(moved)) if moved.any() else len(moved)


def _spread(poses: Floats) -> list[int]:
    """Return frames that cover the range of x, of z and of phi evenly; most frames of a long video are alike."""
    chosen: set[int] = set()
    for values in poses.T:
        order = np.argsort(values)
        wanted = np.linspace(values[order[0]], values[order[-1]], _SPREAD)
        chosen.update(order[np.minimum(np.searchsorted(values[order], wanted), len(order) - 1)].tolist())
    return sorted(chosen)


class _Glue:
    """The two small turns of the board on the tip, found by least squares over frames with a pose each."""

    def __init__(
        self, camera: Camera, board: Board, rest_pose: tuple[float, float, float], camera_from_board: Floats
    ) -> None:
        self._camera, self._board, self._rest, self._seen_at = camera, board, rest_pose, camera_from_board

    def camera(self, turn: Floats) -> Camera:
        return dataclasses.replace(self._camera, board_turn_rad=(float(turn[0]), float(turn[1])))

    def plane(self, turn: Floats) -> tuple[Plane, Floats]:
        camera = self.camera(turn)
        points_m = apply(camera.tip_from_board, self._board.corner_points_m())
        return plane_at_rest(camera, self._seen_at, self._rest), points_m

    def find(self, frames: Sequence[Seen]) -> tuple[Floats, tuple[float, float]]:
        """Gauss-Newton on the turn, every frame's pose solved anew at each trial (variable projection)."""
        start = np.array(self._camera.board_turn_rad)
        turn, step = start, 1e-3
        prior = np.eye(2) / _GLUED_RAD**2
        covariance = np.linalg.inv(prior)
        for _ in range(3):  # the problem is nearly linear: the second step is already below a microradian
            here = self._residuals(turn, frames)
            slopes = [(self._residuals(turn + step * axis, frames) - here) / step for axis in np.eye(2)]
            J = np.stack(slopes, axis=-1)
            known = np.isfinite(here) & np.isfinite(J).all(axis=-1)
            J, left = J[known], here[known]
            weight = INDEPENDENT / max(float(np.mean(left**2)), 1e-12)
            covariance = np.linalg.inv(weight * J.T @ J + prior)
            turn = turn - covariance @ (weight * J.T @ left + prior @ (turn - start))
        about_x, about_z = map(float, np.sqrt(np.diag(covariance)))
        return turn, (about_x, about_z)

    def _residuals(self, turn: Floats, frames: Sequence[Seen]) -> Floats:
        """Return what each frame's best pose leaves (frames * n * 2,) in px; NaN for corners that do not count."""
        plane, points_m = self.plane(turn)
        rows = []
        for frame in frames:
            solved = plane.solve(frame.pixels.astype(np.float64), points_m, frame.pose, frame.used)
            residual = solved[1] if solved else np.full((len(points_m), 2), np.nan)
            rows.append(np.where(frame.used[:, None], residual, np.nan).ravel())
        return np.concatenate(rows)
