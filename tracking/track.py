"""Track: from a recording's files to the tip's path, with an account of every frame that is not in it."""

from __future__ import annotations

import math
import os
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracking.board import Board
from tracking.camera import Camera
from tracking.chapters import Timeline
from tracking.corners import FEWEST_CORNERS, LARGEST_RESIDUAL
from tracking.errors import TrackingError
from tracking.follow import NOT_DUE, Follower, Rest
from tracking.gpmf import Telemetry
from tracking.noise import Frames, codec_lag_px, exposure_by_smear, shared_px, with_shared
from tracking.pose import apply
from tracking.record import Record
from tracking.settle import REST_FRAMES, Settled, free_start, settle
from tracking.trace import TipTrace
from tracking.video import DecodeReport, Gap, Picture, ahead, frames_missing
from tracking.views import Views, views_of

Floats = NDArray[np.float64]

NO_FIT = "the corners fit no pose in the plane of motion"
REPEATED = "the picture repeats the one before"
_SPREAD = 40  # frames for each quantity that the constants are found from
_STRIDE = 32  # pixels compared when looking for repeated pictures
_SAME = 0.8  # of them: a copy keeps as many, and so do still scenes; the board's motion decides (see ``views``)


@dataclass(frozen=True)
class Track:
    """What a video says about the tip.

    ``rms_px`` (n,): reprojection residual per coordinate and frame, ``corners`` (n,): how many corners it rests on (NaN
    and 0 where invalid). ``camera``: the one used, with ``world_from_camera``, ``board_turn_rad`` and ``line_s`` as
    found; ``trace.time_s`` is when the shutter passed the board's middle. ``invalid``: how many frames are not valid,
    by reason. ``rest_frames``: how many still frames placed the camera (0 when its place was given). ``residual_px``
    (corners, 2): the mean over all frames of what the corners miss by, and ``spread_px`` (corners, 2) its deviation.
    ``exposure_s``: by the camera's telemetry, or by the smear; ``lag_px``: what the codec's prediction lags by.
    """

    trace: TipTrace
    rms_px: Floats
    corners: NDArray[np.int64]
    decode: DecodeReport
    camera: Camera
    board: Board
    invalid: Mapping[str, int]
    rest_frames: int
    turn_sigma_rad: tuple[float, float]
    line_sigma_s: float
    residual_px: Floats
    spread_px: Floats
    telemetry: Telemetry = field(default_factory=Telemetry)
    exposure_s: float = 0.0
    lag_px: float = 0.0
    record: Record | None = None


