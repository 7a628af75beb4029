"""straw rig show: a protocol as a picture and in figures, before anything is moved."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from straw.replay.output import write_json, write_picture
from straw.replay.protocol.figure import UNITS_S, protocol_figure
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import load_protocol

Floats = NDArray[np.float64]

KPA = 1e3


def run(args: argparse.Namespace) -> int:
    """Draw it and print its duration, range and rates."""
    protocol = load_protocol(args.protocol)
    picture = args.output or Path(f"{protocol.name}.png")
    said = as_data(protocol)
    draw(protocol, picture)
    if args.json:
        write_json(args.json, said | {"picture": str(picture)})
    rate = said["fastest_ramp_pa_per_s"]
    deployed = ",".join(map(str, protocol.initial_deployed)) or "none"
    print(
        f"{protocol.name}: {length_of(protocol.duration_s)}, main part from {protocol.zero_s:g} s, "
        f"{len(protocol.time_s)} points, {len(protocol.steps_s)} steps; starts with cells deployed: {deployed}\n"
        f"{protocol.pressure_pa.min() / KPA:g} to {protocol.pressure_pa.max() / KPA:g} kPa, ramps up to "
        f"{rate / KPA:g} kPa/s; every point is within {protocol.limits}\n"
        f"drawn in {picture}"
    )
    return 0


def as_data(protocol: PressureProtocol) -> dict[str, float]:
    """Its duration, range and rates, SI."""
    dt, dp = np.diff(protocol.time_s), np.abs(np.diff(protocol.pressure_pa))
    return {
        "duration_s": protocol.duration_s,
        "zero_s": protocol.zero_s,
        "points": len(protocol.time_s),
        "steps": len(protocol.steps_s),
        "min_pa": float(protocol.pressure_pa.min()),
        "max_pa": float(protocol.pressure_pa.max()),
        "fastest_ramp_pa_per_s": fastest_ramp(dt, dp),
    }


def fastest_ramp(width_s: Floats, change_pa: Floats) -> float:
    """Largest rate of change (Pa/s) between points that are not at the same time."""
    there = width_s > 0
    with np.errstate(over="ignore"):  # a ramp of a femtosecond counts as a step
        return float(np.max(change_pa[there] / width_s[there], initial=0.0))


def draw(protocol: PressureProtocol, path: Path) -> None:
    """Save the protocol's picture; ReplayError where that cannot be."""
    write_picture(protocol_figure(protocol), path, 130, "-o")


def length_of(time_s: float) -> str:
    """Seconds, and the same in a familiar unit."""
    unit, unit_s = next((one for one in UNITS_S.items() if time_s > 2 * one[1]), ("s", 1.0))
    return f"{time_s:g} s" if unit == "s" else f"{time_s:g} s ({time_s / unit_s:.3g} {unit})"
