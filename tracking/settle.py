"""Settles a followed video: the camera's place, how the board is glued and the shutter's row time, by its motion."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracking.board import Board
from tracking.camera import Camera
from tracking.errors import TrackingError
from tracking.follow import Rest, plane_at_rest
from tracking.pose import Plane, apply, free_pose
from tracking.views import Views

Floats = NDArray[np.float64]

REST_FRAMES = 60  # at most; a quarter of a second brings the noise of the mean corner below what H.264 leaves in it
FEWEST_REST_FRAMES = 5
STILL_PX = 0.2  # shift of the board's centre that ends the rest: ten times the centre's noise
_GLUED_RAD = 0.02  # how askew a careful hand glues: without motion to tell, the turn stays near zero
_LINE_S = 4e-6  # a row takes at most the frame's 4.17 ms / 1080 at 240 frames/s; and longer in slower modes
_ASIDE_M = 0.01  # how far the board's centre may lie beside the plane of motion
_REST_WEIGHT = 4.0  # of the mean rest frame, in frames: what its many frames share does not average out
_ROUNDS = 8
_FIXED, _FREE = 1e-12, 1e3
# The constants: the camera's turn about the world's X, Y, Z at the board (rad), its shift along them (m), the board's
# turn about the tip's x and z (rad), the shutter's time from row to row (s).
_STEP = np.array((1e-6, 1e-6, 1e-6, 1e-7, 1e-7, 1e-7, 1e-6, 1e-6, 1e-9))


@dataclass(frozen=True)
class Settled:
    """What a video has in common: the camera with its place, turn and row time, and the last two's sigmas."""

    camera: Camera
    turn_sigma_rad: tuple[float, float]
    line_sigma_s: float
    rest_frames: int

    @property
    def plane(self) -> Plane:
        """The plane of motion as this camera sees it."""
        assert self.camera.world_from_camera is not None
        return Plane(self.camera.lens, self.camera.world_from_camera)


def settle(
    camera: Camera, board: Board, rest_pose: Rest | None, views: Views, *, level: bool = False, exposure_s: float = 0.0
) -> Settled:
    """Find the constants of a video from some of its frames, which must be in order and begin with the first ones.

    With ``rest_pose`` (x_m, z_m, phi_rad) the mean of the still frames at the start is the board at that pose, which
    fixes three of the camera's six unknowns; that all frames share one plane of motion fixes the others, and how askew
    the board is glued. Taking it for square when it is not tilts the world: at 25 degrees of obliquity every degree
    makes x 4 % too long or short. ``level``: the camera stands level, so phi is measured rather than given. Without
    ``rest_pose`` the camera's given place stays, and only the board's distance from the plane, its turn and the row
    time are found. Least squares over all corners, each frame's pose eliminated (Schur complement).
    """
    still = _still(views) if rest_pose else 0
    if rest_pose:
        if still < FEWEST_REST_FRAMES:
            what = f"track: only {still} still frames at the start, {FEWEST_REST_FRAMES} are needed for the rest pose"
            raise TrackingError(f"{what}; start the camera earlier, or give world_from_camera")
        camera = _placed_by_rest(camera, board, rest_pose, views, still, level=level)
        views = _with_mean_rest(views, still)
    return _Bundle(camera, board, rest_pose, views, level, exposure_s).solved(still)


def _still(views: Views) -> int:
    """Count the frames at the start in which the board's centre stays where it was."""
    centres = views.rays[:REST_FRAMES].mean(axis=1) * np.sqrt(np.abs(np.linalg.det(views.px_per_ray[0, 0])))
    moved = np.hypot(*(centres - centres[0]).T) > STILL_PX
    return int(np.argmax(moved)) if moved.any() else len(moved)


def _with_mean_rest(views: Views, still: int) -> Views:
    """Put one frame, the median, in place of the still ones: a fly on the board in one of them must not move it."""
    ours = {name: getattr(views, name).copy() for name in ("rays", "used", "rate", "bend")}
    ours["rays"][0] = np.median(views.rays[:still], axis=0)
    ours["used"][0] = views.used[:still].mean(axis=0) > 0.5
    ours["rate"][0] = ours["bend"][0] = 0.0
    return dataclasses.replace(views, **ours).pick(np.array([0, *range(still, len(views.time_s))]))


