"""Reads recordings, protobuf or JSON, whole or damaged, into a Run; every failure is a RigError."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from straw.rig.errors import RigError
from straw.rig.manifest import read_manifest
from straw.rig.mcap_scan import Scan, messages, scan
from straw.rig.mcap_summary import summary_of
from straw.rig.memory import KEPT, PEAK, TooLongError, available_bytes, too_long
from straw.rig.run import CELLS, Event, Predicted, PressureLog, Run
from straw.rig.run_decode import Decoder, empty, known
from straw.rig.samples import Columns, Samples
from straw.rig.schema import PREDICTION
from straw.tracking.trace import TipTrace

FAR_S = 3600.0  # a zero further than this from the first message is reported


def read_run(path: str | Path, *, every_s: float = 0.0) -> Run:
    """Read one recording. Of a damaged file the intact part is read, and ``Run.lost`` states what is missing.

    With ``every_s`` a long one is thinned: of each channel's pressure in every interval the first, lowest and highest
    sample are kept, of the tip the first; ``Run.lost`` says so. The file passes through the memory a chunk at a time.
    RigError, one line, when the file cannot be opened, is no MCAP, or holds no message of the contract;
    TooLongError, which names an ``every_s`` that will do, when its samples do not fit into the memory there is.
    """
    path = Path(path)
    _check_room(path, every_s)
    found, topics = _decoded(path, every_s)
    lost, sha256 = found.lost, found.sha256
    unsure = _against_manifest(path, sha256, lost)
    damage = tuple(lost)
    lost += [unsure] if unsure else []
    lost += [f"it was read thinned, at steps of {every_s:g} s"] if every_s else []
    if not topics:
        why = f": {lost[0]}" if lost else "; it is a recording of something else"
        raise RigError(f"recording {path} holds no message of a straw run{why}")

    said = dict(found.metadata.get("straw.run", {}))
    if not said:
        lost.append("the metadata record straw.run is missing: specimen, initial state and zero time are assumed")
    metadata = {**found.metadata.get("straw.stop", {}), **said}
    first_ns = min(int(samples.time_ns().min()) for samples in topics.values())
    zero_ns = _whole(metadata, "zero_time_ns", first_ns, "the first message", lost)
    if abs(first_ns - zero_ns) * 1e-9 > FAR_S:
        lost.append(f"zero_time_ns is {(first_ns - zero_ns) * 1e-9:.0f} s from the first message: check the clocks")
    lost += [f"metadata {key} is missing" for key in ("run_id", "specimen") if said and key not in said]
    cells = _whole(metadata, "cells", CELLS, str(CELLS), lost)
    channel = _whole(metadata, "channel", 1, "1", None)

    def pressure(topic: str, held: bool = False) -> PressureLog | None:
        return _pressure(topic, topics.pop(topic, None), zero_ns, channel, held, lost)

    def tip(topic: str) -> TipTrace | None:
        return _tip(topic, topics.pop(topic, None), zero_ns, lost)

    happened = topics["/events"].rows() if "/events" in topics else []
    models = sorted({match[1] for topic in topics if (match := PREDICTION.fullmatch(topic))})
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
        events=tuple(Event((ns - zero_ns) * 1e-9, *values) for ns, values in happened),
        lost=tuple(lost),
        damage=damage,
        software=found.metadata.get("straw.software.recorded") or found.metadata.get("straw.software", {}),
    )


def read_fitting(path: Path) -> tuple[Run, float]:
    """A recording, thinned if it would not fit into memory, and at which step (s; 0 if it is not)."""
    try:
        return read_run(path), 0.0
    except TooLongError as error:
        return read_run(path, every_s=error.every_s), error.every_s


def _against_manifest(path: Path, sha256: str, lost: list[str]) -> str:
    """Note in ``lost`` a file that differs from its manifest; return why that cannot be told, else ""."""
    try:
        if read_manifest(path).get(path.name, sha256) != sha256:
            lost.append("its SHA-256 is not the one in its manifest: it was changed after it was recorded")
    except RigError as error:  # not a fault of the run
        return f"{error}; whether the run is as recorded cannot be told"
    return ""


def _check_room(path: Path, every_s: float) -> None:
    """TooLongError where the end of the file tells that its samples will not fit; others are found out on the way."""
    summary = summary_of(path)
    if summary is None:
        return
    most = KEPT * summary.span_s / every_s if every_s else float("inf")
    needed = [(min(n, most), empty(topic).sample_bytes) for topic, n in summary.counts.items() if known(topic)]
    count, held = sum(n for n, _ in needed), sum(n * size for n, size in needed)
    if PEAK * held > available_bytes():
        raise too_long(path, count, held / count, summary.span_s)


def _decoded(path: Path, every_s: float) -> tuple[Scan, dict[str, Samples]]:
    """What a file holds, and its samples by topic."""
    found = Scan()
    decoder = Decoder(found, every_s, path)
    try:
        scan(path, decoder.take, found)
        if decoder.early:
            decoder = Decoder(found, every_s, path)
            messages(path, found, decoder.take)
        return found, decoder.decoded()
    except MemoryError:
        raise RigError(
            f"recording {path} does not fit into memory; read it thinned: read_run(path, every_s=1)"
        ) from None


def _in_time(
    topic: str, time_ns: NDArray[np.int64], columns: Columns, zero_ns: int, lost: list[str]
) -> tuple[NDArray[np.float64], Columns]:
    """Columns sorted by time, keeping the first of equal times; changes are noted in ``lost``."""
    # Seconds first, order after: far from zero two nanoseconds can become one number of seconds.
    time_s: NDArray[np.float64] = (time_ns - zero_ns).astype(np.float64)
    time_s *= 1e-9
    if np.any(time_s[1:] <= time_s[:-1]):
        order = np.argsort(time_s, kind="stable")
        if np.any(time_s[1:] < time_s[:-1]):
            lost.append(f"{topic} was not in order of time and was sorted")
        keep = order[np.concatenate([[True], np.diff(time_s[order]) > 0])]
        if len(keep) < len(order):
            lost.append(f"{len(order) - len(keep)} messages on {topic} repeat a time and were left out")
        time_s, columns = time_s[keep], {name: column[keep] for name, column in columns.items()}
    return time_s, columns


def _pressure(
    topic: str, samples: Samples | None, zero_ns: int, channel: int, held: bool, lost: list[str]
) -> PressureLog | None:
    if samples is None:
        return None
    time_ns, columns = samples.taken()
    number = columns.pop("channel")
    ours = (number == channel) | ((number == 0) & (channel == 1))  # protobuf does not distinguish 0 from absent
    del number
    if ours.any() and not ours.all():
        time_ns, columns = time_ns[ours], {name: column[ours] for name, column in columns.items()}
    time_s, value = _in_time(topic, time_ns, columns, zero_ns, lost)
    pressure_pa, sigma_pa = value["pressure_pa"], value.get("sigma_pa")
    good = np.isfinite(pressure_pa)
    if not np.all(good):
        lost.append(f"{int(np.sum(~good))} pressures on {topic} are not numbers and were left out")
        time_s, pressure_pa = time_s[good], pressure_pa[good]
        sigma_pa = None if sigma_pa is None else sigma_pa[good]
    if not len(time_s):
        return None
    return PressureLog(
        time_s, pressure_pa, np.full(len(time_s), np.nan) if sigma_pa is None else _sigma(sigma_pa), held
    )


def _tip(topic: str, samples: Samples | None, zero_ns: int, lost: list[str]) -> TipTrace | None:
    if samples is None:
        return None
    time_s, value = _in_time(topic, *samples.taken(), zero_ns, lost)
    axes = ("x_m", "z_m", "phi_rad")
    pose = np.array([value.pop(name) for name in axes])
    valid = value.pop("valid").astype(np.bool_) & np.all(np.isfinite(pose), axis=0)
    pose[:, ~valid] = np.nan  # a sample that says it is invalid must not be usable by mistake
    sigma = [_sigma(value.pop(f"sigma_{name}")) for name in axes]
    return TipTrace(time_s, pose[0], pose[1], pose[2], sigma[0], sigma[1], sigma[2], valid, value["frame"])


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
