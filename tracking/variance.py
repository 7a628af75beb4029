"""How well a clip's corners are known: variance components, estimated from the residuals of its own corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from straw.tracking.noise import FOLLOWED_PX, Frames
from straw.tracking.patterns import Patterns

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Places = NDArray[np.intp]

#: As long as motion vectors do not follow it, the codec treats the board as still, so that it lags. A keyframe cannot
#: lag.
SLOW, FAST, FRESH = range(3)
_PER_KIND = 60  # frames: 95 numbers each, of which a fifth are independent, give a variance to 4 %
_FEWEST = 8
_MOST_ACROSS = 9  # corners along a side that components are estimated from
#: How many times larger the codec's distortion of a predicted frame is in a pose's own directions than in the others,
#: for each kind of frame: what the codec leaves out of a motion looks like a motion, so that no residual shows it. A
#: residual above that of keyframes shows how much the codec distorts. Where motion vectors follow, little is left out.
MOTION_LIKE = np.array((5.0, 2.0, 1.0))
#: More than these squared lags of the codec do not look like a motion: coarsely coded noise is a residual, too.
MOST_LAGS = 2.0
#: Variance of a shift of the whole board in a frame, in squared lags of the codec: what was coded wrong in one frame is
#: copied into the next ones. At rest there is none but that of edges that run askew (``askew``).
#: The three are from the errors of painted clips; tests/benchmarks/README.md names them.
SHIFT = 0.05


@dataclass(frozen=True)
class Seen:
    """Fits of f frames in the picture, with errors expressed across the board's edges.

    ``slopes`` (f, nx, ny, 2, 3): by how much corners move with the pose, 0 where a corner is not used; ``left`` (f,
    nx, ny, 2): residuals, px; ``used`` (f, n); ``kind`` (f,).
    """

    slopes: Floats
    left: Floats
    used: Flags
    kind: Places

    @property
    def square(self) -> Floats:
        """Sum of squared residuals (f,), px^2."""
        return np.asarray((self.left**2).sum(axis=(1, 2, 3)))

    @property
    def corner_px2(self) -> Floats:
        """Variance of one corner along one direction (f,), px^2, by the residuals."""
        return np.asarray(self.square / np.maximum(2 * self.used.sum(axis=1) - 3, 1))

    def normal(self) -> Floats:
        """Return J^T J (f, 3, 3)."""
        flat = self.slopes.reshape(len(self.slopes), -1, 3)
        return np.asarray(flat.transpose(0, 2, 1) @ flat + 1e-9 * np.eye(3))  # a frame without a fit must stay solvable

    def answer(self) -> Floats:
        """Return by how much the pose moves with each corner (f, nx, ny, 2, 3)."""
        flat = self.slopes.reshape(len(self.slopes), -1, 3)
        return np.asarray((flat @ np.linalg.inv(self.normal())).reshape(self.slopes.shape))


def seen_of(shape: tuple[int, int], slopes: Floats, left: Floats, used: Flags, across: Floats, kind: Places) -> Seen:
    """Return the fits in the picture; ``slopes`` (f, n, 2, 3) and ``left`` (f, n, 2) along u and v."""
    turned = np.where(used[..., None, None], across[:, None] @ slopes, 0.0)
    miss = np.where(used[..., None], (across[:, None] @ np.nan_to_num(left)[..., None])[..., 0], 0.0)
    return Seen(turned.reshape(-1, *shape, 2, 3), miss.reshape(-1, *shape, 2), used, kind)


@dataclass(frozen=True)
class Scatter:
    """Variances, px^2: ``parts`` (3 kinds of frame, 3 patterns), ``fresh_px2`` of a corner in keyframes.

    ``lag_px``: by how much predicted pictures are behind (see ``noise``).
    """

    shape: tuple[int, int]
    parts: Floats
    fresh_px2: float = 0.0
    lag_px: float = 0.0

    def covariance(self, seen: Seen) -> Floats:
        """Return the covariance (f, 3, 3) of poses, SI, of frames in order of time.

        A frame whose residual exceeds that of its kind is less certain; so is one beside it, as a picture that is
        merely copied has none of its own.
        """
        answer, own = seen.answer(), np.maximum(seen.corner_px2, 1e-12)
        beside = np.concatenate((own[:1], own, own[-1:]))
        most = np.maximum(own, np.maximum(beside[:-2], beside[2:]))
        excess = np.maximum(most - self.fresh_px2, 0)
        excess = excess / (1 + excess / np.maximum(MOST_LAGS * self.lag_px**2, 1e-12))
        gain = 1 + (MOTION_LIKE[seen.kind] - 1) * excess / own
        return np.asarray(gain[:, None, None] * self.of_corners(seen, answer) + self._of_shift(answer))

    def of_corners(self, seen: Seen, answer: Floats) -> Floats:
        """Return the same if corners err in a pose's directions as they do in others; ``answer``: that of ``seen``."""
        by_part = Patterns.of(self.shape).between(answer)
        return np.asarray(np.einsum("fc,cfij->fij", self._of_frames(seen, by_part), by_part))

    def _of_frames(self, seen: Seen, by_part: Floats) -> Floats:
        """Return the components (f, 3) in each frame: those of its kind, in proportion to its own residual."""
        variance = self.parts[np.where(seen.kind == FRESH, SLOW, seen.kind)]
        expected = variance.sum(axis=1) * 2 * seen.used.sum(axis=1)
        expected -= np.einsum("fc,cfij,fij->f", variance, by_part, seen.normal())
        return np.asarray((seen.square / np.maximum(expected, 1e-12))[:, None] * variance)

    def at_rest(self, answer: Floats, rest: Seen) -> Floats:
        """Return the covariance (c, c) of quantities with sensitivity (nx, ny, 2, c) to the corners of a board at rest.

        ``rest`` (one frame): the fit of the mean of its pictures, whose residual tells how far they are independent:
        the codec copies some, and codes the noise of others.
        """
        patterns = Patterns.of(self.shape)
        variance = self._of_frames(rest, patterns.between(rest.answer()))[0]
        return np.asarray(np.tensordot(variance, patterns.between(answer[None]), 1)[0])

    def _of_shift(self, answer: Floats) -> Floats:
        """Return the covariance (f, c, c) of quantities with sensitivity (f, nx, ny, 2, c) to a board's shift."""
        whole = answer.sum(axis=(1, 2))
        return np.asarray(SHIFT * self.lag_px**2 * (whole.transpose(0, 2, 1) @ whole))


