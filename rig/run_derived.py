"""Writes derived recordings, a tracked tip or a prediction: own files on the parent's clock that name its SHA-256."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.rig.errors import RigError
from straw.rig.run_file import RunFile
from straw.rig.schema import encode, schema_of
from straw.tracking.trace import TipTrace

Floats = NDArray[np.float64]


def write_tip(
    path: str | Path,
    trace: TipTrace,
    metadata: Mapping[str, str],
    parent_sha256: str,
    zero_time_ns: int,
) -> None:
    """Write a tracked tip as its own recording on the absolute clock: ``trace.time_s`` counts from ``zero_time_ns``.

    ``metadata`` is the parent's ``straw.run`` (``Run.metadata``) plus what the tracker adds. In derived
    files log_time equals publish_time, so that viewers, which sort by log_time, lay them over the raw run.
    """
    write_columns(path, metadata, parent_sha256, zero_time_ns, {"/tip/state": tip_columns(trace)})


def write_prediction(
    path: str | Path,
    model_name: str,
    metadata: Mapping[str, str],
    parent_sha256: str,
    zero_time_ns: int,
    *,
    tip: TipTrace | None = None,
    pressure_time_s: Floats | None = None,
    pressure_pa: Floats | None = None,
) -> None:
    """Write a model's prediction of tip and pressure, as ``/sim/<model_name>/...``; otherwise as ``write_tip``.

    ``parent_sha256`` is empty for a prediction of a protocol that was not run.
    """
    columns: dict[str, dict[str, Any]] = {}
    if tip is not None:
        columns[f"/sim/{model_name}/tip/state"] = tip_columns(tip)
    if pressure_time_s is not None and pressure_pa is not None:
        columns[f"/sim/{model_name}/pressure"] = {
            "time_s": pressure_time_s,
            "pressure_pa": pressure_pa,
            "sigma_pa": np.full(len(pressure_pa), np.nan),
        }
    write_columns(path, {**metadata, "model": model_name}, parent_sha256, zero_time_ns, columns)


def tip_columns(trace: TipTrace) -> dict[str, Any]:
    """The trace's arrays by the names of ``/tip/state``, and ``time_s`` before them."""
    return {name: getattr(trace, name) for name in ("time_s", *(field for field, *_ in schema_of("/tip/state").fields))}


def write_columns(
    path: str | Path,
    metadata: Mapping[str, str],
    parent_sha256: str,
    zero_time_ns: int,
    topics: Mapping[str, Mapping[str, Any]],
) -> None:
    """Write columns (n,) of several topics, each with its ``time_s`` from ``zero_time_ns`` first, in order of time."""
    messages: list[tuple[int, str, bytes]] = []
    for topic, columns in topics.items():
        lists = {name: np.asarray(column).tolist() for name, column in columns.items()}
        for time_s, *values in zip(*lists.values(), strict=True):
            happened_ns = zero_time_ns + round(time_s * 1e9)
            fields = dict(zip(list(lists)[1:], values, strict=True))
            messages.append((happened_ns, topic, encode(topic, happened_ns, fields)))
    if not messages:
        raise RigError(f"recording {path} would be empty; there is nothing to write")
    messages.sort(key=lambda message: message[0])
    own = {"zero_time_ns": str(zero_time_ns), "parent_sha256": parent_sha256}
    file = RunFile(path, {**metadata, **{key: value for key, value in own.items() if value}})
    try:
        for happened_ns, topic, data in messages:
            file.add(topic, happened_ns, data, log_time_ns=happened_ns)
        file.finish()
    except BaseException:
        file.discard()
        raise
