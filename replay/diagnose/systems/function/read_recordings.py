"""Tables of readings as recordings of a user's system, with the samples that are held out."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.systems.function.model import Model, Signal
from straw.replay.diagnose.systems.function.noise import noise_of, rate
from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.spikes import spikes
from straw.replay.diagnose.systems.function.table import column, read_table
from straw.replay.errors import ReplayError

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: Least number of readings of a recording.
SHORTEST = 4
#: Parts of a single recording without a hold-out of its own, of which every third is held out.
PARTS = 12


def read_recordings(model: Model, paths: Sequence[Path], hold_out: Sequence[str] = ()) -> list[Recorded]:
    """Recordings from files, by the system's ``read`` or a table's columns; ReplayError for bad input."""
    tables: dict[str, tuple[str, Mapping[str, Any]]] = {}
    if not paths:
        raise ReplayError("no recordings; give at least one file")
    for path in paths:
        for name, table in _tables(model, Path(path)).items():
            if name in tables:
                raise ReplayError(f"{path}: recording {name} is there twice; give each once")
            tables[name] = str(path), table
    if not tables:
        raise ReplayError(f"{model.path}: read gives no recording of {paths[0]}; give one, or another file")
    return recordings_of(model, tables, hold_out)


def recordings_of(
    model: Model, tables: Mapping[str, tuple[str, Mapping[str, Any]]], hold_out: Sequence[str] = ()
) -> list[Recorded]:
    """Recordings of tables by name, each with its file; ReplayError for bad input."""
    out = [_recorded(model, name, path, table) for name, (path, table) in tables.items()]
    return _held_out(model, out, hold_out, {name: table for name, (_, table) in tables.items()})


def _tables(model: Model, path: Path) -> dict[str, Mapping[str, Any]]:
    read = model.get("read")
    if not path.exists():
        raise ReplayError(f"{path}: no such file")
    if read is None:
        return {path.stem: read_table(path, model.get("columns"))}
    try:
        found = read(path)
    except ReplayError:
        raise
    except Exception as problem:  # it is the user's code
        raise ReplayError(f"{model.path}: read({path.name}) raised {type(problem).__name__}: {problem}") from problem
    if not isinstance(found, Mapping):
        raise ReplayError(f"{model.path}: read must return a dict of columns, or of such dicts by recording")
    if found and all(isinstance(table, Mapping) for table in found.values()):
        return dict(found)
    return {path.stem: found}


def _recorded(model: Model, name: str, path: str, table: Mapping[str, Any]) -> Recorded:
    if not table:
        raise ReplayError(f"{path}: {name}: has no columns; leave it out, or mend read in {model.path}")
    for heading, values in table.items():
        if np.ndim(values) > 1:
            raise ReplayError(f"{path}: {name}: {heading} has shape {np.shape(values)}; expected (n,)")
    length = max(np.size(v) for v in table.values())

    def one(signal: Signal, kind: str) -> Floats:
        values = column(path, table, signal.column, f"{kind} {signal.name}", signal.unit)
        if values.size not in (1, length):
            raise ReplayError(f"{path}: {name}: {signal.column} has {values.size} readings, others {length}")
        return np.broadcast_to(values, (length,)).astype(np.float64)

    if isinstance(model.time, str):
        time = column(path, table, model.time, "time")
        if time.size != length:
            raise ReplayError(f"{path}: {name}: {model.time} has {time.size} readings, others {length}")
    else:
        time = np.arange(length) / float(model.time)
    inputs = np.array([one(s, "input") for s in model.inputs]).reshape(len(model.inputs), length)
    seen = np.array([one(s, "channel") for s in model.channels])
    off = np.array([np.zeros(length, bool) if model.get("keep_spikes") else spikes(row) for row in seen])
    seen = np.where(off, np.nan, seen)
    good = np.isfinite(time) & np.isfinite(seen).any(axis=0)
    if np.count_nonzero(good) < SHORTEST:
        raise ReplayError(f"{path}: {name}: {np.count_nonzero(good)} readings of at least {SHORTEST}; leave it out")
    late = np.flatnonzero(np.diff(time[good]) <= 0)
    if len(late):
        row = np.flatnonzero(good)[late[0] + 1]
        raise ReplayError(
            f"{path}: {name}: time stands or runs back at reading {row + 1} ({time[row]:g}); sort it, or split it there"
        )
    keep = np.flatnonzero(good)
    rows = slice(keep[0], keep[-1] + 1)
    rows_finite = np.arange(rows.start, rows.stop)[np.isfinite(time[rows])]
    time, seen = time[rows_finite], seen[:, rows_finite]
    filled = np.array(
        [_filled(model, path, time, row[rows_finite], s) for row, s in zip(inputs, model.inputs, strict=True)]
    )
    filled = filled.reshape(len(model.inputs), len(time))
    rates = np.array([rate(time, row) for row in filled]).reshape(filled.shape)
    noise = np.array([s.noise or noise_of(row) for s, row in zip(model.channels, seen, strict=True)])
    time = time - time[0]
    fitted = np.isfinite(seen).any(axis=0) & (time >= float(model.get("skip_s", 0.0)))
    said = {f"the mean of {model.named(s.name)}": float(np.mean(r)) for s, r in zip(model.inputs, filled, strict=True)}
    inputs, skip_s = np.concatenate([filled, rates]), float(model.get("skip_s", 0.0))
    many = tuple(int(k) for k in off.sum(axis=1))
    return Recorded(name, time, seen, inputs, noise, fitted, fitted.copy(), said, skip_s, left_out=many)


def _filled(model: Model, path: str, time: Floats, values: Floats, signal: Signal) -> Floats:
    good = np.isfinite(values)
    if not good.any():
        raise ReplayError(f"{path}: input {signal.name} ({signal.column}) has no number at all")
    return np.asarray(np.interp(time, time[good], values[good]))


def _asked_to_hold(model: Model, one: Recorded, table: Mapping[str, Any]) -> Flags:
    """The file's hold_out of a recording, (n,); ReplayError where it raises or has another length."""
    where = f"{model.path}: hold_out({one.name!r}, t, table)"
    try:
        held = np.asarray(model.get("hold_out")(one.name, one.time_s, table), dtype=bool)
    except Exception as problem:  # it is the user's code
        raise ReplayError(f"{where} raised {type(problem).__name__}: {problem}") from problem
    if held.shape not in ((), one.time_s.shape):
        raise ReplayError(
            f"{where} gives shape {held.shape}; give True or False, or one for each of t {one.time_s.shape}"
        )
    return held


