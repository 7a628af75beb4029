"""From a video to the recording of its track, with quality, corners, camera and warnings."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.output import check_new
from straw.replay.progress import Progress, progress_bar, say
from straw.rig.camera_clock import CameraClock
from straw.rig.manifest import sha256_of
from straw.rig.run import Run
from straw.rig.run_track import write_track
from straw.tracking.board import Board
from straw.tracking.by_point import with_point
from straw.tracking.camera import Camera, camera_json
from straw.tracking.chapters import copies, in_order, siblings
from straw.tracking.follow import Rest
from straw.tracking.mend import Edit, load_edits, mended
from straw.tracking.task import Track
from straw.tracking.track import track

# factor over a free board's residual, and least residual, that indicate a wrong lens or place
_MISFIT, _MISFIT_PX = 3.0, 0.1


def track_to_file(
    videos: Sequence[Path] | Path,
    camera: Camera,
    rest: Rest | None,
    output: Path,
    filmed: Run | None,
    start_s: float,
    *,
    board: Board | None = None,
    clock: CameraClock | None = None,
    mend: Path | None = None,
    calibration: Path | None = None,
    progress: Progress | None = None,
    **task: Any,
) -> Track:
    """Track a video and write the tip on the run's clock; without a run, on the wall clock of now.

    ``mend``: a file of changes by hand (see ``straw.tracking.mend``), which is recorded with the track;
    ``calibration``: the file that ``camera`` was read from, whose name and SHA-256 are recorded, too;
    ``progress``: called with (frames done, frames in all) in place of a bar.
    The track's record is left open for further outputs; an interrupted one stays beside ``output``.
    """
    check_new(output)
    edits = load_edits(mend) if mend else []
    sha256 = sha256_of(calibration) if calibration else ""  # as it was when the camera was read, not hours later
    files = in_order([videos] if isinstance(videos, Path) else videos)
    record = output.with_name(output.name + ".corners")
    _warn_of_files(files)
    with progress_bar(f"track {files[0].name}", "frame") as bar:
        try:
            known: dict[str, Any] = {"rest_pose": rest, "start_s": 0.0 if clock else start_s, "record": record}
            tracked = track(files, camera, board or Board(), progress=progress or bar, **known, **task)
        except KeyboardInterrupt:
            say(f"{files[0].name}: what was tracked is kept in {record}; give the same command again to continue")
            raise
    kept = tracked.record
    assert kept is not None
    try:
        tracked = by_hand(tracked, files, edits, 0.0 if clock else start_s)
        if clock:
            trace = dataclasses.replace(tracked.trace, time_s=clock.host_s(tracked.trace.time_s))
            tracked = dataclasses.replace(tracked, trace=trace)
        metadata = _metadata(tracked, files, filmed)
        metadata["clock"] = str(clock or f"first frame given at {start_s:g} s")
        metadata |= {"calibration": calibration.name, "calibration_sha256": sha256} if calibration else {}
        if not filmed:
            say(f"{files[0].name}: without --run the time of filming is unknown; its recording starts now")
        write_track(
            output,
            tracked.trace,
            quality(tracked),
            corners(tracked),
            lens_of(tracked.camera),
            metadata,
            {"camera.json": camera_json(tracked.camera).encode(), **({"mend.toml": mend.read_bytes()} if mend else {})},
            filmed.sha256 if filmed else "",
            filmed.zero_time_ns if filmed else time.time_ns(),
        )
    except BaseException:
        kept.close()
        raise
    _warn_of_track(tracked, files[0].name)
    return tracked


def _metadata(tracked: Track, files: Sequence[Path], filmed: Run | None) -> dict[str, str]:
    """The run's own metadata, and what the video files say."""
    return {
        **(filmed.metadata if filmed else {"run_id": files[0].stem}),
        "video": ", ".join(path.name for path in files),
        "decode": str(tracked.decode),
        "camera": str(tracked.telemetry),
    }