def kinds(key: Flags, speed_px: Floats) -> Places:
    """Return which kind of frame each is; a frame of unknown speed counts as slow, the less certain kind."""
    return np.where(key, FRESH, np.where(np.nan_to_num(speed_px) > FOLLOWED_PX, FAST, SLOW))


def telling(frames: Frames) -> Places:
    """Return which frames to learn from."""
    kind = kinds(frames.key, frames.speed_px)
    return np.unique(
        np.concatenate([_evenly(np.flatnonzero(kind == which), _PER_KIND) for which in (SLOW, FAST, FRESH)])
    )


def _evenly(places: Places, most: int) -> Places:
    if len(places) <= most:
        return places
    return places[np.linspace(0, len(places) - 1, most).astype(np.intp)]


def learnt(shape: tuple[int, int], seen: Seen, lag_px: float = 0.0) -> Scatter:
    """Estimate a clip's variances; ``lag_px``: by how much its predicted pictures are behind (see ``noise``).

    Restricted to what a pose cannot absorb: the residuals' squares, and their sums along lines of corners, are equated
    with their expectations, with the fit's own degrees of freedom (Rao's MINQUE, J. Am. Stat. Assoc. 67 (1972) 112).
    """
    fresh = seen.corner_px2[seen.kind == FRESH]
    return Scatter(shape, _parts(shape, seen), float(np.median(fresh)) if len(fresh) else 0.0, lag_px)


def _parts(shape: tuple[int, int], seen: Seen) -> Floats:
    """Return the components (3 kinds, 3), px^2; of all frames together where a kind has too few."""
    every = -(-max(shape) // _MOST_ACROSS)
    K = Patterns.of(shape, every).whole()
    slopes, left = (each[:, ::every, ::every] for each in (seen.slopes, seen.left))
    A, b = np.zeros((3, len(K), len(K))), np.zeros((3, len(K)))
    products = (K[:, None] * K).reshape(-1, K.shape[-1])
    flat_slopes = slopes.reshape(len(left), -1, 3)
    bases, moved = np.linalg.qr(flat_slopes)[0], np.abs(flat_slopes).sum(axis=2) > 0
    for H, used, r, which in zip(bases, moved, left.reshape(len(left), -1), seen.kind, strict=True):
        if np.count_nonzero(used) <= H.shape[1]:
            continue
        r = r - H @ (H.T @ r)
        # With P = 1 - H H^T, tr(P K P L) = tr(K L) - 2 tr(H^T K L H) + tr(H^T K H H^T L H), each of them symmetric.
        KH = (K @ H) * used[:, None]
        within = (H.T @ KH).reshape(len(K), -1)
        flat = KH.reshape(len(K), -1)
        A[which] += (products @ used).reshape(len(K), len(K), -1) @ used - 2 * flat @ flat.T + within @ within.T
        b[which] += r @ K @ r
    few = np.bincount(seen.kind, minlength=3) < _FEWEST
    A[few], b[few] = A.sum(axis=0), b.sum(axis=0)
    return np.stack([np.maximum(_positive(one, other), (1e-8, 0, 0)) for one, other in zip(A, b, strict=True)])


def _positive(A: Floats, b: Floats) -> Floats:
    """Return the x, none below 0, for which A x is nearest to b."""
    scale = 1 / np.sqrt(np.maximum(np.diag(A), 1e-300))
    return np.asarray(nnls(A * scale * scale[:, None], b * scale)[0] * scale)
