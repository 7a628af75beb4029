"""Estimates what a video has in common, from its motion: the camera's place, the board's mounting, the row time."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.tracking.board import Board
from straw.tracking.bundle import LINE, Bundle
from straw.tracking.camera import Camera
from straw.tracking.errors import TrackingError
from straw.tracking.follow import Rest, plane_at_rest
from straw.tracking.pose import Plane, free_pose
from straw.tracking.variance import Scatter, Seen
from straw.tracking.views import Views

Floats = NDArray[np.float64]

REST_FRAMES = 60  # at most; a quarter of a second brings the noise of the mean corner below what H.264 leaves in it
FEWEST_REST_FRAMES = 5
STILL_PX = 0.2  # shift of the board's centre that ends the rest: ten times the centre's noise


@dataclass(frozen=True)
class Settled:
    """What a video has in common: the camera with its place, turn and row time, and how well they are known."""

    camera: Camera
    bundle: Bundle
    rest_frames: int
    askew: Floats  # change of the constants by the edges' lean at rest

    @property
    def turn_sigma_rad(self) -> tuple[float, float]:
        """Standard deviations of ``camera.board_turn_rad``."""
        about_x, about_z = np.sqrt(np.diag(self.bundle.spread)[6:8])
        return float(about_x), float(about_z)

    @property
    def line_sigma_s(self) -> float:
        """Standard deviation of ``camera.line_s``."""
        return float(np.sqrt(self.bundle.spread[LINE, LINE]))

    @property
    def points_m(self) -> Floats:
        """The corners (n, 3) on the board as printed."""
        return self.bundle.printed_at(self.bundle.theta)

    @property
    def plane(self) -> Plane:
        """The plane of motion as this camera sees it."""
        assert self.camera.world_from_camera is not None
        return Plane(self.camera.lens, self.camera.world_from_camera)

    def doubt_rest(self, scatter: Scatter, rest: Seen, off: Floats) -> None:
        """Widen the constants' covariance: frames cannot show by their disagreement what the rest alone fixes.

        ``rest``: the fit of its mean picture; ``off`` (n, 2): one standard deviation of its askew edges' error, px.
        """
        answer = self.bundle.by_rest
        self.askew[:] = np.einsum("nwc,nw->c", answer, off @ self.bundle.views.across[0].T)
        self.bundle.spread = self.bundle.spread + scatter.at_rest(answer.reshape(*scatter.shape, 2, -1), rest)

    def covariance(self, views: Views, poses: Floats, rate: Floats, askew: Floats) -> Floats:
        """Return the covariance (f, 3, 3), SI, that the constants' uncertainty adds to poses (f, 3) moving at ``rate``
        (f, 3).

        ``askew`` (f, 3): change of the poses by one standard deviation of the error of edges that run askew, which is
        one in all frames and at rest.
        A wrong row time also dates a pose wrongly, by as many rows as the board's middle is down the picture.
        """
        by_theta = self.bundle.response(views, poses)
        by_theta[..., LINE] -= rate * views.middle[:, None]
        flat = by_theta.reshape(-1, by_theta.shape[-1]) @ self.bundle.spread
        lean = askew - by_theta @ self.askew  # residuals are corners less points: what moves one moves the other back
        return np.asarray(flat.reshape(by_theta.shape) @ by_theta.transpose(0, 2, 1) + lean[:, :, None] * lean[:, None])


def settle(
    camera: Camera, board: Board, rest_pose: Rest | None, views: Views, *, level: bool = False, exposure_s: float = 0.0
) -> Settled:
    """Find the constants of a video from some of its frames, which must be in order and begin with the first ones.

    With ``rest_pose`` (x_m, z_m, phi_rad) the mean of the still frames at the start is the board at that pose, which
    fixes three of the camera's six unknowns; that all frames share one plane of motion fixes the others, and how askew
    the board is glued. Assuming it square when it is not tilts the world: at 25 degrees of obliquity every degree
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
    bundle = Bundle(camera, board, rest_pose, views, level, exposure_s)
    bundle.solve()
    return Settled(bundle.camera_at(bundle.theta), bundle, still, np.zeros(len(bundle.theta)))


def _still(views: Views) -> int:
    """Count the frames at the start in which the board's centre stays where it was."""
    centres = views.rays[:REST_FRAMES].mean(axis=1) * np.sqrt(np.abs(np.linalg.det(views.px_per_ray[0, 0])))
    moved = np.hypot(*(centres - centres[0]).T) > STILL_PX
    return int(np.argmax(moved)) if moved.any() else len(moved)


def _with_mean_rest(views: Views, still: int) -> Views:
    """Put one frame, the median, in place of the still ones: a disturbance of one of them must not move it."""
    ours = {name: getattr(views, name).copy() for name in ("rays", "used", "rate", "bend", "jerk")}
    ours["rays"][0] = np.median(views.rays[:still], axis=0)
    ours["used"][0] = views.used[:still].mean(axis=0) > 0.5
    ours["rate"][0] = ours["bend"][0] = ours["jerk"][0] = 0.0
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