@dataclass(frozen=True)
class Task:
    """What to track and by what: the files of one recording, camera, board, and what places the camera.

    ``rest_pose`` (x_m, z_m, phi_rad) is the tip's known pose while the board stands still at the beginning; the
    camera's place is found from it, whatever ``camera`` says (see ``settle``). None takes ``camera.world_from_camera``.
    ``level``: the camera stands level, phi at rest is not taken from ``rest_pose``. ``near_px``: where the board is in
    the first picture, if several are in view. ``start_s`` is added to the time stamps.
    """

    videos: tuple[Path, ...]
    camera: Camera
    board: Board
    rest_pose: Rest | None = None
    level: bool = False
    near_px: tuple[float, float] | None = None
    start_s: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.start_s) or not all(map(math.isfinite, self.rest_pose or ())):
            what = f"track: start_s {self.start_s} and rest_pose {self.rest_pose} must be finite"
            raise TrackingError(f"{what}; give s, and m, m, rad")

    def identity(self) -> dict[str, Any]:
        """What a record of followed corners depends on."""
        return {
            "videos": [(path.name, path.stat().st_size, path.stat().st_mtime_ns) for path in self.videos],
            "lens": self.camera.lens.to_json(),
            "camera": (self.camera.board_x_in_image, self.camera.mount, str(self.camera.world_from_camera)),
            "board": asdict(self.board),
            "rest": self.rest_pose,
            "near": self.near_px,
        }


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
    in ``Track.record``, for whoever writes out the result to use and then remove. Without it a temporary file.
    ``trace.frame`` counts decoded frames from 0. Sigmas come from the corners' own residuals; they do not include a
    wrong lens, rest pose, turn or tip offset. Memory does not grow with the video but for the trace itself. Raises
    TrackingError for a bad file, a lens for another picture size,
    no rest, or no board.
    """
    files = [video] if isinstance(video, str | os.PathLike) else list(video)
    with Timeline(files) as timeline, tempfile.TemporaryDirectory() as folder:
        work = Task(tuple(timeline.paths), camera, board, **task)
        _check_size(timeline, camera)
        kept = Record(record or Path(folder) / "record", work.identity(), board.shape)
        try:
            report = _follow(timeline, work, kept, progress)
            done = _solved(work, kept, report, timeline)
        except TrackingError:  # going on would end the same
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


def _follow(
    timeline: Timeline, work: Task, record: Record, progress: Callable[[int, int], None] | None
) -> DecodeReport:
    """Follow the board through all frames that are not yet on record."""
    follower = Follower(work.camera, work.board, work.rest_pose, work.near_px)
    before = record.rows(len(record) - 1, len(record))
    after_s = float(before["time_s"][0]) if len(before) else -math.inf
    if ends := record.ends():
        follower.take_over(*ends)
    corrupt, last = 0, None
    pictures = ahead(timeline.frames(after_s))
    try:
        for frame in pictures:
            sample = frame.luma[_STRIDE // 2 :: _STRIDE, :: _STRIDE // 2].copy()
            repeats = last is not None and _same(sample, last)
            record.add(frame, frame.corrupt - corrupt, repeats, follower.look(frame.luma, frame.time_s))
            corrupt, last = frame.corrupt, sample
            if progress:
                progress(len(record), max(timeline.expected, len(record)))
    finally:
        pictures.close()  # stops the decoder before its file is closed
        record.flush()
    if not len(record):
        what = f"{timeline.paths[0]}: not one of {timeline.expected} frames could be decoded"
        raise TrackingError(f"{what}; copy the file again")
    return _account(record, timeline, timeline.corrupt - corrupt)


def _same(one: Picture, other: Picture) -> bool:
    return bool(np.count_nonzero(one == other) >= _SAME * one.size)


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


def _solved(work: Task, record: Record, report: DecodeReport, timeline: Timeline) -> Track:
    """Find the video's constants, then every frame's pose."""
    lens, board = work.camera.lens, work.board
    reasons: Counter[str] = Counter()
    kept: list[tuple[NDArray[Any], ...]] = []
    for start, rows in record.chunks():
        views, where, repeats = views_of(record, lens, start, rows)
        size = np.sqrt(views.rays.var(axis=1).sum(axis=1))
        middle = np.column_stack((views.rays.mean(axis=1) * lens.fx, size * lens.fx))
        kept.append((start + where, middle, views.widths, views.sweep, views.key, views.jump_px))
        reasons[REPEATED] += int(repeats.sum())
        for text in rows["reason"][~rows["seen"] & ~repeats]:
            reasons[text.decode()] += 1
    seen, middle, *others = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    if not len(seen):
        commonest = next((text for text, _ in reasons.most_common() if text != NOT_DUE), "nothing seen")
        what = f"{timeline.paths[0]}: no board of {board} in any of {len(record)} frames"
        raise TrackingError(f"{what} ({commonest}); check light, focus, the board's squares and the camera's place")
    frames = Frames(middle[:, :2], *others)
    exposure_s = timeline.telemetry.exposure_s or exposure_by_smear(frames, timeline.period_s)
    features = np.column_stack((middle, frames.sweep)).astype(np.float32)
    chosen = np.unique(np.concatenate((np.arange(min(REST_FRAMES, len(seen))), _spread(features))))
    views = _pick(record, work, seen[chosen])
    settled = settle(work.camera, board, work.rest_pose, views, level=work.level, exposure_s=exposure_s)
    shared = np.zeros(len(record))
    shared[seen] = shared_px(frames, codec_lag_px(frames, timeline.period_s))
    return _fit_all(work, record, report, settled, shared, exposure_s, reasons, timeline.telemetry)


def _spread(features: NDArray[np.float32]) -> NDArray[np.intp]:
    """Return frames that cover the range of each feature (f, m) evenly; most frames of a long video are alike."""
    chosen = []
    for values in features.T:
        order = np.argsort(values)
        wanted = np.linspace(values[order[0]], values[order[-1]], _SPREAD)
        chosen.append(order[np.minimum(np.searchsorted(values[order], wanted), len(order) - 1)])
    return np.unique(np.concatenate(chosen))


def _pick(record: Record, work: Task, frames: NDArray[np.int64]) -> Views:
    """Return the views of some frames of the record."""
    parts = []
    for start, rows in record.chunks():
        if np.any((frames >= start) & (frames < start + len(rows))):
            views, where, _ = views_of(record, work.camera.lens, start, rows)
            parts.append(views.pick(np.flatnonzero(np.isin(start + where, frames))))
    return Views(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in Views.__annotations__})


def _fit_all(
    work: Task,
    record: Record,
    report: DecodeReport,
    settled: Settled,
    shared_px: Floats,
    exposure_s: float,
    reasons: Counter[str],
    telemetry: Telemetry,
) -> Track:
    n, plane, line_s = len(record), settled.plane, settled.camera.line_s or 0.0
    points_m = apply(settled.camera.tip_from_board, work.board.corner_points_m())
    state, sigma = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    time_s, rms_px, corners = np.empty(n), np.full(n, np.nan), np.zeros(n, np.int64)
    total, square, count = np.zeros((3, len(points_m), 2))
    row, guess = work.camera.lens.height / 2, None
    for start, rows in record.chunks():
        views, where, _ = views_of(record, work.camera.lens, start, rows)
        passed = np.full(len(rows), np.nan)
        if len(where):
            guess = guess if guess is not None else free_start(views, settled.camera, work.board)
            at = start + where
            begin = np.tile(guess, (len(where), 1))
            fits = plane.fit_rays(views.at_once(line_s, exposure_s), views.px_per_ray, points_m, begin, views.used)
            number = fits.used.sum(axis=1)
            good = (fits.rms_px <= LARGEST_RESIDUAL * views.pitch_px) & (number >= FEWEST_CORNERS)
            reasons[NO_FIT] += int((~good).sum())
            state[at[good]] = fits.vector[good]
            spread = with_shared(fits, shared_px[at])
            sigma[at[good]] = np.sqrt(np.diagonal(spread[good], axis1=1, axis2=2))
            rms_px[at[good]], corners[at[good]] = fits.rms_px[good], number[good]
            guess = fits.vector[good][-1] if good.any() else guess
            counts = (fits.used & good[:, None])[..., None]
            total += np.where(counts, fits.residual_px, 0).sum(axis=0)
            square += np.where(counts, fits.residual_px**2, 0).sum(axis=0)
            count += counts.sum(axis=0)
            passed[where] = views.middle
        for k in range(len(rows)):  # a frame without the board is dated by where it was last
            row = passed[k] if np.isfinite(passed[k]) else row
            passed[k] = row
        time_s[start : start + len(rows)] = work.start_s + rows["time_s"] + line_s * passed
    mean = total / np.maximum(count, 1)
    return Track(
        trace=_trace(time_s, state, sigma),
        rms_px=rms_px,
        corners=corners,
        decode=report,
        camera=settled.camera,
        board=work.board,
        invalid=MappingProxyType(dict(+reasons)),
        rest_frames=settled.rest_frames,
        turn_sigma_rad=settled.turn_sigma_rad,
        line_sigma_s=settled.line_sigma_s,
        residual_px=mean,
        spread_px=np.sqrt(np.maximum(square / np.maximum(count, 1) - mean**2, 0)),
        telemetry=telemetry,
        exposure_s=exposure_s,
        lag_px=float(shared_px.max()),
    )


def _trace(time_s: Floats, state: Floats, sigma: Floats) -> TipTrace:
    x, z, phi = state.T
    sigma_x, sigma_z, sigma_phi = sigma.T
    return TipTrace(time_s, x, z, phi, sigma_x, sigma_z, sigma_phi, np.isfinite(x), np.arange(len(x)))