def _placed_by_rest(camera: Camera, board: Board, rest: Rest, views: Views, still: int, *, level: bool) -> Camera:
    """Return the camera placed by the board's free pose at rest, roughly."""
    rays, used = np.median(views.rays[:still], axis=0), views.used[:still].mean(axis=0) > 0.5
    pixels = camera.lens.project(np.column_stack((rays, np.ones(len(rays)))))
    free = free_pose(camera.lens, board.corner_points_m()[used], pixels[used])
    if free is None:
        raise TrackingError("track: the board at rest fits no pose; check that the lens is this camera's")
    plane = plane_at_rest(camera, free[0], rest)
    place = plane.world_from_camera
    if level:  # image x is level, the axis too: only the heading is the board's
        heading = place[:3, 2] * (1, 1, 0)
        ahead = heading / np.linalg.norm(heading)
        upright = np.column_stack((np.cross((0, 0, -1), ahead), (0, 0, -1), ahead))
        seen_m = free[0][:3, 3]
        centre = place[:3, :3] @ seen_m + place[:3, 3]
        place = np.eye(4)
        place[:3, :3], place[:3, 3] = upright, centre - upright @ seen_m
    return dataclasses.replace(camera, world_from_camera=place)


class _Bundle:
    """The least-squares problem over some frames; see ``settle``."""

    def __init__(
        self, camera: Camera, board: Board, rest: Rest | None, views: Views, level: bool, exposure_s: float
    ) -> None:
        assert camera.world_from_camera is not None
        self.camera, self.board, self.rest, self.views, self.exposure_s = camera, board, rest, views, exposure_s
        self.place = camera.world_from_camera
        self.centre = np.array((rest[0], 0.0, rest[1])) if rest else np.zeros(3)
        start_turn, line = np.array(camera.board_turn_rad), camera.line_s
        if rest:
            tilt = _FIXED if level else _FREE
            sigma = (tilt, tilt, _FREE, _FREE, _FREE, _FREE)
        else:
            sigma = (_FIXED, _FIXED, _FIXED, _FIXED, _ASIDE_M, _FIXED)
        self.prior = np.array((*sigma, _GLUED_RAD, _GLUED_RAD, _LINE_S if line is None else _FIXED))
        self.start = np.concatenate((np.zeros(6), start_turn, (line or 0.0,)))
        # Rest frame: x and z known, phi too unless the level says it.
        self.held = np.zeros((len(views.time_s), 3), np.bool_)
        self.weight = np.ones(len(views.time_s))
        if rest:
            self.held[0] = (True, True, not level)
            self.weight[0] = _REST_WEIGHT

    def camera_at(self, theta: Floats) -> Camera:
        """Return the camera with the constants applied."""
        turn = Rotation.from_rotvec(theta[:3]).as_matrix()
        place = np.eye(4)
        place[:3, :3] = turn @ self.place[:3, :3]
        place[:3, 3] = turn @ (self.place[:3, 3] - self.centre) + self.centre + theta[3:6]
        return dataclasses.replace(
            self.camera,
            world_from_camera=place,
            board_turn_rad=(float(theta[6]), float(theta[7])),
            line_s=float(theta[8]),
        )

    def _misses(self, theta: Floats, poses: Floats) -> Floats:
        """Return the residuals (f, n, 2) in px."""
        camera = self.camera_at(theta)
        assert camera.world_from_camera is not None
        to_camera = np.linalg.inv(camera.world_from_camera)
        points = apply(camera.tip_from_board, self.board.corner_points_m())
        sin, cos = np.sin(poses[:, 2:]), np.cos(poses[:, 2:])
        world = np.stack(
            (
                cos * points[:, 0] + sin * points[:, 2] + poses[:, :1],
                np.broadcast_to(points[:, 1], (len(poses), len(points))),
                cos * points[:, 2] - sin * points[:, 0] + poses[:, 1:2],
            ),
            axis=-1,
        )
        seen = world @ to_camera[:3, :3].T + to_camera[:3, 3]
        miss = self.views.at_once(float(theta[8]), self.exposure_s) - seen[..., :2] / seen[..., 2:]
        return np.asarray(np.einsum("fnij,fnj->fni", self.views.px_per_ray, miss))

    def solved(self, still: int) -> Settled:
        """Gauss-Newton to the end; TrackingError when the frames contradict each other."""
        theta, used = self.start, self.views.used
        poses = self._first_poses(theta)
        spread = np.eye(9)
        for _ in range(_ROUNDS):
            miss = self._misses(theta, poses)
            length = np.linalg.norm(miss, axis=-1)
            sigma = max(float(np.median(length[used])) / 1.1774, 1e-4)
            weight = (used & (length < 6 * sigma)) * (self.weight[:, None] / sigma**2)
            slopes = [(self._misses(theta + h * e, poses) - miss) / h for h, e in zip(_STEP, np.eye(9), strict=True)]
            by_theta = np.stack(slopes, axis=-1)
            by_pose = np.stack([(self._misses(theta, poses + 1e-6 * e) - miss) / 1e-6 for e in np.eye(3)], axis=-1)
            by_pose = np.where(self.held[:, None, None, :], 0.0, by_pose)
            # Plus one of some 1e13: a frame without a weight left, or a pose that is held, must stay solvable.
            A = np.einsum("fn,fnci,fncj->fij", weight, by_pose, by_pose) + np.eye(3)
            B = np.einsum("fn,fnci,fncj->fij", weight, by_pose, by_theta)
            C = np.einsum("fn,fnci,fncj->ij", weight, by_theta, by_theta) + np.diag(self.prior**-2.0)
            g_pose = -np.einsum("fn,fnci,fnc->fi", weight, by_pose, miss)
            g_theta = -np.einsum("fn,fnci,fnc->i", weight, by_theta, miss) - (theta - self.start) / self.prior**2
            solved = np.linalg.solve(A, np.concatenate((B, g_pose[..., None]), axis=-1))
            # Priors from 1e-12 to 1e3: scaled to a unit diagonal the matrix is well conditioned.
            normal = C - np.einsum("fij,fik->jk", B, solved[..., :9])
            scale = 1 / np.sqrt(np.diag(C))
            spread = np.linalg.inv(normal * scale * scale[:, None]) * scale * scale[:, None]
            step = spread @ (g_theta - np.einsum("fij,fi->j", B, solved[..., 9]))
            step[self.prior <= _FIXED] = 0.0
            theta = theta + step
            poses = poses + solved[..., 9] - solved[..., :9] @ step
            if not np.isfinite(theta).all():
                raise TrackingError("track: the frames fit no common plane of motion; check the lens and the rest pose")
            if np.all(np.abs(step) < 0.01 * np.sqrt(np.maximum(np.diag(spread), 1e-30))):
                break
        about_x, about_z, line = map(float, np.sqrt(np.maximum(np.diag(spread)[6:], 0)))
        return Settled(self.camera_at(theta), (about_x, about_z), line, still)

    def _first_poses(self, theta: Floats) -> Floats:
        camera = self.camera_at(theta)
        assert camera.world_from_camera is not None
        points = apply(camera.tip_from_board, self.board.corner_points_m())
        guess = np.array(self.rest) if self.rest else free_start(self.views, camera, self.board)
        plane, poses = Plane(camera.lens, camera.world_from_camera), []
        for rays, slopes, used in zip(self.views.rays, self.views.px_per_ray, self.views.used, strict=True):
            fit = plane.fit_rays(rays[None], slopes[None], points, guess[None], used[None])
            if np.isfinite(fit.rms_px[0]):  # the next frame's start; in order of time it is near
                guess = fit.vector[0]
            poses.append(guess)
        first = np.array(poses)
        if self.rest:
            first[0] = np.where(self.held[0], self.rest, first[0])
        return first


def free_start(views: Views, camera: Camera, board: Board) -> Floats:
    """Return a first guess of (x, z, phi) for the first view, from its free pose."""
    assert camera.world_from_camera is not None
    used = views.used[0]
    pixels = camera.lens.project(np.column_stack((views.rays[0], np.ones(len(used)))))
    free = free_pose(camera.lens, board.corner_points_m()[used], pixels[used])
    if free is None:
        raise TrackingError("track: the first board fits no pose; check that the lens is this camera's")
    plane = Plane(camera.lens, camera.world_from_camera)
    return plane.pose_of(free[0] @ np.linalg.inv(camera.tip_from_board))[0]
