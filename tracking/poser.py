"""Fits a pose to every frame with the video's common constants, and gives its covariance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.tracking.errors import TrackingError
from straw.tracking.jumps import gain_of, gains
from straw.tracking.noise import MOTION_VECTOR_PX, of_rate, off_chord, usual_lag, without_lag
from straw.tracking.pose import Poses, apply
from straw.tracking.settle import Settled
from straw.tracking.start import free_start
from straw.tracking.task import Task
from straw.tracking.variance import Scatter, Seen, kinds, learnt, seen_of
from straw.tracking.views import LEAP_GAIN, Views

Floats = NDArray[np.float64]


class Poser:
    """Of one video. First ``learn`` from some of its frames, then ``poses`` of any, frames in order of time."""

    def __init__(self, work: Task, settled: Settled, period_s: float, lag_px: float, exposure_s: float) -> None:
        self.settled, self.period_s, self.lag_px, self.exposure_s = settled, period_s, lag_px, exposure_s
        self.shape, self._board_m = work.board.shape, work.board.corner_points_m()
        self._points_m = apply(settled.camera.tip_from_board, settled.points_m)
        self._usual = np.full(3, np.nan)  # a pose of the clip, where a start cannot be found otherwise
        self._scatter: Scatter | None = None
        self._askew_px, self._gain = 0.0, 1.0

    def learn(self, views: Views, swift: Views, askew_px: float = 0.0) -> None:
        """Learn the clip's variances from some frames, and from ``swift`` ones, see ``jumps``.

        ``askew_px``: standard deviation of what ``askew_of`` gives.
        """
        fits, _, seen, *_ = self._fitted(views)
        self._askew_px = askew_px
        fit = np.isfinite(fits.rms_px)
        lag_px = self.lag_px or usual_lag(views.key)
        self._scatter = learnt(self.shape, seen, lag_px)
        if fit.any():
            self._usual = fits.vector[fit][0]
        if self.settled.rest_frames:
            rest = self.settled.bundle.views.pick(np.zeros(1, np.intp))
            self.settled.doubt_rest(self._scatter, self._fitted(rest)[2], rest.off(askew_px)[0])
        swift = swift.pick(np.flatnonzero(np.isfinite(swift.jump_px)))  # a frame beside it may be rejected
        if len(swift.time_s):
            _, _, seen, _, codec = self._fitted(swift)
            self._gain = gain_of(
                _by_corners(seen, swift, swift.leap_px), LEAP_GAIN * (self._scatter.covariance(seen) + codec)
            )

    def poses(self, views: Views) -> tuple[Poses, Floats, Floats]:
        """Return the fits, the poses (f, 3) with the codec's lag put right, and their covariance (f, 3, 3)."""
        assert self._scatter is not None
        fits, vector, seen, rate, codec = self._fitted(views)
        askew = _by_corners(seen, views, views.off(self._askew_px))
        settled = self.settled.covariance(views, vector, rate, askew)
        own = gains(self._gain, views.key, views.speed_px)[:, None, None] * (self._scatter.covariance(seen) + codec)
        return fits, vector, own + settled

    def _fitted(self, views: Views) -> tuple[Poses, Floats, Seen, Floats, Floats]:
        plane, line_s = self.settled.plane, self.settled.camera.line_s or 0.0
        begin = np.full((len(views.time_s), 3), np.nan)
        try:
            begin[0] = free_start(views, self.settled.camera, self._board_m)
        except TrackingError:
            begin[0] = self._usual
            if not np.isfinite(self._usual[0]):
                raise
        rays = views.at_once(line_s, self.exposure_s)
        fits = plane.fit_rays(rays, views.px_per_ray, self._points_m, begin, views.used)
        rate = np.gradient(fits.vector, views.time_s, axis=0) if len(begin) > 1 else np.zeros((1, 3))
        slopes = plane.slopes(views.px_per_ray, self._points_m, fits.vector)
        eye_m = plane.world_from_camera[(0, 2), 3]
        vector, lag = without_lag(fits, slopes, rate * self.period_s, views.key, self.lag_px, eye_m)
        kind = kinds(views.key, views.speed_px)
        still = np.nan_to_num(views.speed_px) <= MOTION_VECTOR_PX
        toward, chord = off_chord(fits, slopes, views.chord_px, still)
        seen = seen_of(self.shape, slopes, fits.residual_px, fits.used, views.across, kind)
        rolling = of_rate(fits, slopes, line_s * views.rows, views.doubt)
        return fits, vector + toward, seen, rate, chord + lag + rolling


def _by_corners(seen: Seen, views: Views, moved_px: Floats) -> Floats:
    """Return how poses (f, 3) change with corners that move by (f, n, 2) px along u and v."""
    across = (views.across[:, None] @ moved_px[..., None])[..., 0]
    return np.asarray(np.einsum("fijwm,fijw->fm", seen.answer(), across.reshape(seen.left.shape)))
