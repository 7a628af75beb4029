"""Every signal of a recording, all channels and sensors, thinned for a screen, with its metadata."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.rig.mcap_scan import messages, scan
from straw.rig.run_read import read_fitting
from straw.rig.samples import Samples
from straw.rig.schema import message_class

Floats = NDArray[np.float64]
#: Bins of a thinned curve; each keeps its lowest and highest sample.
BINS = 700


def details(path: Path) -> dict[str, Any]:
    """The contents of a recording's page: signals by name, events, metadata, attachments; RigError as ``read_run``.

    A signal is ``{"unit", "time_s", "values"}``: kPa, µl/s, mm, deg, for people. Times count from the run's zero.
    """
    run, every_s = read_fitting(path)
    signals: dict[str, Any] = {}
    for name, unit, factor, time_s, values in _pressures(path, run.zero_time_ns, every_s):
        signals[name] = _thinned(time_s, values * factor, unit)
    for kind, log in (("command 1", run.command), ("pressure 1", run.pressure)):
        if log is not None and not signals.keys() & {"pressure 1", kind}:  # of another logger, in JSON
            signals[kind] = _thinned(log.time_s, log.pressure_pa * 1e-3, "kPa")
    for source, tip in (("", run.tip), *((f" {name}", model.tip) for name, model in run.predictions.items())):
        if tip is None:
            continue
        for name, axis, unit, factor in (
            ("X", tip.x_m, "mm", 1e3),
            ("Z", tip.z_m, "mm", 1e3),
            ("Phi", tip.phi_rad, "deg", 180 / np.pi),
        ):
            signals[name + source] = _thinned(tip.time_s[tip.valid], axis[tip.valid] * factor, unit)
    return {
        "signals": {name: signal for name, signal in signals.items() if signal["values"]},
        "zero_ns": str(run.zero_time_ns),
        "events": [[round(e.time_s, 4), e.kind, e.text] for e in run.events],
        "metadata": dict(run.metadata),
        "software": dict(run.software),
        "attachments": {name: data[:20_000].decode("utf-8", "replace") for name, data in run.attachments.items()},
        "lost": list(run.lost),
    }


def _pressures(path: Path, zero_ns: int, every_s: float) -> list[tuple[str, str, float, Floats, Floats]]:
    """(name, unit, factor, s, SI values) of every channel's pressure, command and flow."""
    found, every_ns = scan(path), round(every_s * 1e9)
    series: dict[tuple[str, int], Samples] = defaultdict(lambda: Samples([("pressure_pa", "double")], every_ns))

    def take(channel_id: int, happened_ns: int, data: bytes, _log_ns: int) -> None:
        channel = found.channels.get(channel_id)
        if channel is None or not channel.topic.startswith("/pressure/") or channel.message_encoding != "protobuf":
            return
        try:
            schema = found.schemas[channel.schema_id]
            said: Any = message_class(schema.name, schema.data).FromString(data)
            number = int(getattr(said, "channel", 1)) or 1
            kind = "command" if channel.topic.endswith("command") else "pressure"
            series[kind, number].add(happened_ns, (float(said.pressure_pa),))
            flow = float(getattr(said, "flow_m3_s", np.nan))
            if kind == "pressure" and np.isfinite(flow) and _has(said, "flow_m3_s"):
                series["flow", number].add(happened_ns, (flow,))
        except Exception:  # a damaged message; what is lost is said by read_run
            return

    messages(path, found, take)
    units = {"command": ("kPa", 1e-3), "pressure": ("kPa", 1e-3), "flow": ("µl/s", 1e9)}
    return [(f"{kind} {n}", *units[kind], *_in_order(series.pop((kind, n)), zero_ns)) for kind, n in sorted(series)]


def _in_order(samples: Samples, zero_ns: int) -> tuple[Floats, Floats]:
    samples.end()
    time_ns, columns = samples.taken()
    time_s: Floats = (time_ns - zero_ns).astype(np.float64) * 1e-9
    values: Floats = columns["pressure_pa"]
    if np.any(time_s[1:] < time_s[:-1]):
        order = np.argsort(time_s, kind="stable")
        return time_s[order], values[order]
    return time_s, values


def _has(message: Any, name: str) -> bool:
    return name in message.DESCRIPTOR.fields_by_name


def _thinned(time_s: Floats, values: Floats, unit: str) -> dict[str, Any]:
    good = np.isfinite(values)
    time_s, values = time_s[good], values[good]
    if len(values) > 2 * BINS:
        edges = np.linspace(0, len(values), BINS + 1).astype(int)
        parts = np.split(values, edges[1:-1])
        lows = edges[:-1] + [int(np.argmin(part)) for part in parts]
        highs = edges[:-1] + [int(np.argmax(part)) for part in parts]
        at = np.unique(np.concatenate([lows, highs, [0, len(values) - 1]]))
        time_s, values = time_s[at], values[at]
    return {"unit": unit, "time_s": np.round(time_s, 5).tolist(), "values": np.round(values, 5).tolist()}
