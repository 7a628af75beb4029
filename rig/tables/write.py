"""From a plan to messages, and from messages to a recording, whole or not at all."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from straw.rig.errors import RigError
from straw.rig.manifest import seal, sha256_of
from straw.rig.run_file import RunFile
from straw.rig.schema import encode
from straw.rig.tables.mapping import to_toml
from straw.rig.tables.roles import ROLES, TIP
from straw.rig.tables.understand import Part, Plan

Message = tuple[int, str, dict[str, Any]]
Progress = Callable[[int, int], None]


def messages(plan: Plan) -> list[Message]:
    """All messages of a plan as (ns since 1970, topic, fields), in order of time."""
    found = [message for part in plan.parts for message in _of(plan, part)]
    found.sort(key=lambda message: message[0])
    if found and not 0 < found[0][0] <= found[-1][0] < 2**63:
        raise RigError("some times are before 1970 or beyond 2262; check the unit of time and --start")
    return found


def _of(plan: Plan, part: Part) -> Iterator[Message]:
    ns = plan.ns(part).tolist()
    for signal in part.signals:
        if signal.role in ("pressure", "command"):
            topic = ROLES[signal.role].topic
            more = {}
            if signal.role == "pressure" and signal is part.signal("pressure"):
                more = {ROLES[r].field: found.values for r in ("sigma_pressure", "flow") if (found := part.signal(r))}
                more.setdefault("sigma_pa", np.full(len(ns), np.nan))
            columns = {"pressure_pa": signal.values, **more}
            for k in np.flatnonzero(np.isfinite(signal.values)).tolist():
                fields = {name: float(column[k]) for name, column in columns.items()}
                yield ns[k], topic, {**fields, "channel": signal.channel}
        elif signal.role == "event":
            before = ""
            for k, text in enumerate(signal.text):
                if text and text != before:
                    yield ns[k], "/events", {"kind": "note", "text": text}
                before = text
    if part.signal("x"):
        yield from _tip(part, ns)


def _tip(part: Part, ns: list[int]) -> Iterator[Message]:
    """Pose, its sigmas (NaN where unknown), whether it is valid, and which frame (-1 where unknown)."""
    values = {role: np.array(part.signal(role).values) for role in TIP if part.signal(role)}  # type: ignore[union-attr]
    if part.said.tip_offset_mm:
        values["x"] = values["x"] - part.said.tip_offset_mm * 1e-3 * np.sin(values["phi"])
        values["z"] = values["z"] - part.said.tip_offset_mm * 1e-3 * np.cos(values["phi"])
    good = np.all([np.isfinite(column) for column in values.values()], axis=0)
    if valid := part.signal("valid"):
        good &= np.nan_to_num(valid.values) != 0.0
    if likelihood := part.signal("likelihood"):
        good &= np.nan_to_num(likelihood.values) >= part.said.least_likelihood
    fields = {ROLES[role].field: column for role, column in values.items()}
    for role in ("sigma_x", "sigma_z", "sigma_phi"):
        fields[ROLES[role].field] = found.values if (found := part.signal(role)) else np.full(len(ns), np.nan)
    frame = part.signal("frame")
    frames = np.full(len(ns), -1) if frame is None else np.nan_to_num(frame.values, nan=-1.0).astype(np.int64)
    for k, happened_ns in enumerate(ns):
        pose = {name: float(column[k]) for name, column in fields.items()}
        yield happened_ns, "/tip/state", {**pose, "valid": bool(good[k]), "frame": int(frames[k])}


def write(plan: Plan, output: Path, progress: Progress | None = None) -> int:
    """Write a plan as a recording and seal it; how many messages. log_time is when it happened, as no table says more.

    The mapping goes along as an attachment, ``import.toml``; ``imported_from`` and ``imported_sha256`` name the tables.
    """
    found = messages(plan)
    if not found:
        raise RigError(f"recording {output} would be empty; there is nothing to write")
    encoded = []
    for k, (ns, topic, fields) in enumerate(found):
        encoded.append((ns, topic, encode(topic, ns, fields)))
        if progress and k % 5000 == 0:
            progress(k, len(found))
    file = RunFile(output, metadata(plan, output), {"import.toml": to_toml(plan.mapping).encode()})
    try:
        for ns, topic, data in encoded:
            file.add(topic, ns, data, log_time_ns=ns)
        file.finish()
    except BaseException:
        file.discard()
        raise
    seal(output)
    if progress:
        progress(len(found), len(found))
    return len(found)


def metadata(plan: Plan, output: Path) -> dict[str, str]:
    """The metadata of straw.run."""
    tables = [part.table for part in plan.parts]
    readers = [table.reader for table in tables if table.reader]
    notes = [f"{part.table.name}: {note}" for part in plan.parts for note in part.notes]
    return {
        "run_id": output.name.removesuffix(".mcap"),
        "specimen": "",
        **plan.mapping.metadata,
        "zero_time_ns": str(plan.zero_ns),
        "imported_from": ", ".join(table.name for table in tables),
        "imported_sha256": ", ".join(sha256_of(table.path) for table in tables),
        **({"imported_by": ", ".join(dict.fromkeys(readers))} if any(readers) else {}),
        **({"import_notes": "; ".join(notes)} if notes else {}),
    }
