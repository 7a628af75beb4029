"""Calibration: from pictures or videos of a checkerboard to a lens with its uncertainty."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from straw.tracking.calibrate_views import pictures, views_in
from straw.tracking.chapters import copies
from straw.tracking.errors import TrackingError
from straw.tracking.lens import Lens
from straw.tracking.lens_fit import Fit, View, fit_lens, held_out_px, lens_of
from straw.tracking.sharpen import FEWEST_CORNERS

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

KINDS = ("fisheye", "brown_conrady")
FEWEST_VIEWS = 4
_MOST_VIEWS = 40  # more views cost time without precision: the remaining residual is the lens model's
_FOLDS = 5
_SAMPLES = 80
_CELLS = (6, 4)  # of the picture, across and down, for the count of where boards were
_FEW, _FRONTAL_DEG, _CENTRAL = 15, 15.0, 0.6


@dataclass(frozen=True)
class Calibration:
    """A lens, how it was chosen and how good it is.

    ``crossed_px``: error (px rms) by kind on views left out of the fit. ``uncertainty_px`` (rows, columns): one sigma
    of where a ray lands, over the picture at ``grid_px`` (rows, columns, 2). ``advice``: what would make it better.
    """

    fit: Fit
    crossed_px: dict[str, float]
    views: list[View]
    looked_at: int
    grid_px: Floats
    uncertainty_px: Floats
    advice: tuple[str, ...]


def calibrate(
    paths: Sequence[str | os.PathLike[str]],
    progress: Callable[[int, int], None] | None = None,
    board: tuple[int, int] | None = None,
) -> Calibration:
    """Calibrate a lens from stills, videos or both, of any checkerboard.

    Its size does not matter, nor that all of it is seen: each view has a pose of its own. ``board``: its squares along
    both sides; grids with more squares are ignored.

    Fisheye and Brown-Conrady are both fitted, and the one that predicts held-out views better is taken. Raises
    TrackingError for files that cannot be read, differ in size, or show too few boards.
    """
    views: list[View] = []
    files = list(dict.fromkeys(map(Path, paths)))
    twice = {copy for copy, _ in copies(files)}
    again = len(paths) - len(files) + len(twice)
    size, looked_at = (0, 0), again
    for name, picture, of in pictures([file for file in files if file not in twice]):
        looked_at += 1
        here = picture.shape[1], picture.shape[0]
        if size != (0, 0) and here != size:
            what = f"{name}: is {here[0]}x{here[1]}, the pictures before it {size[0]}x{size[1]}"
            raise TrackingError(f"{what}; calibrate one camera in one mode at a time")
        size = here
        views += views_in(name, picture, board)
        if progress:
            progress(looked_at, max(of, looked_at))
    if len(views) < FEWEST_VIEWS:
        what = f"calibrate: {len(views)} checkerboards in {looked_at} pictures, at least {FEWEST_VIEWS} are needed"
        of_size = f"the board of {board[0]}x{board[1]} squares" if board else "a board of 5x5 squares or more"
        raise TrackingError(f"{what}; show {of_size}, sharp and well lit, in many places and tilts")
    views = _varied(views)
    fits = {kind: fit for kind in KINDS if (fit := _fit_or_none(kind, size, views))}
    sound = [view for k, view in enumerate(views) if any(fit.inliers[k] >= FEWEST_CORNERS for fit in fits.values())]
    if FEWEST_VIEWS <= len(sound) < len(views):  # without boards that fit no lens
        views = sound
        fits = {kind: fit for kind in KINDS if (fit := _fit_or_none(kind, size, views))}
    crossed = {kind: _crossed(fit, views) for kind, fit in fits.items()}
    if not np.isfinite(list(crossed.values())).any():
        raise TrackingError("calibrate: no lens fits the views; are they of one camera, one mode, not stabilised?")
    fit = fits[min(crossed, key=lambda kind: crossed[kind])]
    grid, uncertainty = projection_uncertainty(fit)
    advice = (f"{again} of {len(paths)} files hold the same as another and were left out",) if again else ()
    return Calibration(fit, crossed, views, looked_at, grid, uncertainty, advice + _advice(fit, views, uncertainty))


def _varied(views: list[View]) -> list[View]:
    """Return views that differ most from one another: a video shows many that are nearly the same."""
    if len(views) <= _MOST_VIEWS:
        return views
    looks = np.array(
        [np.concatenate((v.pixels.mean(axis=0), v.pixels.std(axis=0), v.pixels.max(axis=0))) for v in views]
    )
    chosen = [int(np.argmax(looks[:, 2]))]
    apart = np.linalg.norm(looks - looks[chosen[0]], axis=1)
    while len(chosen) < _MOST_VIEWS:
        chosen.append(int(np.argmax(apart)))
        apart = np.minimum(apart, np.linalg.norm(looks - looks[chosen[-1]], axis=1))
    return [views[k] for k in sorted(chosen)]


def _fit_or_none(kind: str, size: tuple[int, int], views: list[View]) -> Fit | None:
    try:
        return fit_lens(kind, size, views)
    except TrackingError:  # a very wide lens is beyond Brown-Conrady
        return None


def _crossed(fit: Fit, views: list[View]) -> float:
    """Return the error (px rms) on views left out of a fit, median over views; infinite when nothing fits."""
    order = np.random.default_rng(0).permutation(len(views))
    folds = min(_FOLDS, len(views) // 2)
    size, left = (fit.lens.width, fit.lens.height), []
    for fold in range(folds):
        out = set(order[fold::folds].tolist())
        try:
            part = fit_lens(fit.lens.kind, size, [view for k, view in enumerate(views) if k not in out], fit.lens)
        except TrackingError:
            return float("inf")
        left += held_out_px(part, [views[k] for k in out]).tolist()
    return float(np.nanmedian(left)) if np.isfinite(left).any() else float("inf")


def projection_uncertainty(fit: Fit) -> tuple[Floats, Floats]:
    """Return pixels (r, c, 2) all over the picture and the standard deviation (r, c) of their rays' projection, px.

    Lenses drawn from the fit's covariance are first aligned by a rotation: a lens that only points elsewhere causes no
    error, as the camera's pose is estimated with the same lens.
    """
    lens = fit.lens
    u, v = np.meshgrid(np.linspace(0, lens.width - 1, 33), np.linspace(0, lens.height - 1, 19))
    pixels = np.stack((u, v), axis=-1)
    rays = lens.rays(pixels.reshape(-1, 2))
    known = np.isfinite(rays).all(axis=1)
    towards = np.column_stack((rays[known], np.ones(np.count_nonzero(known))))
    numbers = np.array((lens.fx, lens.fy, lens.cx, lens.cy, *lens.distortion))
    drawn = np.random.default_rng(0).multivariate_normal(numbers, fit.covariance, _SAMPLES, check_valid="ignore")
    home, slope = lens.project_with_jacobian(towards)
    by_turn = (slope @ np.cross(np.eye(3)[None], towards[:, None]).transpose(0, 2, 1)).reshape(-1, 3)
    squares = np.zeros(len(towards))
    for sample in drawn:
        other = _lens_or_none(lens, sample)
        miss = other.project(towards) - home if other else np.full_like(home, np.nan)
        sound = np.isfinite(miss).all(axis=1)
        turn, *_ = np.linalg.lstsq(by_turn[np.repeat(sound, 2)], miss[sound].ravel(), rcond=None)
        squares += ((miss - (by_turn @ turn).reshape(-1, 2)) ** 2).mean(axis=1)
    sigma = np.full(known.shape, np.nan)
    sigma[known] = np.sqrt(squares / len(drawn))
    return pixels, sigma.reshape(u.shape)


def _lens_or_none(lens: Lens, numbers: Floats) -> Lens | None:
    try:
        return lens_of(lens.kind, (lens.width, lens.height), numbers)
    except TrackingError:
        return None


def _advice(fit: Fit, views: list[View], uncertainty: Floats) -> tuple[str, ...]:
    """Return what would make the calibration better."""
    lens, found = fit.lens, []
    if len(views) < _FEW:
        found.append(f"too few views: {len(views)}; take {_FEW} or more")
    tilts = [np.degrees(np.arccos(min(abs(pose[2, 2]), 1.0))) for pose in fit.poses]
    steep = float(np.percentile(tilts, 75))
    if steep < _FRONTAL_DEG:
        found.append(
            f"too frontal: three in four views are tilted by less than {steep:.0f} deg; tilt the board by 20 to 45 deg"
        )
    corners = np.concatenate([view.pixels for view in views]) / (lens.width, lens.height)
    cells = {tuple(cell) for cell in np.floor(corners * _CELLS).astype(int).tolist()}
    share = len(cells) / (_CELLS[0] * _CELLS[1])
    if share < _CENTRAL:
        found.append(
            f"too central: boards in only {100 * share:.0f} % of the picture; show them in its corners, and close up"
        )
    if not np.isfinite(uncertainty).all() or np.nanmax(uncertainty) > 1.0:
        found.append(
            "uncertain by more than 1 px in places: see the map (--picture), and keep the tip's board away from them"
        )
    return tuple(found)
