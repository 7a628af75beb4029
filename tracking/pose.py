"""Pose from corners: three unknowns a frame for the planar motion, six for the one rest pose that places the camera."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from straw.tracking.lens import Lens
from straw.tracking.planar import fit_planar

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


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
    used: Flags

    @property
    def vector(self) -> Floats:
        """Return (x_m, z_m, phi_rad) as an array."""
        return np.array((self.x_m, self.z_m, self.phi_rad))


@dataclass(frozen=True)
class Poses:
    """Tip poses of many frames: ``vector`` (f, 3) = x_m, z_m, phi_rad, ``covariance`` (f, 3, 3), SI.

    ``rms_px`` (f,) is NaN where the corners fit no pose; ``residual_px`` (f, n, 2); ``used`` (f, n).
    """

    vector: Floats
    covariance: Floats
    rms_px: Floats
    residual_px: Floats
    used: Flags


def world_from_tip(x_m: float, z_m: float, phi_rad: float) -> Floats:
    """Return the tip frame's 4x4: origin at the tip, z along the tip axis, y along the world's Y."""
    sin, cos = np.sin(phi_rad), np.cos(phi_rad)
    return np.array(((cos, 0, sin, x_m), (0, 1, 0, 0), (-sin, 0, cos, z_m), (0, 0, 0, 1.0)))


def apply(transform: Floats, points_m: Floats) -> Floats:
    """Apply a 4x4 rigid transform to points (n, 3)."""
    return np.asarray(points_m @ transform[:3, :3].T + transform[:3, 3], dtype=np.float64)


@dataclass(frozen=True)
class Plane:
    """The motion plane as one camera sees it: from rays or pixels to (x, z, phi) by least squares (see ``planar``).

    The tip is taken to move in the X-Z plane exactly, carrying the board as ``Camera.tip_from_board`` says. A constant
    y offset of the board goes into ``world_from_camera`` when that is found from a rest pose.
    """

    lens: Lens
    world_from_camera: Floats
    camera_from_world: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "camera_from_world", np.linalg.inv(self.world_from_camera))

    def fit(self, pixels: Floats, points_m: Floats, start: Floats, among: Flags | None = None) -> TipPose | None:
        """Fit (x, z, phi) to pixels (n, 2) of tip-frame points (n, 3), dropping outliers; None when it diverges."""
        used = np.ones((1, len(pixels)), np.bool_) if among is None else among[None].copy()
        rays, slopes = self.lens.rays_with_slopes(pixels)
        used &= np.isfinite(rays).all(axis=1)
        fits = self.fit_rays(np.nan_to_num(rays)[None], slopes[None], points_m, start[None], used)
        if not np.isfinite(fits.rms_px[0]):
            return None
        x_m, z_m, phi_rad = map(float, fits.vector[0])
        return TipPose(x_m, z_m, phi_rad, fits.covariance[0], float(fits.rms_px[0]), fits.used[0])

    def fit_rays(self, rays: Floats, px_per_ray: Floats, points_m: Floats, start: Floats, used: Flags) -> Poses:
        """Fit the poses of many frames; shapes as in ``planar.fit_planar``, which works on copies here."""
        frames, n = rays.shape[:2]
        found = Poses(
            vector=np.array(start, dtype=np.float64),
            covariance=np.full((frames, 3, 3), np.nan),
            rms_px=np.empty(frames),
            residual_px=np.empty((frames, n, 2)),
            used=used.copy(),
        )
        fit_planar(
            np.ascontiguousarray(rays),
            np.ascontiguousarray(px_per_ray),
            np.ascontiguousarray(points_m),
            self.camera_from_world,
            found.used,
            found.vector,
            found.covariance,
            found.rms_px,
            found.residual_px,
        )
        return found

    def slopes(self, px_per_ray: Floats, points_m: Floats, poses: Floats) -> Floats:
        """Return how the corners move with the poses (f, 3): (f, n, 2, 3), px per m and rad."""
        sin, cos, cam = np.sin(poses[:, 2:]), np.cos(poses[:, 2:]), self.camera_from_world
        x, z = cos * points_m[:, 0] + sin * points_m[:, 2], cos * points_m[:, 2] - sin * points_m[:, 0]
        world = np.stack((x + poses[:, :1], np.broadcast_to(points_m[:, 1], x.shape), z + poses[:, 1:2]), axis=-1)
        seen = world @ cam[:3, :3].T + cam[:3, 3]
        turned = np.stack((z, -x), axis=-1) @ cam[:3, (0, 2)].T
        by = np.stack((*np.broadcast_arrays(cam[:3, 0], cam[:3, 2], turned),), axis=-1)
        ray = seen[..., :2, None] / seen[..., 2:, None]
        return np.asarray(px_per_ray @ ((by[..., :2, :] - ray * by[..., 2:, :]) / seen[..., 2:, None]))

    def pose_of(self, camera_from_tip: Floats) -> tuple[Floats, float]:
        """Return the (x, z, phi) nearest to a free tip pose, and the cosine between the tip's y and the world's Y."""
        tip = self.world_from_camera @ camera_from_tip
        return np.array((tip[0, 3], tip[2, 3], np.arctan2(tip[0, 2], tip[2, 2]))), float(tip[1, 1])


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
