"""How well a clip's corners are known: variance components, estimated from the residuals of its own corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from straw.tracking.noise import MOTION_VECTOR_PX, Frames
from straw.tracking.patterns import Patterns, common_to

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Places = NDArray[np.intp]

#: Slower than the unit of motion vectors a frame, the codec treats the board as still, so that it lags. A keyframe
#: cannot lag.
SLOW, FAST, FRESH = range(3)
_PER_KIND = 60  # frames: 95 numbers each, of which a fifth are independent, give a variance to 4 %
_FEWEST = 8
_STEPS = 40  # keyframes, whose steps show the common error; as many as in ten seconds
_MOST_ACROSS = 9  # corners along a side that components are estimated from
_AROUND = np.array((-2, -1, 1, 2))
_CUBIC = np.array((-1, 4, 4, -1)) / 6  # the cubic through them, in the middle
# Prior where keyframes are few: of the corners' variance in slow frames 0.3 is a common shift of the board, 0.4 stretch
# and shear, each as uncertain as after so many keyframes (from clips 100 to 105 of tracking_painted).
_USUAL_SHARES, _USUAL_WEIGHT = (0.3, 0.4), 2.0


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
    """Variances, px^2: ``parts`` (3 kinds of frame, 3 patterns), and ``common_px2`` (2,) of the additional error of a
    slow board beyond them as a whole: in each number of its shift, and of its stretch and shear.
    """

    shape: tuple[int, int]
    parts: Floats
    common_px2: Floats

    def covariance(self, seen: Seen) -> Floats:
        """Return the covariance (f, 3, 3) of poses, SI; a frame whose residual exceeds that of its kind is less
        certain."""
        common = np.tensordot(self.common_px2, common_to(self.shape, seen.answer()), 1)
        return np.asarray(self.of_corners(seen) + (seen.kind != FAST)[:, None, None] * common)

    def of_corners(self, seen: Seen) -> Floats:
        """Return the same without the common error of a slow board."""
        by_part = Patterns.of(self.shape).between(seen.answer())
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
        share = variance.sum() / self.parts[SLOW].sum()
        own, common = patterns.between(answer[None]), common_to(self.shape, answer[None])
        return np.asarray((np.tensordot(variance, own, 1) + np.tensordot(share * self.common_px2, common, 1))[0])


def kinds(key: Flags, speed_px: Floats) -> Places:
    """Return which kind of frame each is; a frame of unknown speed counts as slow, the less certain kind."""
    return np.where(key, FRESH, np.where(np.nan_to_num(speed_px) > MOTION_VECTOR_PX, FAST, SLOW))


def telling(numbers: NDArray[np.int64], frames: Frames) -> tuple[Places, Places]:
    """Return which frames to learn from, and which of them are keyframes amid slow ones, two on either side.

    ``numbers`` (f,): of the frames in the video.
    """
    kind = kinds(frames.key, frames.speed_px)
    chosen = [_evenly(np.flatnonzero(kind == which), _PER_KIND) for which in (SLOW, FAST, FRESH)]
    keys = np.flatnonzero(kind == FRESH)
    keys = keys[(keys > 1) & (keys < len(numbers) - 2)]
    near = keys[:, None] + _AROUND
    calm = (numbers[near] - numbers[keys][:, None] == _AROUND).all(axis=1) & (kind[near] == SLOW).all(axis=1)
    keys = _evenly(keys[calm & (frames.speed_px[keys] < MOTION_VECTOR_PX)], _STEPS)  # not where it is NaN
    return np.unique(np.concatenate((*chosen, keys, (keys[:, None] + _AROUND).ravel()))), keys


def _evenly(places: Places, most: int) -> Places:
    if len(places) <= most:
        return places
    return places[np.linspace(0, len(places) - 1, most).astype(np.intp)]


def learnt(shape: tuple[int, int], seen: Seen, vector: Floats, keys: Places) -> Scatter:
    """Estimate a clip's variances; ``keys``: places of keyframes among the frames, each between two pairs of others.

    Restricted to what a pose cannot absorb: the residuals' squares, and their sums along edges and over the board,
    are equated with their expectations, with the fit's own degrees of freedom (Rao's MINQUE, J. Am.
    Stat. Assoc. 67 (1972) 112). The common error of the board is not in its residuals, but as a keyframe does not
    lag with its neighbours, the step of the pose there shows it. How long errors last is seen in the residuals.
    """
    parts, slow = _parts(shape, seen), seen.kind == SLOW
    free = np.maximum(2 * seen.used.sum(axis=1) - 3, 1)
    rms_px2 = float(np.median((seen.square / free)[slow])) if slow.any() else float(parts[SLOW].sum())
    usual = Scatter(shape, parts, np.array(_USUAL_SHARES) * rms_px2)
    return Scatter(shape, parts, _common(usual, seen, vector, keys)) if len(keys) else usual


def _common(usual: Scatter, seen: Seen, vector: Floats, keys: Places) -> Floats:
    """Return the variances (2,), px^2, by the steps of the pose at keyframes, weighted with the usual ones."""
    near = keys[:, None] + _AROUND
    step = vector[keys] - np.einsum("k,fkm->fm", _CUBIC, vector[near])

    alike = _of_cubic(seen.left[near])

    def of_step(each: Floats) -> Floats:
        return np.asarray(each[..., keys, :, :] + alike * each[..., near, :, :].mean(axis=-3))

    own, by_common = of_step(usual.of_corners(seen)), of_step(common_to(usual.shape, seen.answer()))
    inverse = np.linalg.inv(own + np.tensordot(usual.common_px2, by_common, 1))
    told = inverse @ by_common @ inverse
    excess = np.einsum("fi,cfij,fj->c", step, told, step) - np.einsum("cfij,fji->c", told, own)
    A = np.einsum("cfij,dfji->cd", told, by_common)
    prior = _USUAL_WEIGHT / usual.common_px2**2
    return _positive(A + np.diag(prior), excess + prior * usual.common_px2)


def _of_cubic(left: Floats) -> float:
    """Return the variance of the cubic by errors of variance 1, correlated as the residuals (k, 4, nx, ny, 2) are."""
    flat = left.reshape(*left.shape[:2], -1)
    together = np.einsum("kai,kbi->ab", flat, flat)
    sigma = np.sqrt(np.maximum(np.diag(together), 1e-30))
    return float(_CUBIC @ (together / sigma / sigma[:, None]) @ _CUBIC)


def _parts(shape: tuple[int, int], seen: Seen) -> Floats:
    """Return the components (3 kinds, 3), px^2; of all frames together where a kind has too few."""
    every = -(-max(shape) // _MOST_ACROSS)
    K = Patterns.of(shape, every).whole()
    slopes, left = (each[:, ::every, ::every] for each in (seen.slopes, seen.left))
    A, b = np.zeros((3, len(K), len(K))), np.zeros((3, len(K)))
    products = (K[:, None] * K).reshape(-1, K.shape[-1])
    for J, r, which in zip(slopes.reshape(len(left), -1, 3), left.reshape(len(left), -1), seen.kind, strict=True):
        used = np.abs(J).sum(axis=1) > 0
        if np.count_nonzero(used) <= J.shape[1]:
            continue
        H = np.linalg.qr(J)[0]
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
