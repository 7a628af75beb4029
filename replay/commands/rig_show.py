"""straw rig show: a protocol as a picture and in figures, before anything is moved."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from replay.commands.simulate import outlet_of
from replay.errors import ReplayError
from replay.output import write_json
from rig.protocol import PressureProtocol
from rig.protocol_toml import load_protocol

KPA = 1e3


def run(args: argparse.Namespace) -> int:
    """Draw it and print what it asks for."""
    protocol = load_protocol(args.protocol)
    picture = args.output or Path(f"{protocol.name}.png")
    said = as_data(protocol)
    draw(protocol, picture)
    if args.json:
        write_json(args.json, said | {"picture": str(picture)})
    rate = said["fastest_ramp_pa_per_s"]
    deployed = ",".join(map(str, protocol.initial_deployed)) or "none"
    print(
        f"{protocol.name}: {protocol.duration_s:g} s, main part from {protocol.zero_s:g} s, "
        f"{len(protocol.time_s)} points, {len(protocol.steps_s)} steps; starts with cells deployed: {deployed}\n"
        f"{protocol.pressure_pa.min() / KPA:g} to {protocol.pressure_pa.max() / KPA:g} kPa, ramps up to "
        f"{rate / KPA:g} kPa/s; every point is within {protocol.limits}\n"
        f"drawn in {picture}"
    )
    return 0


def as_data(protocol: PressureProtocol) -> dict[str, float]:
    """What it asks for, SI."""
    dt, dp = np.diff(protocol.time_s), np.abs(np.diff(protocol.pressure_pa))
    return {
        "duration_s": protocol.duration_s,
        "zero_s": protocol.zero_s,
        "points": len(protocol.time_s),
        "steps": len(protocol.steps_s),
        "min_pa": float(protocol.pressure_pa.min()),
        "max_pa": float(protocol.pressure_pa.max()),
        "fastest_ramp_pa_per_s": float(np.max(dp[dt > 0] / dt[dt > 0], initial=0.0)),
    }


def draw(protocol: PressureProtocol, path: Path) -> None:
    """Command against time, what a controller of nominal speed makes of it, and the limits; ReplayError if it fails."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4.2), layout="constrained")
    axes = figure.subplots()
    time_s = protocol.time_s - protocol.zero_s
    axes.plot(time_s, protocol.pressure_pa / KPA, color="#1f5fa8", lw=1.6, label="command")
    fine_s = np.linspace(0.0, protocol.duration_s, 4000)
    outlet_pa = outlet_of(protocol)(fine_s)
    axes.plot(fine_s - protocol.zero_s, outlet_pa / KPA, color="#d1662f", lw=1.0, label="nominal controller")
    low, high = protocol.pressure_pa.min() / KPA, protocol.pressure_pa.max() / KPA
    room = 0.12 * max(high - low, 1.0)
    axes.set_ylim(low - room, high + room)
    for limit, name in ((protocol.limits.min_pa, "lower limit"), (protocol.limits.max_pa, "upper limit")):
        if low - room <= limit / KPA <= high + room:
            axes.axhline(limit / KPA, color="#8a8a8a", ls="--", lw=1.0, label=name)
    axes.axvspan(time_s[0], 0.0, color="#000000", alpha=0.04, lw=0)
    axes.axvline(0.0, color="#8a8a8a", lw=0.8)
    axes.set_xlim(time_s[0], time_s[-1])
    axes.set(xlabel="time from the start of the main part / s", ylabel="gauge pressure / kPa", title=protocol.name)
    axes.grid(alpha=0.25)
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    try:
        figure.savefig(path, dpi=130)
    except (OSError, ValueError) as error:
        raise ReplayError(f"{path}: the picture cannot be written: {error}; give another name with -o") from None