def _held_out(
    model: Model, recordings: list[Recorded], patterns: Sequence[str], tables: Mapping[str, Mapping[str, Any]]
) -> list[Recorded]:
    """Marks held-out samples: by the command's names, by the file, or else every third recording or part."""
    said = model.get("hold_out")
    out = []
    for k, one in enumerate(recordings):
        if patterns or isinstance(said, list | tuple):
            held: Any = any(fnmatch.fnmatch(one.name, p) for p in (patterns or said))
        elif callable(said):
            held = _asked_to_hold(model, one, tables[one.name])
        elif len(recordings) > 2:
            held = k % 3 == 2
        else:
            held = (np.arange(len(one.time_s)) * PARTS // len(one.time_s)) % 3 == 1
        mask = np.broadcast_to(np.asarray(held, dtype=bool), one.time_s.shape)
        start = one.fitted & ~mask
        if not start.any():  # a recording that is not fitted: its start from its first readings
            first_s = float(model.get("start_from_s", one.time_s[min(9, len(one.time_s) - 1)]))
            start = np.isfinite(one.seen).any(axis=0) & (one.time_s <= first_s)
        out.append(replace(one, fitted=one.fitted & ~mask, tells_start=start))
    for pattern in patterns:
        if not any(fnmatch.fnmatch(one.name, pattern) for one in recordings):
            raise ReplayError(
                f"--hold-out {pattern}: no such recording; known: {', '.join(o.name for o in recordings)}"
            )
    if not any(one.fitted.any() for one in out):
        raise ReplayError("everything is held out; leave something to be fitted")
    return out
