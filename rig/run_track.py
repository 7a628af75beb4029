"""Writes a tracked tip as its own recording: the tip, how good each frame is, the corners, the camera."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.rig import foxglove
from straw.rig.run_derived import tip_columns
from straw.rig.run_file import RunFile
from straw.rig.schema import Schema, descriptor_set, encode, message_class
from straw.tracking.trace import TipTrace

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

ANNOTATIONS, CALIBRATION, QUALITY = "/camera/annotations", "/camera/calibration", "/tip/quality"
GRADE = Schema(
    "straw.TipQuality",
    (
        ("rms_px", "double", "px"),
        ("corners", "int32", ""),
        ("contrast", "double", "grey levels"),
        ("blur_px", "double", "px"),
        ("reason", "string", ""),
    ),
)


def write_track(
    path: str | Path,
    trace: TipTrace,
    quality: Mapping[str, Sequence[object]],
    corners: Iterable[tuple[Floats, Flags] | None],
    camera: tuple[tuple[int, int], str, Sequence[float], Floats],
    metadata: Mapping[str, str],
    attachments: Mapping[str, bytes],
    parent_sha256: str,
    zero_time_ns: int,
) -> None:
    """Write a track on the absolute clock: ``trace.time_s`` counts from ``zero_time_ns``.

    ``quality``: columns of ``/tip/quality`` (see ``GRADE``), one value a frame. ``corners``: a frame's corners (n, 2)
    px and which were used (n,), or None; consumed one by one. ``camera``: picture size, distortion model,
    coefficients, matrix (3, 3).
    log_time equals publish_time, so that viewers, which sort by log_time, lay it over the raw run. Whole or not at all.
    """
    own = {"zero_time_ns": str(zero_time_ns), "parent_sha256": parent_sha256}
    file = RunFile(path, {**metadata, **{key: value for key, value in own.items() if value}}, attachments)
    columns = tip_columns(trace)
    times_s = columns.pop("time_s")
    tips = zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True)
    grades = zip(*(np.asarray(quality[name]).tolist() for name, *_ in GRADE.fields), strict=True)
    grade_class: Any = message_class(GRADE.name, descriptor_set(GRADE))
    try:
        for topic, name in ((CALIBRATION, foxglove.CALIBRATION), (ANNOTATIONS, foxglove.ANNOTATIONS)):
            file.declare(topic, name, foxglove.descriptors())
        file.declare(QUALITY, GRADE.name, descriptor_set(GRADE))
        first_ns = zero_time_ns + round(float(times_s[0]) * 1e9)
        file.add(CALIBRATION, first_ns, foxglove.calibration(first_ns, *camera), log_time_ns=first_ns)
        for time_s, tip, grade, seen in zip(times_s.tolist(), tips, grades, corners, strict=True):
            now_ns = zero_time_ns + round(time_s * 1e9)
            messages = {
                "/tip/state": encode("/tip/state", now_ns, dict(zip(columns, tip, strict=True))),
                QUALITY: grade_class(
                    **{name: value for (name, *_), value in zip(GRADE.fields, grade, strict=True)}
                ).SerializeToString(),
            }
            if seen is not None:
                messages[ANNOTATIONS] = foxglove.dots(now_ns, *seen)
            for topic, data in messages.items():
                file.add(topic, now_ns, data, log_time_ns=now_ns)
        file.finish()
    except BaseException:
        file.discard()
        raise
