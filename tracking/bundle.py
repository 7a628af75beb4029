"""The least-squares problem over some frames of a video: its constants, every frame's pose eliminated."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from straw.tracking.blocks import Linear, blocks, by_print, carried, eliminated, left_jacobian, sigma_px
from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.derivatives import derivatives
from straw.tracking.errors import TrackingError
from straw.tracking.follow import Rest
from straw.tracking.misprint import Misprint
from straw.tracking.pose import apply
from straw.tracking.start import first_poses
from straw.tracking.views import Views

Floats = NDArray[np.float64]

# how far from square a board is glued by hand; without motion to estimate it from, the turn stays near zero
_GLUED_RAD = 0.02
_MOST_ASKEW_RAD = 0.35  # 20 degrees: no board is glued so far from square; the mount must be another one
_LINE_S = 4e-6  # a row takes at most the frame's 4.17 ms / 1080 at 240 frames/s; and longer in slower modes
_ASIDE_M = 0.01  # how far the board's centre may lie beside the plane of motion
_ROUNDS = 8
_LEARNT = 3  # steps of expectation and maximisation of the print's prior a round
_FIXED, _FREE = 1e-12, 1e3
_ALIKE_S = 0.1  # errors of codec and pixels are correlated over about this time
# The constants: the camera's turn about the world's X, Y, Z at the board (rad), its shift along them (m), the board's
# turn about the tip's x and z (rad), the shutter's time from row to row (s).
_TURN_RAD = 1e-6  # step of finite differences, where a derivative is not written out
LINE = 8  # the row time's place among them
SHARED = 9  # number of constants before the offsets of the print


class Bundle:
    """See ``settle``. ``theta`` (c,): the constants, as corrections to ``camera``, nine and the offsets of the print
    (m, x and y of each corner); ``spread`` (c, c): their covariance.

    Residuals are correlated over the board and from frame to frame (the codec's lag), so that the covariance of least
    squares alone is several times too small; the scatter of the constants between stretches of ``_ALIKE_S`` is added
    (Huber's sandwich estimator, clustered).
    """

    def __init__(
        self, camera: Camera, board: Board, rest: Rest | None, views: Views, level: bool, exposure_s: float
    ) -> None:
        assert camera.world_from_camera is not None
        self.camera, self.points, self.rest, self.views = camera, board.corner_points_m(), rest, views
        self.exposure_s, self.place = exposure_s, camera.world_from_camera
        self.centre = np.array((rest[0], 0.0, rest[1])) if rest else np.zeros(3)
        start_turn, line = np.array(camera.board_turn_rad), camera.line_s
        if rest:
            tilt = _FIXED if level else _FREE
            sigma = (tilt, tilt, _FREE, _FREE, _FREE, _FREE)
        else:
            sigma = (_FIXED, _FIXED, _FIXED, _FIXED, _ASIDE_M, _FIXED)
        self.prior = np.array((*sigma, _GLUED_RAD, _GLUED_RAD, _LINE_S if line is None else _FIXED))
        self.misprint = Misprint(board.shape)
        self.start = np.concatenate((np.zeros(6), start_turn, (line or 0.0,), np.zeros(self.misprint.count)))
        self.theta, self.spread = self.start, self._prior()
        # Rest frame: x and z known; phi too, unless the level camera measures it.
        self.held = np.zeros((len(views.time_s), 3), np.bool_)
        # sensitivity of theta to the corners at rest, per px
        self.by_rest = np.zeros((len(self.points), 2, len(self.start)))
        if rest:
            self.held[0] = (True, True, not level)

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
            line_s=float(theta[LINE]),
        )

    def printed_at(self, theta: Floats) -> Floats:
        """Return where the corners (n, 3) are printed on the board, m."""
        if not self.misprint.count:
            return self.points
        return self.points + np.pad(theta[SHARED:].reshape(-1, 2), ((0, 0), (0, 1)))

    def _prior(self) -> Floats:
        """Return the prior covariance (c, c) of the constants."""
        found = np.diag(np.concatenate((self.prior**2, np.zeros(self.misprint.count))))
        if self.misprint.count:
            found[SHARED:, SHARED:] = self.misprint.covariance()
        return found

    def solve(self) -> None:
        """Gauss-Newton until convergence; TrackingError when the frames contradict each other."""
        poses = first_poses(self.views, self.camera_at(self.theta), self.points, self.rest)
        if self.rest:
            poses[0] = np.where(self.held[0], self.rest, poses[0])
        for _ in range(_ROUNDS):
            here, linear = self.theta, self._linear(poses)
            away, normal = here - self.start, linear.normal
            for _ in range(_LEARNT):  # the print's prior changes, the slopes do not
                prior = self._precision()
                # Priors from 1e-12 to 1e3: scaled to a unit diagonal the matrix is well conditioned.
                scale = 1 / np.sqrt(linear.size + np.diag(prior))
                spread = np.linalg.inv((normal + prior) * scale * scale[:, None]) * scale * scale[:, None]
                step = spread @ (linear.score - prior @ away)
                step[:SHARED][self.prior <= _FIXED] = 0.0
                self.theta = here + step
                self.spread = spread + spread @ linear.disagreement @ spread
                if not np.isfinite(self.theta).all():
                    raise TrackingError(
                        "track: the frames fit no common plane of motion; check the lens and the rest pose"
                    )
                if self.misprint.count:
                    self.misprint = self.misprint.learnt(self.theta[SHARED:], self.spread[SHARED:, SHARED:])
            poses = poses + linear.by_none - linear.by_theta @ step
            if self.rest:
                self.by_rest = linear.at_rest @ spread
            if np.any(np.abs(self.theta[6:8]) > _MOST_ASKEW_RAD):
                askew = np.degrees(np.abs(self.theta[6:8]).max())
                what = f"track: with mount '{self.camera.mount}' the board would be glued {askew:.0f} deg from square"
                at_rest = f", the tip at rest at phi = {np.degrees(self.rest[2]):.0f} deg" if self.rest else ""
                raise TrackingError(f"{what}{at_rest}; correct the mount (--mount), the rest pose, or the run")
            # Only the nine are nonlinear; a tenth of sigma adds a hundredth to a mean square.
            sigma_now = np.sqrt(np.maximum(np.diag(spread)[:SHARED], 1e-30))
            if np.all(np.abs(step[:SHARED]) < 0.1 * sigma_now):
                return

    def _precision(self) -> Floats:
        """Return the inverse of ``_prior``."""
        found = np.diag(np.concatenate((self.prior**-2.0, np.zeros(self.misprint.count))))
        if self.misprint.count:
            found[SHARED:, SHARED:] = self.misprint.precision()
        return found

    def _linear(self, poses: Floats) -> Linear:
        """Return the problem with slopes and weights as they are at these poses (f, 3) and the constants so far."""
        used, every = self.views.used, len(self.theta)
        # The row time times the uncertainty of the motion's rate limits how well the rolling shutter is known.
        doubt_px = _LINE_S * np.sqrt((self.views.rows**2).mean(axis=1)) * self.views.doubt
        miss = self._misses(self.views, self.theta, poses, self.printed_at(self.theta))
        length = np.linalg.norm(miss, axis=-1)
        sigma = np.full((len(poses), 1), sigma_px(length[used]))
        limit = sigma.copy()
        if self.rest:  # the mean of many frames; without it nothing would fix the camera's shift
            limit[0] = sigma_px(length[0, used[0]])
            sigma[0] = min(sigma[0, 0], limit[0, 0])
        by_theta, by_pose, by_place = self._slopes(self.views, self.theta, poses, self.printed_at(self.theta))
        # While the row time is unknown, moving frames have large residuals, which are no outliers.
        unsettled_px = self.spread[LINE, LINE] ** 0.5 * np.linalg.norm(
            by_theta[..., LINE].reshape((*length.shape, 2)), axis=-1
        )
        weight = (used & (length < 6 * np.hypot(limit, unsettled_px))) / (sigma**2 + doubt_px[:, None] ** 2)
        by_pose = np.where(self.held[:, None, :], 0.0, by_pose)
        weights = np.repeat(weight, 2, axis=1)[..., None]
        A, B = eliminated(weights * by_pose, by_theta, by_pose)
        left, weighted = miss.reshape(len(poses), -1, 1), weights * by_theta
        g_pose = -((weights * by_pose).transpose(0, 2, 1) @ left)[..., 0]
        g_theta = -(weighted.transpose(0, 2, 1) @ left)[..., 0]
        C = np.zeros((every, every))
        C[:SHARED, :SHARED] = weighted.reshape(-1, SHARED).T @ by_theta.reshape(-1, SHARED)
        if every > SHARED:
            place = weight[..., None, None] * by_place
            B = np.concatenate((B, by_print(by_pose, place)), axis=-1)
            g_theta = np.concatenate((g_theta, -np.einsum("fncj,fnc->fnj", place, miss).reshape(len(poses), -1)), 1)
            C[:SHARED, SHARED:] = by_print(by_theta, place).sum(axis=0)
            C[SHARED:, :SHARED] = C[:SHARED, SHARED:].T
            C[SHARED:, SHARED:] = blocks(np.einsum("fnci,fncj->nij", place, by_place))
        inverse = np.linalg.inv(A)
        by_none, solved = (inverse @ g_pose[..., None])[..., 0], inverse @ B
        score = g_theta - np.einsum("fij,fi->fj", B, by_none)
        return Linear(
            normal=C - B.reshape(-1, every).T @ solved.reshape(-1, every),
            size=np.diag(C),
            score=score.sum(axis=0),
            disagreement=self._disagreement(score),
            by_none=by_none,
            by_theta=solved,
            at_rest=self._at_rest(weight[0], by_theta[0], by_place[0]),
        )

    def _disagreement(self, score: Floats) -> Floats:
        """Return the covariance (c, c) of the sum of the frames' scores (f, c), by stretches of time."""
        stretch = np.unique((self.views.time_s / _ALIKE_S).astype(int), return_inverse=True)[1]
        sums = np.zeros((stretch.max() + 1, score.shape[1]))
        np.add.at(sums, stretch, score)
        free, count = int(np.count_nonzero(self.prior > _FIXED)), len(sums)
        return np.asarray(sums.T @ sums * (count / max(count - free, 1)))

    def _at_rest(self, weight: Floats, by_theta: Floats, by_place: Floats) -> Floats:
        """Return the weight of the corners at rest, across the board's edges, in the constants' score: (n, 2, c)."""
        n = len(self.points)
        wide = np.einsum("n,nci->inc", weight, by_theta.reshape(n, 2, -1))
        if self.misprint.count:
            own = np.zeros((n, 2, n, 2))
            own[np.arange(n), :, np.arange(n), :] = (weight[:, None, None] * by_place).transpose(0, 2, 1)
            wide = np.concatenate((wide, own.reshape(2 * n, n, 2)))
        return np.asarray(np.einsum("wc,inc->nwi", self.views.across[0], wide))

    def response(self, views: Views, poses: Floats) -> Floats:
        """Return by how much poses (f, 3) change with each constant, (f, 3, c), at the constants found."""
        points = self.printed_at(self.theta)
        by_theta, by_pose, by_place = self._slopes(views, self.theta, poses, points)
        weighted = np.repeat(views.used, 2, axis=1)[..., None] * by_pose
        A, B = eliminated(weighted, by_theta, by_pose)
        if self.misprint.count:
            B = np.concatenate((B, by_print(weighted, by_place)), axis=-1)
        return np.asarray(-np.linalg.inv(A) @ B)  # faster than to solve for a hundred columns

    def _slopes(self, views: Views, theta: Floats, poses: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Return d residual by the nine constants (f, 2n, 9), by the poses (f, 2n, 3), by the print (f, n, 2, 2)."""
        camera, frames, n = self.camera_at(theta), len(poses), len(points)
        assert camera.world_from_camera is not None
        tip_from_board = camera.tip_from_board
        carried_m = apply(tip_from_board, points)
        glued = []
        for k in (6, 7):
            other = self.camera_at(theta + _TURN_RAD * (np.arange(len(theta)) == k)).tip_from_board
            glued.append((apply(other, points) - carried_m) / _TURN_RAD)
        found = np.empty((frames, 2 * n, SHARED)), np.empty((frames, 2 * n, 3)), np.empty((frames, n, 2, 2))
        derivatives(
            np.ascontiguousarray(carried_m),
            np.ascontiguousarray(poses),
            np.ascontiguousarray(tip_from_board[:3, :2]),
            np.ascontiguousarray(np.linalg.inv(camera.world_from_camera)[:3]),
            np.ascontiguousarray(views.px_per_ray),
            np.ascontiguousarray(views.by_line(float(theta[LINE]), self.exposure_s)),
            self.centre + theta[3:6],
            np.ascontiguousarray(left_jacobian(theta[:3])),
            np.array(glued),
            *found,
        )
        return found

    def _misses(self, views: Views, theta: Floats, poses: Floats, points: Floats, rays: Floats | None = None) -> Floats:
        """Return the residuals (f, n, 2), px, of points (n, 3) of the board; ``rays`` as ``at_once`` has them."""
        camera = self.camera_at(theta)
        assert camera.world_from_camera is not None
        to_camera = np.linalg.inv(camera.world_from_camera)
        points = apply(camera.tip_from_board, points)
        seen = carried(points, poses)[0] @ to_camera[:3, :3].T + to_camera[:3, 3]
        rays = views.at_once(float(theta[LINE]), self.exposure_s) if rays is None else rays
        miss = rays - seen[..., :2] / seen[..., 2:]
        return np.asarray(views.px_per_ray[..., 0] * miss[..., :1] + views.px_per_ray[..., 1] * miss[..., 1:])
