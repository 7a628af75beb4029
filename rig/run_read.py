"""Reads recordings, protobuf or JSON, whole or damaged, into a Run; every failure is a RigError."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.rig.errors import RigError
from straw.rig.manifest import read_manifest
from straw.rig.mcap_scan import read_bytes, scan
from straw.rig.run import CELLS, Event, Predicted, PressureLog, Run
from straw.rig.run_decode import EXTRA, Row, decode
from straw.rig.schema import PREDICTION, schema_of
from straw.tracking.trace import TipTrace

FAR_S = 3600.0  # a zero further than this from the first message is reported


def read_run(path: str | Path) -> Run:
    """Read one recording. Of a damaged file the intact part is read, and ``Run.lost`` states what is missing.

    RigError, one line, when the file cannot be opened, is no MCAP, or holds no message of the contract.
    """
    path = Path(path)
    data = read_bytes(path)
    found = scan(data, str(path))
    lost = found.lost
    rows = decode(found)
    sha256 = hashlib.sha256(data).hexdigest()
    unsure = ""
    try:
        if read_manifest(path).get(path.name, sha256) != sha256:
            lost.append("its SHA-256 is not the one in its manifest: it was changed after it was recorded")
    except RigError as error:  # not a fault of the run
        unsure = f"{error}; whether the run is as recorded cannot be told"
    damage = tuple(lost)
    lost += [unsure] if unsure else []
    if not rows:
        why = f": {lost[0]}" if lost else "; it is a recording of something else"
        raise RigError(f"recording {path} holds no message of a straw run{why}")

    said = dict(found.metadata.get("straw.run", {}))
    if not said:
        lost.append("the metadata record straw.run is missing: specimen, initial state and zero time are assumed")
    metadata = {**found.metadata.get("straw.stop", {}), **said}
    first_ns = min(row[0] for topic in rows.values() for row in topic)
    zero_ns = _whole(metadata, "zero_time_ns", first_ns, "the first message", lost)
    if abs(first_ns - zero_ns) * 1e-9 > FAR_S:
        lost.append(f"zero_time_ns is {(first_ns - zero_ns) * 1e-9:.0f} s from the first message: check the clocks")
    lost += [f"metadata {key} is missing" for key in ("run_id", "specimen") if said and key not in said]
    cells = _whole(metadata, "cells", CELLS, str(CELLS), lost)
    channel = _whole(metadata, "channel", 1, "1", None)

    def pressure(topic: str, held: bool = False) -> PressureLog | None:
        return _pressure(topic, rows.get(topic, []), zero_ns, channel, held, lost)

    def tip(topic: str) -> TipTrace | None:
        return _tip(topic, rows.get(topic, []), zero_ns, lost)

    models = sorted({match[1] for topic in rows if (match := PREDICTION.fullmatch(topic))})
    return Run(
        path=path,
        sha256=sha256,
        run_id=metadata.get("run_id", path.stem),
        specimen=metadata.get("specimen", ""),
        initial_deployed=_deployed(metadata, cells, lost),
        cycle=_whole(metadata, "cycle", 0, "0", lost),
        cells=cells,
        zero_time_ns=zero_ns,
        metadata=metadata,
        attachments=found.attachments,
        command=pressure("/pressure/command", held=True),
        pressure=pressure("/pressure/measured"),
        tip=tip("/tip/state"),
        predictions={m: Predicted(tip(f"/sim/{m}/tip/state"), pressure(f"/sim/{m}/pressure")) for m in models},
        events=tuple(Event((ns - zero_ns) * 1e-9, *values) for ns, values in sorted(rows.get("/events", []))),
        lost=tuple(lost),
        damage=damage,
        software=found.metadata.get("straw.software.recorded") or found.metadata.get("straw.software", {}),
    )


def _in_time(
    topic: str, rows: list[Row], zero_ns: int, lost: list[str]
) -> tuple[NDArray[np.float64], list[NDArray[Any]]]:
    """Columns sorted by time, keeping the first of equal times; changes are noted in ``lost``."""
    # Seconds first, order after: far from zero two nanoseconds can become one number of seconds.
    time_ns = np.array([row[0] for row in rows], dtype=np.int64)
    time_s: NDArray[np.float64] = (time_ns - zero_ns).astype(np.float64) * 1e-9
    columns = [np.array(column) for column in zip(*(row[1] for row in rows), strict=True)]
    if np.any(np.diff(time_s) <= 0):
        order = np.argsort(time_s, kind="stable")
        if np.any(np.diff(time_s) < 0):
            lost.append(f"{topic} was not in order of time and was sorted")
        keep = order[np.concatenate([[True], np.diff(time_s[order]) > 0])]
        if len(keep) < len(order):
            lost.append(f"{len(order) - len(keep)} messages on {topic} repeat a time and were left out")
        time_s, columns = time_s[keep], [column[keep] for column in columns]
    return time_s, columns


def _pressure(
    topic: str, rows: list[Row], zero_ns: int, channel: int, held: bool, lost: list[str]
) -> PressureLog | None:
    names = [name for name, *_ in schema_of(topic).fields if name not in EXTRA]
    at = names.index("channel")
    rows = [row for row in rows if (row[1][at] or 1) == channel] or rows  # protobuf does not distinguish 0 from absent
    if not rows:
        return None
    time_s, columns = _in_time(topic, rows, zero_ns, lost)
    value = dict(zip(names, columns, strict=True))
    pressure_pa = value["pressure_pa"].astype(np.float64)
    sigma_pa = np.asarray(value.get("sigma_pa", np.full(len(time_s), np.nan)), dtype=np.float64)
    good = np.isfinite(pressure_pa)
    if not np.all(good):
        lost.append(f"{int(np.sum(~good))} pressures on {topic} are not numbers and were left out")
    if not np.any(good):
        return None
    return PressureLog(time_s[good], pressure_pa[good], _sigma(sigma_pa[good]), held)


def _tip(topic: str, rows: list[Row], zero_ns: int, lost: list[str]) -> TipTrace | None:
    if not rows:
        return None
    time_s, (x_m, z_m, phi_rad, sigma_x_m, sigma_z_m, sigma_phi_rad, valid, frame) = _in_time(
        topic, rows, zero_ns, lost
    )
    pose = np.array([x_m, z_m, phi_rad], dtype=np.float64)
    valid = valid.astype(np.bool_) & np.all(np.isfinite(pose), axis=0)
    pose[:, ~valid] = np.nan  # a sample that says it is invalid must not be usable by mistake
    sigma = [_sigma(column.astype(np.float64)) for column in (sigma_x_m, sigma_z_m, sigma_phi_rad)]
    return TipTrace(time_s, pose[0], pose[1], pose[2], sigma[0], sigma[1], sigma[2], valid, frame.astype(np.int64))


def _sigma(sigma: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(sigma > 0.0, sigma, np.nan)  # no uncertainty is exactly 0: it is how protobuf writes "not given"


def _whole(metadata: dict[str, str], key: str, otherwise: int, assumed: str, lost: list[str] | None) -> int:
    try:
        value = int(metadata[key])
        if 0 <= value < 2**63:
            return value
        problem = f"metadata {key} = {metadata[key]!r} is out of range"
    except KeyError:
        problem = f"metadata {key} is missing"
    except ValueError:
        problem = f"metadata {key} = {metadata[key]!r} is not a whole number"
    if lost is not None:
        lost.append(f"{problem}: {assumed} is assumed")
    return otherwise


def _deployed(metadata: dict[str, str], cells: int, lost: list[str]) -> tuple[int, ...] | None:
    text = metadata.get("initial_deployed")
    if text is None:
        lost.append("metadata initial_deployed is missing: the initial state is unknown")
        return None
    try:
        deployed = tuple(sorted({int(cell) for cell in text.split(",") if cell.strip()}))
    except ValueError:
        deployed = (0,)
    if any(not 1 <= cell <= cells for cell in deployed):
        lost.append(
            f"metadata initial_deployed = {text!r} does not list cells of 1..{cells}: the initial state is unknown"
        )
        return None
    return deployed
