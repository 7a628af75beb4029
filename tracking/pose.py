"""Pose from corners: three unknowns a frame for the planar motion, six for the one rest pose that places the camera."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.lens import Lens

Floats = NDArray[np.float64]

_STEPS = 12
_ROUNDS = 6  # of dropping outliers: a finger over some corners takes two or three
_OUTLIER_SIGMA = 4.0  # a good corner of 49 is dropped once in 60 frames: residual lengths are Rayleigh, exp(-4^2 / 2)
_MEDIAN_OF_RAYLEIGH = 1.1774


@dataclass(frozen=True)
class TipPose:
    """Tip at (x_m, z_m) with its axis (sin phi, cos phi); ``covariance`` (3, 3) in that order, SI.

    ``used`` (n,) marks the corners the fit rests on; ``rms_px`` is their residual (per coordinate, in px).
    """

    x_m: float
    z_m: float
    phi_rad: float
    covariance: Floats
    rms_px: float
    used: NDArray[np.bool_]

    @property
    def vector(self) -> Floats:
        """Return (x_m, z_m, phi_rad) as an array."""
        return np.array((self.x_m, self.z_m, self.phi_rad))


def world_from_tip(x_m: float, z_m: float, phi_rad: float) -> Floats:
    """Return the tip frame's 4x4: origin at the tip, z along the tip axis, y along the world's Y."""
    sin, cos = np.sin(phi_rad), np.cos(phi_rad)
    return np.array(((cos, 0, sin, x_m), (0, 1, 0, 0), (-sin, 0, cos, z_m), (0, 0, 0, 1.0)))


def apply(transform: Floats, points_m: Floats) -> Floats:
    """Apply a 4x4 rigid transform to points (n, 3)."""
    return np.asarray(points_m @ transform[:3, :3].T + transform[:3, 3], dtype=np.float64)


@dataclass(frozen=True)
class Plane:
    """The motion plane as one camera sees it: from (x, z, phi) to pixels, and back by least squares.

    The tip is taken to move in the X-Z plane exactly, carrying the board as ``Camera.tip_from_board`` says. A constant
    y offset of the board goes into ``world_from_camera`` when that is found from a rest pose.
    """

    lens: Lens
    world_from_camera: Floats
    camera_from_world: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "camera_from_world", np.linalg.inv(self.world_from_camera))

    def project(self, pose: Floats, points_m: Floats) -> Floats:
        """Return the pixels (n, 2) of tip-frame points (n, 3) with the tip at ``pose`` (x, z, phi)."""
        return self.lens.project(self._seen(pose, points_m)[0])

    def fit(
        self, pixels: Floats, points_m: Floats, start: Floats, among: NDArray[np.bool_] | None = None
    ) -> TipPose | None:
        """Fit (x, z, phi) to pixels (n, 2) of tip-frame points (n, 3), dropping outliers; None when it diverges.

        Gauss-Newton on the reprojection residuals; covariance = s^2 (J^T J)^-1 with s^2 the residuals' own variance.
        It is honest about noise that differs from corner to corner, and blind to errors all corners share.
        """
        kept = np.ones(len(pixels), np.bool_) if among is None else among
        pose = start
        for _ in range(_ROUNDS):
            solved = self.solve(pixels, points_m, pose, kept) if kept.sum() >= 4 else None
            if solved is None:
                return None
            pose, residual, normal = solved
            length = np.hypot(residual[:, 0], residual[:, 1])
            sigma = np.median(length[kept]) / _MEDIAN_OF_RAYLEIGH
            fewer = kept & (length <= _OUTLIER_SIGMA * sigma)
            if fewer.sum() == kept.sum():
                break
            kept = fewer
        else:
            return None  # the residuals have no end of outliers: no board looks like this
        square = float((residual[kept] ** 2).sum())
        count = 2 * int(kept.sum())
        covariance = np.asarray(square / (count - 3) * np.linalg.inv(normal), dtype=np.float64)
        x_m, z_m, phi_rad = map(float, pose)
        return TipPose(x_m, z_m, phi_rad, covariance, float(np.sqrt(square / count)), kept)

    def pose_of(self, camera_from_tip: Floats) -> tuple[Floats, float]:
        """Return the (x, z, phi) nearest to a free tip pose, and the cosine between the tip's y and the world's Y."""
        tip = self.world_from_camera @ camera_from_tip
        return np.array((tip[0, 3], tip[2, 3], np.arctan2(tip[0, 2], tip[2, 2]))), float(tip[1, 1])

    def _seen(self, pose: Floats, points_m: Floats) -> tuple[Floats, Floats]:
        """Return camera-frame points (n, 3) and their derivatives (n, 3, 3) by x, z, phi (last axis)."""
        to_camera = self.camera_from_world
        world = world_from_tip(*pose)
        turned = points_m @ world[:3, :3].T
        # d/dphi of a rotation about Y: (x, z) -> (z, -x)
        by_phi = np.column_stack((turned[:, 2], np.zeros(len(turned)), -turned[:, 0])) @ to_camera[:3, :3].T
        slopes = np.empty((len(points_m), 3, 3))
        slopes[:, :, 0], slopes[:, :, 1], slopes[:, :, 2] = to_camera[:3, 0], to_camera[:3, 2], by_phi
        return apply(to_camera, turned + world[:3, 3]), slopes

    def solve(
        self, pixels: Floats, points_m: Floats, start: Floats, used: NDArray[np.bool_]
    ) -> tuple[Floats, Floats, Floats] | None:
        """Return the pose, the residuals of all corners (n, 2) and the normal matrix of the used ones."""
        pose = np.array(start, dtype=np.float64)
        for _ in range(_STEPS):
            seen, slopes = self._seen(pose, points_m)
            guess, jacobian = self.lens.project_with_jacobian(seen)
            residual = pixels - guess
            J = (jacobian @ slopes)[used].reshape(-1, 3)
            normal = J.T @ J
            if not np.all(np.isfinite(normal)):
                return None
            try:
                step = np.linalg.solve(normal, J.T @ residual[used].ravel())
            except np.linalg.LinAlgError:
                return None
            if np.abs(step).max() < 1e-8:  # 10 nm, 10 nrad: far below any noise
                return pose, residual, normal
            pose += step
        return None


def free_pose(lens: Lens, points_m: Floats, pixels: Floats) -> tuple[Floats, float] | None:
    """Return ``camera_from_board`` (4x4), six unknowns, and its residual (px, rms per coordinate); None if none fits.

    Every start OpenCV offers (both IPPE candidates, SQPnP) is refined on the true pixels and the best one wins: IPPE
    alone has been seen to return NaN or the mirrored pose while reporting success.
    """
    rays = lens.rays(pixels)
    if not np.all(np.isfinite(rays)):
        return None
    best: tuple[Floats, float] | None = None
    for method in (cv2.SOLVEPNP_IPPE, cv2.SOLVEPNP_SQPNP):
        try:
            _, turns, shifts, _ = cv2.solvePnPGeneric(points_m, rays, np.eye(3), np.zeros(4), flags=method)
        except cv2.error:
            continue
        for turn, shift in zip(turns, shifts, strict=True):
            if not (np.all(np.isfinite(turn)) and np.all(np.isfinite(shift))):
                continue
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(turn)[0], shift.ravel()
            found = _refine(lens, points_m, pixels, pose)
            if found is not None and (best is None or found[1] < best[1]):
                best = found
    return best


def _refine(lens: Lens, points_m: Floats, pixels: Floats, pose: Floats) -> tuple[Floats, float] | None:
    """Levenberg-Marquardt on the six unknowns, as a small turn about the board's centre and a shift."""
    damping, best = 1e-6, np.inf
    trial = pose
    J, residual = np.empty((0, 6)), np.empty(0)
    for _ in range(50):
        seen = apply(trial, points_m)
        guess, jacobian = lens.project_with_jacobian(seen)
        error = (pixels - guess).ravel()
        square = float(error @ error) if np.all(np.isfinite(error)) else np.inf
        if square < best:
            done = best - square < 1e-12 * best
            pose, best, residual, damping = trial, square, error, damping / 10
            arm = seen - pose[:3, 3]
            by_turn = np.cross(np.eye(3)[None, :, :], arm[:, None, :])  # (n, turn axis, xyz)
            J = np.concatenate((jacobian @ by_turn.transpose(0, 2, 1), jacobian), axis=2).reshape(-1, 6)
            if done:
                break
        else:
            damping *= 10
        if not np.isfinite(best) or damping > 1e6:
            break
        normal = J.T @ J
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), J.T @ residual)
        trial = pose.copy()
        trial[:3, :3] = cv2.Rodrigues(step[:3])[0] @ pose[:3, :3]
        trial[:3, 3] += step[3:]
    return (pose, float(np.sqrt(best / pixels.size))) if np.isfinite(best) else None
