"""A run of one minute: the time to read it, the size of its page and the time until the page is ready.

``python -m tests.benchmarks.replaying``; Chromium, where there is one, opens the page five times.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.replay.compare.comparison import compare
from straw.replay.protocol.prediction import trace_of
from straw.replay.report.page import page
from straw.rig.run_derived import tip_columns
from straw.rig.run_file import RunFile
from straw.rig.run_read import read_run
from straw.rig.schema import encode
from tests.benchmarks.figures import publish, write_option
from tests.replay.browser import asked

SECONDS, TIP_HZ, PRESSURE_HZ = 60, 240, 1000
ZERO_NS = 1_795_000_000_000_000_000
METADATA = {"run_id": "minute", "specimen": "s", "initial_deployed": "1,4", "cycle": "0", "cells": "9"}


def rows() -> list[tuple[str, int, dict[str, object]]]:
    """Messages of a run that folds both cells and then breathes: topic, time, fields."""
    time_s = np.arange(0, SECONDS, 1 / TIP_HZ)
    pressed_s = np.arange(0, SECONDS, 1 / PRESSURE_HZ)

    def pressure(t: np.ndarray) -> np.ndarray:
        return -25e3 * -np.expm1(-50 * np.clip(t - 0.5, 0, None)) + 3e3 * np.sin(2 * np.pi * 0.4 * t)

    p = simulate(StrawParameters(), pressure, time_s, (1, 4))
    columns = tip_columns(trace_of(p, time_s))
    noise = np.random.default_rng(1).normal(0, 25e-6, len(time_s))
    columns |= {"x_m": p.x_m + noise, **{f"sigma_{c}": np.full(len(time_s), 25e-6) for c in ("x_m", "z_m", "phi_rad")}}
    times = columns.pop("time_s")
    lists = {name: np.asarray(column).tolist() for name, column in columns.items()}
    out: list[tuple[str, int, dict[str, object]]] = [
        ("/tip/state", ZERO_NS + round(t * 1e9), dict(zip(lists, values, strict=True)))
        for t, *values in zip(times.tolist(), *lists.values(), strict=True)
    ]
    out += [
        ("/pressure/measured", ZERO_NS + round(t * 1e9), {"pressure_pa": pa, "sigma_pa": 30.0, "channel": 1})
        for t, pa in zip(pressed_s.tolist(), pressure(pressed_s).tolist(), strict=True)
    ]
    return sorted(out, key=lambda row: row[1])


def write_protobuf(path: Path) -> None:
    """As this project writes it."""
    file = RunFile(path, {**METADATA, "zero_time_ns": str(ZERO_NS)})
    for topic, at_ns, fields in rows():
        file.add(topic, at_ns, encode(topic, at_ns, fields), log_time_ns=at_ns)
    file.finish()


def write_json(path: Path) -> None:
    """As other loggers write it."""
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_metadata("straw.run", {**METADATA, "zero_time_ns": str(ZERO_NS)})
        channels: dict[str, int] = {}
        for topic, at_ns, fields in rows():
            if topic not in channels:
                schema = writer.register_schema(topic, "jsonschema", b'{"type": "object"}')
                channels[topic] = writer.register_channel(topic, "json", schema)
            writer.add_message(channels[topic], at_ns, json.dumps(fields).encode(), at_ns)
        writer.finish()


def main() -> None:
    """Print the figures."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    write_option(options)
    args = options.parse_args()
    figures = {}
    with TemporaryDirectory() as name:
        folder = Path(name)
        for kind, write in (("protobuf", write_protobuf), ("JSON", write_json)):
            path = folder / f"{kind}.mcap"
            write(path)
            took_s = []
            for _ in range(5):
                start_s = time.perf_counter()
                run = read_run(path)
                took_s.append(time.perf_counter() - start_s)
            assert run.pressure is not None
            assert run.tip is not None
            figures[kind.lower()] = f"{statistics.median(took_s):.2f}"
            counts = f"{len(run.pressure)} pressures, {len(run.tip)} poses"
            print(f"{kind:<9} {SECONDS} s, {counts}: read in {statistics.median(took_s):.2f} s (median of 5)")
        start_s = time.perf_counter()
        comparison = compare(run, StrawParameters())
        print(f"predicted and compared in {time.perf_counter() - start_s:.1f} s")
        text = page([comparison])
        print(f"page of it, without video: {len(text.encode()) / 1e6:.2f} MB")
        ready = [asked(text, "return 0;", folder, f"--user-data-dir={folder / str(k)}")["ready"] for k in range(5)]
        print(f"page drawn and ready {statistics.median(ready) / 1e3:.2f} s after it was asked for (median of 5)")
        figures |= {"size": f"{len(text.encode()) / 1e6:.2f} MB", "drawn": f"{statistics.median(ready) / 1e3:.1f} s"}
        publish("replaying", figures, args.write)


if __name__ == "__main__":
    main()
