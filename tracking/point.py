"""Follows a printed dot or the end of an edge through pictures: its first appearance found again, with its sigma."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from straw.tracking.errors import TrackingError

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

_HALF = 10  # px: half the side of the template around the point
_REACH = 24  # px: search radius around the expected place
_LEAST_LIKE = 0.7  # least correlation with the template; noise alone gives 0.1
_STEPS, _STILL_PX = 30, 1e-3
_LEAST_SIGMA_PX = 0.02  # error that 8 bits and a codec leave on an edge of this length
_STRAIGHT = 0.05  # of the larger curvature: an edge is not located along itself


@dataclass(frozen=True)
class Point:
    """Where the point is in one picture, px, with the covariance (2, 2) of that, px^2."""

    at_px: Floats
    covariance: Floats


def follow_point(pictures: Iterable[Picture], at_px: tuple[float, float]) -> Iterator[Point | None]:
    """Yield where a point is, from the first picture on, in which it is at ``at_px``; None where it is not seen.

    Always compared with the first picture, so that nothing drifts: normalised correlation finds it (cv2.matchTemplate),
    Gauss-Newton on shift, turn and brightness sharpens (Lucas and Kanade, IJCAI 1981). The covariance is that of
    least squares with the variance of the residuals, doubled as errors of neighbouring pixels are correlated.
    TrackingError where the picture does not hold the point in both directions.
    """
    model: _Model | None = None
    recent: list[Floats] = []
    for picture in pictures:
        if model is None:
            model, recent = _Model(picture, np.array(at_px, dtype=np.float64)), [np.array(at_px, dtype=np.float64)]
        ahead = recent[-1] + (recent[-1] - recent[-2] if len(recent) > 1 else 0.0)
        found = model.find(picture, ahead) or model.find(picture, recent[-1])
        recent = [*recent[-1:], found.at_px] if found else recent[-1:]
        yield found


class _Model:
    """What the point's surroundings look like."""

    def __init__(self, picture: Picture, at_px: Floats) -> None:
        height, width = picture.shape
        if not (_HALF < at_px[0] < width - _HALF - 1 and _HALF < at_px[1] < height - _HALF - 1):
            raise TrackingError(f"point at {at_px[0]:g}, {at_px[1]:g}: too near the picture's edge; choose another")
        self.picture = _patch(picture, at_px, 0.0)
        du, dv = np.gradient(self.picture, axis=1)[1:-1, 1:-1], np.gradient(self.picture, axis=0)[1:-1, 1:-1]
        v, u = np.mgrid[-_HALF + 1 : _HALF, -_HALF + 1 : _HALF].astype(float)
        inner = self.picture[1:-1, 1:-1]
        self.slopes = np.column_stack([each.ravel() for each in (du, dv, dv * u - du * v, inner, np.ones_like(inner))])
        curvature = np.linalg.eigvalsh(self.slopes[:, :2].T @ self.slopes[:, :2])
        if curvature[0] < _STRAIGHT * curvature[1] or curvature[1] < 1.0:
            where = f"point at {at_px[0]:g}, {at_px[1]:g}"
            raise TrackingError(f"{where}: there is no dot or corner of an edge to follow; choose another")

    def find(self, picture: Picture, near_px: Floats) -> Point | None:
        """Return the point near where it is expected."""
        left, top = np.floor(near_px).astype(int) - _HALF - _REACH
        right, bottom = left + 2 * (_HALF + _REACH) + 1, top + 2 * (_HALF + _REACH) + 1
        height, width = picture.shape
        left, top, right, bottom = max(left, 0), max(top, 0), min(right, width), min(bottom, height)
        if min(right - left, bottom - top) < len(self.picture):
            return None
        around = np.ascontiguousarray(picture[top:bottom, left:right], dtype=np.float32)
        like = cv2.matchTemplate(around, self.picture.astype(np.float32), cv2.TM_CCOEFF_NORMED)
        _, best, _, (column, row) = cv2.minMaxLoc(like)
        if best < _LEAST_LIKE:
            return None
        return self._sharpened(picture, np.array((left + column + _HALF, top + row + _HALF), dtype=np.float64))

    def _sharpened(self, picture: Picture, at_px: Floats) -> Point | None:
        turn, start = 0.0, at_px
        for _ in range(_STEPS):
            seen = _patch(picture, at_px, turn)[1:-1, 1:-1].ravel()
            step, *_ = np.linalg.lstsq(self.slopes, seen, rcond=None)
            left = seen - self.slopes @ step
            gain = step[3]
            if gain < 0.1:
                return None
            # seen = gain (model + slopes along the remaining shift): the shift is applied to the sampling positions
            cos, sin = np.cos(turn), np.sin(turn)
            move = -step[:2] / gain
            at_px = at_px + np.array((cos * move[0] - sin * move[1], sin * move[0] + cos * move[1]))
            turn -= step[2] / gain
            if np.hypot(*move) < _STILL_PX:
                variance = float(left @ left) / (len(left) - self.slopes.shape[1])
                spread = 2 * variance / gain**2 * np.linalg.inv(self.slopes.T @ self.slopes)[:2, :2]
                like = np.corrcoef(seen, self.picture[1:-1, 1:-1].ravel())[0, 1]
                near = np.hypot(*(at_px - start)) < 2.0
                return Point(at_px, spread + _LEAST_SIGMA_PX**2 * np.eye(2)) if near and like > _LEAST_LIKE else None
        return None


def _patch(picture: Picture, at_px: Floats, turn: float) -> Floats:
    """Return the surroundings of a point, rotated about it: (2 _HALF + 1, same), bilinear."""
    reach = 2 * _HALF
    left, top = np.clip(np.floor(at_px).astype(int) - reach, 0, None)
    near = picture[top : top + 2 * reach + 2, left : left + 2 * reach + 2].astype(np.float32)
    cos, sin = np.cos(turn), np.sin(turn)
    to = np.array(((cos, -sin, at_px[0] - left), (sin, cos, at_px[1] - top)))
    to[:, 2] -= to[:, :2] @ (_HALF, _HALF)
    size = 2 * _HALF + 1
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpAffine(near, to, (size, size), flags=flags), dtype=np.float64)