def _warn_of_files(files: Sequence[Path]) -> None:
    """Warn of chapters that were not named, and of a video named twice."""
    if beside := siblings(files):
        say(f"{files[0].name}: belongs together with {', '.join(path.name for path in beside)}; name all to join them")
    for copy, other in copies(files):
        say(f"{copy.name}: holds the same video as {other.name}, which is tracked twice; is it the right file?")


def _warn_of_track(tracked: Track, name: str) -> None:
    """Warn of what indicates a wrong lens, place or board, and of frames that are not valid."""
    assert tracked.record is not None
    own_px = float(np.median(np.concatenate([rows["rms_px"][rows["seen"]] for _, rows in tracked.record.chunks()])))
    left_px = float(np.nanmedian(tracked.rms_px))
    if left_px > max(_MISFIT * own_px, _MISFIT_PX):
        what = f"corners are {left_px:.2f} px off the plane of motion, but {own_px:.2f} px off a free board's fit"
        say(f"{name}: {what}: check the lens, the rest pose, the board's size and its mount")
    if tracked.never_seen:
        what = f"{tracked.never_seen} corners of a board of {tracked.board} are in no frame"
        say(f"{name}: {what}: are they always covered, or is it a different board?")
    for reason, count in tracked.invalid.items():
        say(f"{name}: {count} {'frame' if count == 1 else 'frames'} without a trustworthy board: {reason}")


def by_hand(tracked: Track, files: Sequence[Path], edits: Sequence[Edit], start_s: float) -> Track:
    """Return the track with corrections by hand: poses first, then points, which fill the frames still invalid."""
    tracked = mended(tracked, edits)
    for edit in edits:
        if edit.kind == "point":
            tracked = with_point(tracked, files, edit, start_s)
    return tracked


def quality(tracked: Track) -> dict[str, Any]:
    """The columns of ``/tip/quality``."""
    assert tracked.record is not None
    kept = [(rows["contrast"], rows["widths"].max(axis=1)) for _, rows in tracked.record.chunks()]
    contrast, blur = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    grades = {"rms_px": tracked.rms_px, "corners": tracked.corners, "contrast": contrast.astype(float)}
    return {**grades, "blur_px": blur.astype(float), "reason": tracked.said}


def corners(tracked: Track) -> Iterator[tuple[NDArray[np.float64], NDArray[np.bool_]] | None]:
    """Each frame's corners and which were used; None where the board was not seen."""
    assert tracked.record is not None
    for _, rows in tracked.record.chunks():
        for row in rows:
            yield (row["grid"].reshape(-1, 2), row["used"].ravel()) if row["seen"] else None


def lens_of(camera: Camera) -> tuple[tuple[int, int], str, Sequence[float], NDArray[np.float64]]:
    """A lens for viewers: picture size, ROS's name of the distortion model, coefficients, matrix."""
    lens = camera.lens
    model = "kannala_brandt" if lens.kind == "fisheye" else "plumb_bob"
    matrix = np.array(((lens.fx, 0, lens.cx), (0, lens.fy, lens.cy), (0, 0, 1.0)))
    return (lens.width, lens.height), model, lens.distortion, matrix


def as_csv(tracked: Track) -> str:
    """The track as a table: SI, one line a frame, empty where not valid."""
    trace = tracked.trace
    names = ("frame", "time_s", "valid", "x_m", "z_m", "phi_rad", "sigma_x_m", "sigma_z_m", "sigma_phi_rad")
    columns = [getattr(trace, name).tolist() for name in names] + [tracked.rms_px.tolist(), tracked.corners.tolist()]
    lines = [",".join((*names, "rms_px", "corners"))]
    for frame, time_s, valid, *rest in zip(*columns, strict=True):
        numbers = ("" if isinstance(value, float) and math.isnan(value) else f"{value:.9g}" for value in rest)
        lines.append(",".join((str(frame), f"{time_s:.9f}", str(int(valid)), *numbers)))
    return "\n".join(lines) + "\n"
