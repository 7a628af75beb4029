"""Corrections by hand: frames rejected, poses set, points to follow; each with its reason."""

from __future__ import annotations

import dataclasses
import math
import os
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from straw.tracking.errors import TrackingError
from straw.tracking.fields import Fields, reason
from straw.tracking.task import Track

BY_HAND = "by hand: "
_KINDS = {
    "invalid": {"frames", "reason"},
    "pose": {"frame", "x_mm", "z_mm", "phi_deg", "sigma_mm", "sigma_deg", "reason"},
    "point": {"frames", "at", "reason"},
}


@dataclass(frozen=True)
class Edit:
    """One change: ``kind`` invalid, pose or point; ``first`` to ``last`` frame; ``reason`` in words.

    ``pose`` (x_m, z_m, phi_rad) and its ``sigma`` of a pose set; ``at_px`` (u, v) of a point in the first frame.
    """

    kind: str
    first: int
    last: int
    reason: str
    pose: tuple[float, float, float] | None = None
    sigma: tuple[float, float, float] | None = None
    at_px: tuple[float, float] | None = None


def load_edits(path: str | os.PathLike[str]) -> list[Edit]:
    """Read a MEND.toml: tables [[invalid]], [[pose]] and [[point]]; TrackingError, one line, when it is malformed."""
    try:
        document = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise TrackingError(f"{path}: cannot be read ({reason(error)}); check the name") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise TrackingError(f"{path}: is not TOML ({error}); straw track --step writes one") from None
    edits = list(_edits(document, str(path)))
    if not edits:
        raise TrackingError(f"{path}: contains no correction; write [[invalid]], [[pose]] or [[point]]")
    return edits


def _edits(document: dict[str, Any], where: str) -> Iterator[Edit]:
    for kind, tables in document.items():
        if kind not in _KINDS or not isinstance(tables, list):
            raise TrackingError(f"{where}: unknown change '{kind}'; write [[{']], [['.join(_KINDS)}]]")
        for number, table in enumerate(tables, 1):
            fields = Fields(table, f"{where}: [[{kind}]] {number}")
            if strange := sorted(set(fields.data) - _KINDS[kind]):
                known = ", ".join(sorted(_KINDS[kind]))
                raise TrackingError(f"{fields.where}: '{strange[0]}' is not known; it takes {known}")
            yield _edit(kind, fields)


def _edit(kind: str, fields: Fields) -> Edit:
    why = fields.text("reason").strip() or fields.wrong("reason", "words that say why")
    if kind == "pose":
        frame = fields.integer("frame")
        x_mm, z_mm, phi_deg, sigma_mm, sigma_deg = (
            fields.number(name) for name in ("x_mm", "z_mm", "phi_deg", "sigma_mm", "sigma_deg")
        )
        for name, value in (("sigma_mm", sigma_mm), ("sigma_deg", sigma_deg)):
            if value <= 0:
                fields.wrong(name, "how well it is known, more than 0")
        pose = x_mm * 1e-3, z_mm * 1e-3, math.radians(phi_deg)
        return Edit(kind, frame, frame, why, pose, (sigma_mm * 1e-3, sigma_mm * 1e-3, math.radians(sigma_deg)))
    text = str(fields.data.get("frames", ""))
    first, _, last = text.partition("-")
    if not (first.strip().isdecimal() and (last.strip() or first.strip()).isdecimal()):
        fields.wrong("frames", 'the first and the last, as "120-134"')
    at_px = None
    if kind == "point":
        u, v = fields.numbers("at", 2)
        at_px = u, v
    return Edit(kind, int(first), int(last or first), why, at_px=at_px)


def check_frames(edits: Sequence[Edit], frames: int) -> None:
    """Raise TrackingError for frames that the video does not have."""
    for edit in edits:
        if not 0 <= edit.first <= edit.last < frames:
            shown = f"{edit.first}-{edit.last}"
            raise TrackingError(f"mend: [[{edit.kind}]] names frames {shown}, the video has 0 to {frames - 1}")


def mended(track: Track, edits: Sequence[Edit]) -> Track:
    """Return the track with poses rejected and set by hand; ``said`` holds the reason, also where a pose is valid."""
    check_frames(edits, len(track.trace))
    trace, said = track.trace, track.said.copy()
    names = ("x_m", "z_m", "phi_rad", "sigma_x_m", "sigma_z_m", "sigma_phi_rad")
    columns = {name: getattr(trace, name).copy() for name in names}
    rms_px, corners = track.rms_px.copy(), track.corners.copy()
    for edit in edits:
        if edit.kind == "point":
            continue
        which = slice(edit.first, edit.last + 1)
        values = (*edit.pose, *edit.sigma) if edit.pose and edit.sigma else (np.nan,) * 6
        for name, value in zip(names, values, strict=True):
            columns[name][which] = value
        rms_px[which], corners[which], said[which] = np.nan, 0, BY_HAND + edit.reason
    trace = dataclasses.replace(trace, **columns, valid=np.isfinite(columns["x_m"]))
    return dataclasses.replace(track, trace=trace, rms_px=rms_px, corners=corners, said=said)
