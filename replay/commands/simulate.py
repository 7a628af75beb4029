"""straw simulate: what the model says a protocol does, as a recording of its own."""

from __future__ import annotations

import argparse
import math

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import load_straw
from straw.model.simulate import Prediction, simulate
from straw.model.stretches import LongPrediction, Stretch, simulate_stretches
from straw.replay.errors import ReplayError
from straw.replay.output import check_new, write_json
from straw.replay.progress import prepare, progress_bar
from straw.rig.outlet import Outlet
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import load_protocol
from straw.rig.run_derived import write_prediction
from straw.tracking.trace import TipTrace

Floats = NDArray[np.float64]

RATE_HZ = 240.0
LONG_S = 600.0  # up to here a prediction is sampled all through
REST_S = 10.0  # a straw of the paper's kind has come to rest after some two seconds
MOST_SAMPLES = 200_000  # a recording of some 20 MB; a quarter of an hour at full rate
#: Predictions of a protocol nobody ran stand at this moment: a message at time 0 breaks Foxglove.
NOMINAL_ZERO_NS = 1_000_000_000


def run(args: argparse.Namespace) -> int:
    """Simulate the protocol through the controller's nominal response and write the prediction."""
    straw, protocol = load_straw(args.straw), load_protocol(args.protocol)
    check_new(args.output)
    window_s = window_of(args, protocol)
    prepare()
    rate_hz = RATE_HZ
    p: Prediction | LongPrediction
    if protocol.duration_s <= LONG_S and window_s == (-math.inf, math.inf):
        p = simulate(
            straw, Outlet(protocol), np.arange(0.0, protocol.duration_s, 1 / RATE_HZ), protocol.initial_deployed
        )
    else:
        stretches = stretches_of(protocol)
        rate_hz = rate_of(stretches, window_s)
        with progress_bar(f"predict {protocol.name}", "s") as progress:
            p = simulate_stretches(
                straw,
                Outlet(protocol),
                stretches,
                protocol.initial_deployed,
                rate_hz=rate_hz,
                window_s=window_s,
                progress=lambda done_s, whole_s: progress(round(done_s), round(whole_s)),
            )
    metadata = {
        "run_id": protocol.name,
        **protocol.metadata,
        "cells": str(straw.cells),
        "straw": straw.to_toml(),
    }
    since_zero_s = p.time_s - protocol.zero_s
    write_prediction(
        args.output,
        "straw",
        metadata,
        parent_sha256="",
        zero_time_ns=NOMINAL_ZERO_NS + round(protocol.zero_s * 1e9),
        tip=trace_of(p, since_zero_s),
        pressure_time_s=since_zero_s,
        pressure_pa=p.pressure_pa,
    )
    if args.json:
        end = {name: float(getattr(p, name)[-1]) for name in ("x_m", "z_m", "phi_rad", "volume_m3")}
        write_json(
            args.json, {"protocol": protocol.name, "end": end, "straw": straw.to_toml(), "samples": len(p.time_s)}
        )
    if isinstance(p, LongPrediction):
        print(
            f"{len(p.time_s)} samples, {rate_hz:.3g} a second where it moves; {p.skipped_s:.0f} s of rest skipped; "
            "--from and --to predict a stretch at full rate"
        )
    print(
        f"{protocol.name}: after {p.time_s[-1]:g} s the tip is at X {p.x_m[-1] * 1e3:.2f} mm, "
        f"Z {p.z_m[-1] * 1e3:.2f} mm, Phi {math.degrees(p.phi_rad[-1]):.2f} deg; written to {args.output}"
    )
    return 0


def window_of(args: argparse.Namespace, protocol: PressureProtocol) -> tuple[float, float]:
    """The stretch that is wanted, seconds since the protocol's start; all of it where nothing is said."""
    start_s, end_s = (
        otherwise if given is None else given + protocol.zero_s
        for given, otherwise in ((args.start, -math.inf), (args.end, math.inf))
    )
    if not (start_s < end_s and start_s < protocol.duration_s and end_s > 0.0):
        raise ReplayError(
            f"--from {args.start} --to {args.end}: expected a stretch of {-protocol.zero_s:g} to "
            f"{protocol.duration_s - protocol.zero_s:g} s, the first before the second"
        )
    return start_s, end_s


def stretches_of(protocol: PressureProtocol) -> list[Stretch]:
    """Holds in which a straw may come to rest, and everything between them."""
    time_s, pressure_pa = protocol.time_s, protocol.pressure_pa
    holds = (np.diff(pressure_pa) == 0.0) & (np.diff(time_s) > REST_S)
    found: list[Stretch] = []
    for end_s, hold in zip(time_s[1:].tolist(), holds.tolist(), strict=True):
        if found and not hold and not found[-1].holds:
            found[-1] = Stretch(end_s, False)
        elif not found or end_s > found[-1].end_s:
            found.append(Stretch(end_s, hold))
    return found


def rate_of(stretches: list[Stretch], window_s: tuple[float, float]) -> float:
    """Samples a second that keep a prediction to ``MOST_SAMPLES``, 240 at most."""
    moving_s, start_s = 0.0, 0.0
    for stretch in stretches:
        inside_s = max(0.0, min(stretch.end_s, window_s[1]) - max(start_s, window_s[0]))
        moving_s += min(inside_s, REST_S) if stretch.holds else inside_s
        start_s = stretch.end_s
    return min(RATE_HZ, MOST_SAMPLES / moving_s)


def trace_of(p: Prediction | LongPrediction, time_s: Floats) -> TipTrace:
    """A prediction's tip as a trace: sure of itself, hence without sigmas."""
    unknown = np.full(len(time_s), np.nan)
    return TipTrace(
        time_s, p.x_m, p.z_m, p.phi_rad, unknown, unknown, unknown, np.ones(len(time_s), bool), np.arange(len(time_s))
    )
