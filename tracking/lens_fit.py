"""Fits a lens to views of a checkerboard by least squares: intrinsics for all, a pose for each view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from straw.tracking.errors import TrackingError
from straw.tracking.lens import Lens
from straw.tracking.planar import MEDIAN_OF_RAYLEIGH
from straw.tracking.pose import apply, free_pose

Floats = NDArray[np.float64]

_STEPS = 60
_SETTLED = 1e-6  # of the mean square: a thousandth of the residual's own uncertainty from 1000 corners
_OUTLIER_SIGMA = 5.0
_FOCAL_STARTS = (0.45, 0.65, 0.9, 1.3)  # of the picture's width: very wide to normal
_COUNT = {"fisheye": 8, "brown_conrady": 9}
_BEND_PRIOR = 1.0  # prior sigma of each distortion coefficient: those that the views do not determine stay near zero


@dataclass(frozen=True)
class View:
    """One sighting of a board: ``points`` (n, 3) in squares, ``pixels`` (n, 2), and where it is from."""

    points: Floats
    pixels: Floats
    source: str


@dataclass(frozen=True)
class Fit:
    """A lens with the covariance of its numbers (fx, fy, cx, cy, distortion...), and each view's rms residual in px.

    ``inliers`` (views,): how many corners of each view it rests on; where none, its rms is NaN.
    """

    lens: Lens
    covariance: Floats
    poses: list[Floats]
    rms_px: float
    view_rms_px: Floats
    inliers: NDArray[np.int64]


def lens_of(kind: str, size: tuple[int, int], numbers: Floats, rms_px: float | None = None) -> Lens:
    """Return the lens of a vector (fx, fy, cx, cy, distortion...)."""
    fx, fy, cx, cy, *bend = map(float, numbers)
    return Lens(kind, *size, fx, fy, cx, cy, tuple(bend), source="straw calibrate", rms_px=rms_px)


def fit_lens(kind: str, size: tuple[int, int], views: Sequence[View], start: Lens | None = None) -> Fit:
    """Fit a lens of a kind to views, from another lens or from any angle of view; TrackingError when none fits."""
    numbers = np.zeros(_COUNT[kind])
    best: tuple[float, Floats, list[Floats]] | None = None
    for focal in (None,) if start else _FOCAL_STARTS:
        if focal is None and start is not None:
            numbers = np.array((start.fx, start.fy, start.cx, start.cy, *start.distortion))
        elif focal:
            numbers[:4] = focal * size[0], focal * size[0], (size[0] - 1) / 2, (size[1] - 1) / 2
        poses = _poses(lens_of(kind, size, numbers), views)
        if poses is None:
            continue
        try:
            found, poses, _, _ = _descend(kind, size, views, numbers, poses, steps=12)
            square = _square(kind, size, views, found, poses)
        except (TrackingError, np.linalg.LinAlgError):
            continue
        if np.isfinite(square) and (best is None or square < best[0]):
            best = square, found, poses
    if best is None:
        raise TrackingError(f"calibrate: no {kind} lens fits the {len(views)} views; are they of one camera and mode?")
    numbers, poses, covariance, weights = _descend(kind, size, views, *best[1:], steps=_STEPS)
    lens = lens_of(kind, size, numbers)
    misses = _split(_misses(lens, views, poses), views)
    squares = np.array([(w @ np.nan_to_num(m) ** 2).sum() for m, w in zip(misses, weights, strict=True)])
    used = np.array([w.sum() for w in weights])
    view_rms = np.sqrt(np.divide(squares, 2 * used, out=np.full(len(used), np.nan), where=used > 0))
    rms = float(np.sqrt(squares.sum() / (2 * used.sum())))
    return Fit(lens_of(kind, size, numbers, rms), covariance, poses, rms, view_rms, used.astype(np.int64))


def held_out_px(fit: Fit, views: Sequence[View]) -> Floats:
    """Return the rms residual (px) of views that the lens was not fitted to, each with its best pose; NaN without."""
    found = []
    for view in views:
        pose = free_pose(fit.lens, view.points, view.pixels)
        found.append(pose[1] if pose else np.nan)
    return np.array(found)


def _poses(lens: Lens, views: Sequence[View]) -> list[Floats] | None:
    found = [free_pose(lens, view.points, view.pixels) for view in views]
    return [pose[0] for pose in found if pose] if all(found) else None


def _misses(lens: Lens, views: Sequence[View], poses: list[Floats]) -> Floats:
    """Return the residuals (n, 2), px, of all corners, view by view."""
    seen = np.concatenate([apply(pose, view.points) for view, pose in zip(views, poses, strict=True)])
    return np.concatenate([view.pixels for view in views]) - lens.project(seen)


def _square(kind: str, size: tuple[int, int], views: Sequence[View], numbers: Floats, poses: list[Floats]) -> float:
    miss = _misses(lens_of(kind, size, numbers), views, poses)
    return float(np.mean(np.minimum((miss**2).sum(axis=1), 100.0)))


def _split(values: Floats, views: Sequence[View]) -> list[Floats]:
    """Return the parts of each view."""
    return np.split(values, np.cumsum([len(view.points) for view in views])[:-1])


def _descend(
    kind: str, size: tuple[int, int], views: Sequence[View], numbers: Floats, poses: list[Floats], steps: int
) -> tuple[Floats, list[Floats], Floats, list[Floats]]:
    """Levenberg-Marquardt; return numbers, poses, the numbers' covariance and each corner's weight."""
    damping, best = 1e-3, _square(kind, size, views, numbers, poses)
    for _ in range(steps):
        normal, right, blocks, _ = _normal(kind, size, views, numbers, poses, damping)
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), right)
        trial = [_moved(pose, np.linalg.solve(A, g - B @ step)) for pose, (A, B, g) in zip(poses, blocks, strict=True)]
        try:
            square = _square(kind, size, views, numbers + step, trial)
        except TrackingError:  # a step to an impossible lens
            square = np.inf
        if square < best:
            done = best - square < _SETTLED * best and damping < 1e-4
            numbers, poses, best, damping = numbers + step, trial, square, damping / 10
            if done:
                break
        else:
            damping *= 10
            if damping > 1e6:
                break
    normal, _, _, weights = _normal(kind, size, views, numbers, poses, 0.0)
    used = sum(float(weight.sum()) for weight in weights)
    variance = best / 2 * used / max(used - len(numbers) / 2 - 3 * len(views), 1.0)
    return numbers, poses, np.asarray(variance * np.linalg.inv(normal), dtype=np.float64), weights


def _normal(
    kind: str, size: tuple[int, int], views: Sequence[View], numbers: Floats, poses: list[Floats], damping: float
) -> tuple[Floats, Floats, list[tuple[Floats, Floats, Floats]], list[Floats]]:
    """Return the numbers' normal matrix and right side, poses eliminated; each pose's block; each corner's weight."""
    lens, n = lens_of(kind, size, numbers), len(numbers)
    scale = np.array((*(1e-4 * size[0],) * 4, *(1e-5,) * (n - 4)))
    nudged = [lens_of(kind, size, numbers + h * e) for h, e in zip(scale, np.eye(n), strict=True)]
    arm = np.concatenate([view.points @ pose[:3, :3].T for view, pose in zip(views, poses, strict=True)])
    middle = np.repeat([pose[:3, 3] for pose in poses], [len(view.points) for view in views], axis=0)
    guess, slope = lens.project_with_jacobian(arm + middle)
    miss = np.concatenate([view.pixels for view in views]) - guess
    length = np.linalg.norm(miss, axis=1)
    sigma = max(float(np.nanmedian(length)) / MEDIAN_OF_RAYLEIGH, 1e-3)
    weight = np.asarray(length < _OUTLIER_SIGMA * sigma, dtype=np.float64)
    prior = np.concatenate((np.zeros(4), np.full(n - 4, sigma**2 / _BEND_PRIOR**2)))
    by_turn = np.cross(np.eye(3)[None], arm[:, None]).transpose(0, 2, 1)
    J = np.nan_to_num(np.concatenate((slope @ by_turn, slope), axis=2)) * weight[:, None, None]
    K = [(other.project(arm + middle) - guess) / h for other, h in zip(nudged, scale, strict=True)]
    own = np.nan_to_num(np.stack(K, axis=-1)) * weight[:, None, None]
    r = np.nan_to_num(miss)
    normal, right = np.einsum("nci,ncj->ij", own, own), np.einsum("nci,nc->i", own, r) - prior * numbers
    normal += np.diag(prior)
    starts = np.concatenate(([0], np.cumsum([len(view.points) for view in views])[:-1]))
    every = np.concatenate((J, own, r[..., None]), axis=-1)
    sums = np.add.reduceat(J.transpose(0, 2, 1) @ every, starts)
    blocks = []
    for whole in sums:
        A, B, g = whole[:, :6], whole[:, 6 : 6 + n], whole[:, 6 + n]
        A = A + damping * np.diag(np.diag(A)) + 1e-9 * np.eye(6)
        solved = np.linalg.solve(A, np.column_stack((B, g)))
        normal -= B.T @ solved[:, :n]
        right -= B.T @ solved[:, n]
        blocks.append((A, B, g))
    weights = _split(weight, views)
    return normal, right, blocks, weights


def _moved(pose: Floats, step: Any) -> Floats:
    moved = pose.copy()
    moved[:3, :3] = cv2.Rodrigues(step[:3])[0] @ pose[:3, :3]
    moved[:3, 3] += step[3:]
    return moved
