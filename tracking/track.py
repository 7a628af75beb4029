"""Track: from a recording's files to the tip's path, with the reason for every frame that is missing from it."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.chapters import Timeline, in_order
from straw.tracking.errors import TrackingError
from straw.tracking.follow import Follower
from straw.tracking.record import Record
from straw.tracking.solve import Gathered, solved
from straw.tracking.task import Task, Track
from straw.tracking.video import DecodeReport, Gap, ahead, frames_missing

_OTHER_RATE = 0.1  # 239.76 counts as 240; slow motion is at least twice as slow
_AHEAD = 24  # pictures decoded while the board is searched for, which takes 0.1 s: 75 MB of 1080p


def track(
    video: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    camera: Camera,
    board: Board,
    *,
    record: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
    **task: Any,
) -> Track:
    """Track the board through the files of one recording; keywords as ``Task``'s.

    ``record``: where corners are kept (0.6 kB a frame); work that was interrupted goes on from there. It is left open
    in ``Track.record`` for the caller, who removes it after writing the result. Without it a temporary file is used.
    ``trace.frame`` counts decoded frames from 0. Sigmas come from the corners' own residuals; they do not include a
    wrong lens, rest pose, turn or tip offset. Memory does not grow with the video but for the trace itself. Raises
    TrackingError for a bad file, a lens for another picture size,
    no rest, or no board.
    """
    files = [video] if isinstance(video, str | os.PathLike) else list(video)
    work = Task(tuple(in_order(files)), camera, board, **task)
    part = work.fps, work.from_s, work.to_s
    one_thread = threadpool_limits(limits=1, user_api="blas")  # matrices are small, and processors busy decoding
    with one_thread, Timeline(files, *part) as timeline, tempfile.TemporaryDirectory() as folder:
        _check_rate(timeline, work.fps)
        _check_size(timeline, camera)
        kept = Record(record or Path(folder) / "record", work.identity(), board.shape)
        try:
            gathered = Gathered(kept, camera.lens)
            report = _follow(timeline, work, kept, gathered, progress)
            done = solved(work, kept, gathered, report, timeline)
        except TrackingError:  # a retry would fail in the same way
            kept.remove()
            raise
        except BaseException:
            kept.close()
            raise
        if record is None:
            kept.remove()
        return replace(done, record=kept if record else None)


def _check_size(timeline: Timeline, camera: Camera) -> None:
    lens = camera.lens
    if (timeline.width, timeline.height) != (lens.width, lens.height):
        what = f"pictures are {timeline.width}x{timeline.height}, the lens is for {lens.width}x{lens.height}"
        raise TrackingError(f"{timeline.paths[0]}: {what}; calibrate in the mode of the recording")


def _check_rate(timeline: Timeline, fps: float) -> None:
    """Raise TrackingError for a video in slow motion, unless the true rate is given."""
    plays, filmed = 1 / timeline.period_s, timeline.capture_rate
    if not fps and filmed and abs(filmed / plays - 1) > _OTHER_RATE:
        what = f"{timeline.paths[0]}: filmed at {filmed:.6g} frames/s by its tags, its time stamps run at {plays:.6g}"
        raise TrackingError(f"{what}; give --fps {filmed:.6g}, or --fps {plays:.6g} if the time stamps are right")


def _follow(
    timeline: Timeline,
    work: Task,
    record: Record,
    gathered: Gathered,
    progress: Callable[[int, int], None] | None,
) -> DecodeReport:
    """Follow the board through all frames that are not yet on record."""
    follower = Follower(work.camera, work.board, work.rest_pose, work.near_px)
    before = record.rows(len(record) - 1, len(record))
    after_s = float(before["time_s"][0]) if len(before) else -math.inf
    if ends := record.ends():
        follower.take_over(*ends)
    corrupt = 0
    pictures = ahead(timeline.frames(after_s), _AHEAD)
    try:
        for frame in pictures:
            record.add(frame, frame.corrupt - corrupt, follower.look(frame.luma, frame.time_s))
            corrupt = frame.corrupt
            gathered.take()
            if progress:
                progress(len(record), max(timeline.expected, len(record)))
    finally:
        pictures.close()  # stops the decoder before its file is closed
        record.flush()
    if not len(record):
        what = f"{timeline.paths[0]}: none of {timeline.expected} frames could be decoded"
        raise TrackingError(f"{what}; copy the file again")
    return _account(record, timeline, timeline.corrupt - corrupt)


def _account(record: Record, timeline: Timeline, corrupt: int) -> DecodeReport:
    """Return what became of the frames, by the record: it also knows what was decoded before an interruption."""
    gaps, last_s = [], math.nan
    for _, rows in record.chunks():
        corrupt += int(rows["corrupt"].sum())
        times = np.concatenate(([last_s], rows["time_s"]))
        for k in np.flatnonzero(np.diff(times) > 1.5 * timeline.period_s):
            gaps.append(Gap(float(times[k]), frames_missing(times[k], times[k + 1], timeline.period_s)))
        last_s = float(rows["time_s"][-1])
    expected = max(timeline.expected, len(record))
    return DecodeReport(len(record), expected, tuple(gaps), corrupt, timeline.repeated)
