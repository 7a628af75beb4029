"""From the corners on record to the tip's path: the video's constants first, then every frame's pose and sigma."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.tracking.askew import askew_of
from straw.tracking.chapters import Timeline
from straw.tracking.course import Courses, course_of
from straw.tracking.doubt import doubted
from straw.tracking.errors import TrackingError
from straw.tracking.follow import NOT_DUE
from straw.tracking.jumps import swift
from straw.tracking.lens import Lens
from straw.tracking.noise import Frames, exposure_by_smear, lag_of, usual_lag
from straw.tracking.pose import Poses
from straw.tracking.poser import Poser
from straw.tracking.record import CHUNK, Record, Rows
from straw.tracking.settle import REST_FRAMES, settle
from straw.tracking.sharpen import FEWEST_CORNERS, LARGEST_RESIDUAL
from straw.tracking.side_by_side import side_by_side
from straw.tracking.task import Task, Track
from straw.tracking.trace import TipTrace
from straw.tracking.variance import telling
from straw.tracking.video import DecodeReport
from straw.tracking.viewer import KEPT, Viewed, Viewer, pick, viewer
from straw.tracking.views import AROUND, Views, views_of

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

NO_FIT = "the corners fit no pose in the plane of motion"
#: Of a chunk: its first frame, its rows, what is seen in them, in which of the rows, and the poses there, if any.
Posed = tuple[int, Rows, Views, NDArray[np.intp], tuple[Poses, Floats, Floats] | None]
_SPREAD = 40  # frames for each quantity that the constants are found from


class Gathered:
    """Features of every frame, from which the whole video is judged; gathered while decoding, when processors idle."""

    def __init__(self, record: Record, lens: Lens) -> None:
        self._record, self._lens, self._done, self._lost = record, lens, 0, False
        self._kept: list[tuple[NDArray[Any], ...]] = []
        self.views: dict[int, Viewed] = {}  # of the first chunks, by their first frame

    def take(self, *, last: bool = False) -> None:
        """Take in the chunks of the record that are complete; with ``last`` all of them."""
        while self._done < len(self._record) - (0 if last else CHUNK + AROUND):
            start, rows = self._done, self._record.rows(self._done, self._done + CHUNK)
            views, where = views_of(self._record, self._lens, start, rows)
            if len(self.views) < KEPT:
                self.views[start] = views, where
            size = np.sqrt(views.rays.var(axis=1).sum(axis=1))
            middle = np.column_stack((views.rays.mean(axis=1) * self._lens.fx, size * self._lens.fx))
            motion = (views.jump_px, views.speed_px, views.askew_px)
            quality = (views.widths, views.sweep, views.key, *motion, rows["rms_px"][where])
            course = course_of(rows["grid"][where].astype(np.float64))
            self._kept.append(
                (start + where, middle, *quality, rows["time_s"][where], course, self._since(rows)[where])
            )
            self._done += len(rows)

    def _since(self, rows: Rows) -> Flags:
        """Return which rows a lost packet may have corrupted: those until the next keyframe."""
        spoilt = np.empty(len(rows), np.bool_)
        for k, (corrupt, key) in enumerate(zip(rows["corrupt"].tolist(), rows["key"].tolist(), strict=True)):
            self._lost = not key and (self._lost or corrupt > 0)
            spoilt[k] = self._lost
        return spoilt

    def judged(self) -> tuple[NDArray[np.int64], Floats, Frames, NDArray[np.object_]]:
        """Return of the accepted frames: numbers (f,), middle and size of the board (f, 3), px, and the rest.

        Then why the others are rejected, by frame number (n,); "" for those accepted, or without a board.
        """
        columns = [np.concatenate(parts) for parts in zip(*self._kept, strict=True)]
        seen, middle, *quality, time_s, course, lost = columns
        said = np.full(len(self._record), "", dtype=object)
        if len(seen):
            said[seen] = doubted(Courses(time_s, course, quality[-1].astype(np.float64), lost))
        good = said[seen] == ""
        return seen[good], middle[good], Frames(middle[good, :2], *(column[good] for column in quality)), said


def solved(work: Task, record: Record, gathered: Gathered, report: DecodeReport, timeline: Timeline) -> Track:
    """Find the video's constants, then every frame's pose."""
    board = work.board
    gathered.take(last=True)
    seen, middle, frames, said = gathered.judged()
    if not len(seen) and (said != "").any():
        why = Counter(said[said != ""].tolist()).most_common(1)[0][0]
        what = f"{timeline.paths[0]}: every frame that shows the board is rejected ({why})"
        raise TrackingError(f"{what}; copy the file from the camera again")
    if not len(seen):
        what = f"{timeline.paths[0]}: no board of {board} in any of {len(record)} frames"
        raise TrackingError(
            f"{what} ({_commonest(record)}); check light, focus, the board's squares and the camera's place"
        )
    exposure_s = timeline.telemetry.exposure_s or exposure_by_smear(frames, timeline.period_s)
    features = np.column_stack((middle, frames.sweep)).astype(np.float32)
    chosen = np.unique(np.concatenate((np.arange(min(REST_FRAMES, len(seen))), _spread(features))))
    tell, fast = telling(frames), swift(frames)
    viewed = viewer(record, work.camera.lens, said == "", gathered.views)
    lag_px = lag_of(frames)
    askew_px, askew_sigma_px = askew_of(frames, lag_px or usual_lag(frames.key))
    groups = chosen, tell, fast
    views = pick(record, viewed, seen[np.unique(np.concatenate(groups))]).straightened(askew_px)
    constants, others, moving = (views.pick(np.flatnonzero(np.isin(views.frame, seen[which]))) for which in groups)
    settled = settle(work.camera, board, work.rest_pose, constants, level=work.level, exposure_s=exposure_s)
    poser = Poser(work, settled, timeline.period_s, lag_px, exposure_s)
    poser.learn(others, moving, askew_sigma_px)

    def straight(start: int, rows: Rows) -> Viewed:
        found, where = viewed(start, rows)
        return found.straightened(askew_px), where

    return _fit_all(work, record, straight, report, poser, said, timeline)


def _commonest(record: Record) -> str:
    """Return why most frames show no board."""
    reasons = Counter(text.decode() for _, rows in record.chunks() for text in rows["reason"].tolist())
    return next((text for text, _ in reasons.most_common() if text and text != NOT_DUE), "nothing seen")


def _spread(features: NDArray[np.float32]) -> NDArray[np.intp]:
    """Return frames that cover the range of each feature (f, m) evenly; most frames of a long video are alike."""
    chosen = []
    for values in features.T:
        order = np.argsort(values)
        wanted = np.linspace(values[order[0]], values[order[-1]], _SPREAD)
        chosen.append(order[np.minimum(np.searchsorted(values[order], wanted), len(order) - 1)])
    return np.unique(np.concatenate(chosen))


def _fit_all(
    work: Task,
    record: Record,
    viewed: Viewer,
    report: DecodeReport,
    poser: Poser,
    said: NDArray[np.object_],
    timeline: Timeline,
) -> Track:
    n, settled = len(record), poser.settled
    line_s, corner_count = settled.camera.line_s or 0.0, len(settled.points_m)
    state, sigma = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    time_s, rms_px, corners = np.empty(n), np.full(n, np.nan), np.zeros(n, np.int64)
    total, square, count = np.zeros((3, corner_count, 2))
    row = work.camera.lens.height / 2

    def posed(chunk: tuple[int, Rows]) -> Posed:
        start, rows = chunk
        views, where = viewed(start, rows)
        return start, rows, views, where, poser.poses(views) if len(where) else None

    for start, rows, views, where, found in side_by_side(posed, record.chunks()):
        passed = np.full(len(rows), np.nan)
        unseen = np.flatnonzero(~rows["seen"])
        said[start + unseen] = [text.decode() for text in rows["reason"][unseen].tolist()]
        if found:
            at = start + where
            fits, vector, spread = found
            number = fits.used.sum(axis=1)
            good = (fits.rms_px <= LARGEST_RESIDUAL * views.pitch_px) & (number >= FEWEST_CORNERS)
            said[at[~good]] = NO_FIT
            state[at[good]] = vector[good]
            sigma[at[good]] = np.sqrt(np.diagonal(spread[good], axis1=1, axis2=2))
            rms_px[at[good]], corners[at[good]] = fits.rms_px[good], number[good]
            counts = (fits.used & good[:, None])[..., None]
            total += np.where(counts, fits.residual_px, 0).sum(axis=0)
            square += np.where(counts, fits.residual_px**2, 0).sum(axis=0)
            count += counts.sum(axis=0)
            passed[where] = views.middle
        for k in range(len(rows)):  # a frame without the board is dated by the board's last place
            row = passed[k] if np.isfinite(passed[k]) else row
            passed[k] = row
        time_s[start : start + len(rows)] = work.start_s + rows["time_s"] + line_s * passed
    mean = total / np.maximum(count, 1)
    never = count[:, 0].reshape(work.board.shape) == 0
    _refuse_a_smaller_board(work, record, never)
    return Track(
        trace=_trace(time_s, state, sigma),
        rms_px=rms_px,
        corners=corners,
        decode=report,
        camera=settled.camera,
        board=work.board,
        said=said,
        rest_frames=settled.rest_frames,
        turn_sigma_rad=settled.turn_sigma_rad,
        line_sigma_s=settled.line_sigma_s,
        residual_px=mean,
        spread_px=np.sqrt(np.maximum(square / np.maximum(count, 1) - mean**2, 0)),
        telemetry=timeline.telemetry,
        exposure_s=poser.exposure_s,
        lag_px=poser.lag_px,
        never_seen=int(never.sum()),
        part=(work.fps, work.from_s, work.to_s),
    )


def _refuse_a_smaller_board(work: Task, record: Record, never: NDArray[np.bool_]) -> None:
    """Raise TrackingError when both rows and columns of corners are in no frame, although in the picture.

    A smaller board passes for a part of a larger one. Corners that a hand or the picture's edge hides all the time are
    a side of the board, or lie outside.
    """
    rows, columns = ~never.all(axis=1), ~never.all(axis=0)
    if rows.all() or columns.all():
        return
    lens, inside, of = work.camera.lens, 0, 0
    for _, chunk in record.chunks():
        at = chunk["grid"][chunk["seen"]][:, never]
        within = (at >= 0) & (at < (lens.width, lens.height))
        inside, of = inside + int(within.all(axis=(1, 2)).sum()), of + len(at)
    if 2 * inside > of:
        seen = f"{rows.sum() + 1}x{columns.sum() + 1}"
        what = f"{work.videos[0]}: of a board of {work.board} only {seen} squares are ever visible"
        raise TrackingError(f"{what}; if that is the whole board, give its number of squares")


def _trace(time_s: Floats, state: Floats, sigma: Floats) -> TipTrace:
    x, z, phi = state.T
    sigma_x, sigma_z, sigma_phi = sigma.T
    return TipTrace(time_s, x, z, phi, sigma_x, sigma_z, sigma_phi, np.isfinite(x), np.arange(len(x)))
