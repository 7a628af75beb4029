"""The model's prediction of a protocol of any length, and its recording."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction, simulate
from straw.model.stretches import LongPrediction, Stretch, simulate_stretches
from straw.rig.outlet import Outlet
from straw.rig.protocol import PressureProtocol
from straw.rig.run_derived import write_prediction
from straw.tracking.trace import TipTrace

Floats = NDArray[np.float64]

RATE_HZ = 240.0
LONG_S = 600.0  # up to this duration a prediction is sampled throughout
REST_S = 10.0  # a straw of the paper's kind has come to rest after some two seconds
MOST_SAMPLES = 200_000  # a recording of some 20 MB; a quarter of an hour at full rate
#: Zero of a prediction without a run: a message at time 0 breaks Foxglove.
NOMINAL_ZERO_NS = 1_000_000_000
#: All of a protocol.
WHOLE = (-math.inf, math.inf)


def predict_protocol(
    straw: StrawParameters,
    protocol: PressureProtocol,
    window_s: tuple[float, float] = WHOLE,
    progress: Callable[[float, float], None] = lambda done_s, whole_s: None,
) -> tuple[Prediction | LongPrediction, float]:
    """Motion under a protocol through a controller of nominal speed, and its samples a second.

    ``window_s``: from when to when (s since the protocol's start) it is wanted. All of a short protocol is a
    Prediction at 240 Hz; of more than ten minutes, or of a part, a LongPrediction, which leaves out rests.
    """
    pressure, deployed = Outlet(protocol), protocol.initial_deployed
    if protocol.duration_s <= LONG_S and window_s == WHOLE:
        return simulate(straw, pressure, np.arange(0.0, protocol.duration_s, 1 / RATE_HZ), deployed), RATE_HZ
    stretches = stretches_of(protocol)
    rate_hz = rate_of(stretches, window_s)
    found = simulate_stretches(
        straw, pressure, stretches, deployed, rate_hz=rate_hz, window_s=window_s, progress=progress
    )
    return found, rate_hz


def write_predicted(
    path: Path, straw: StrawParameters, protocol: PressureProtocol, p: Prediction | LongPrediction
) -> None:
    """Write a protocol's prediction as a recording whose zero is the protocol's."""
    metadata = {
        "run_id": protocol.name,
        **protocol.metadata,
        "cells": str(straw.cells),
        **straw.laws,
        "straw": straw.to_toml(),
    }
    since_zero_s = p.time_s - protocol.zero_s
    write_prediction(
        path,
        "straw",
        metadata,
        parent_sha256="",
        zero_time_ns=NOMINAL_ZERO_NS + round(protocol.zero_s * 1e9),
        tip=trace_of(p, since_zero_s),
        pressure_time_s=since_zero_s,
        pressure_pa=p.pressure_pa,
    )


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
    """A prediction's tip as a trace, without sigmas."""
    unknown = np.full(len(time_s), np.nan)
    return TipTrace(
        time_s, p.x_m, p.z_m, p.phi_rad, unknown, unknown, unknown, np.ones(len(time_s), bool), np.arange(len(time_s))
    )
