"""straw simulate: what the model says a protocol does, as a recording of its own."""

from __future__ import annotations

import argparse
import math

import numpy as np
from numpy.typing import NDArray

from model.parameters import load_straw
from model.simulate import Prediction, simulate
from replay.output import check_new, write_json
from replay.progress import prepare
from rig.outlet import Outlet
from rig.protocol_toml import load_protocol
from rig.run_derived import write_prediction
from tracking.trace import TipTrace

Floats = NDArray[np.float64]

RATE_HZ = 240.0
#: Predictions of a protocol nobody ran stand at this moment: a message at time 0 breaks Foxglove.
NOMINAL_ZERO_NS = 1_000_000_000


def run(args: argparse.Namespace) -> int:
    """Simulate the protocol through the controller's nominal response and write the prediction."""
    straw, protocol = load_straw(args.straw), load_protocol(args.protocol)
    check_new(args.output)
    prepare()
    outlet = Outlet(protocol)
    time_s = np.arange(0.0, protocol.duration_s, 1 / RATE_HZ)
    p = simulate(straw, outlet, time_s, protocol.initial_deployed)
    metadata = {
        "run_id": protocol.name,
        **protocol.metadata,
        "cells": str(straw.cells),
        "straw": straw.to_toml(),
    }
    since_zero_s = time_s - protocol.zero_s
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
        write_json(args.json, {"protocol": protocol.name, "end": end, "straw": straw.to_toml()})
    print(
        f"{protocol.name}: after {protocol.duration_s:g} s the tip is at X {p.x_m[-1] * 1e3:.2f} mm, "
        f"Z {p.z_m[-1] * 1e3:.2f} mm, Phi {math.degrees(p.phi_rad[-1]):.2f} deg; written to {args.output}"
    )
    return 0


def trace_of(p: Prediction, time_s: Floats) -> TipTrace:
    """A prediction's tip as a trace: sure of itself, hence without sigmas."""
    unknown = np.full(len(time_s), np.nan)
    return TipTrace(
        time_s, p.x_m, p.z_m, p.phi_rad, unknown, unknown, unknown, np.ones(len(time_s), bool), np.arange(len(time_s))
    )
