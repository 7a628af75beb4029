"""straw rig show: a protocol as a picture and in figures, before anything is moved."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from straw.replay.errors import ReplayError
from straw.replay.output import write_json
from straw.rig.outlet import Outlet
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import load_protocol

Floats = NDArray[np.float64]

KPA = 1e3
DRAWN = 4000  # points of a curve that are told apart on a picture of 1170 pixels, and then some
#: Units of the time axis, each from where the protocol has more than two of them.
UNITS_S = {"days": 86400.0, "h": 3600.0, "min": 60.0, "s": 1.0}


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
        f"{protocol.name}: {length_of(protocol.duration_s)}, main part from {protocol.zero_s:g} s, "
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
        "fastest_ramp_pa_per_s": fastest_ramp(dt, dp),
    }


def fastest_ramp(width_s: Floats, change_pa: Floats) -> float:
    """Largest rate of change (Pa/s) between points that are not at the same time."""
    there = width_s > 0
    with np.errstate(over="ignore"):  # a ramp of a femtosecond is as good as infinitely fast
        return float(np.max(change_pa[there] / width_s[there], initial=0.0))


def draw(protocol: PressureProtocol, path: Path) -> None:
    """Command against time, what a controller of nominal speed makes of it, and the limits; ReplayError if it fails."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4.2), layout="constrained")
    axes = figure.subplots()
    duration_s = protocol.duration_s
    unit, unit_s = next(((name, s) for name, s in UNITS_S.items() if duration_s > 2 * s), ("s", 1.0))
    time_s, command_pa = thinned(protocol.time_s, protocol.pressure_pa)
    at = (time_s - protocol.zero_s) / unit_s
    axes.plot(at, command_pa / KPA, color="#1f5fa8", lw=1.6, label="command")
    fine_s = np.unique(np.concatenate([np.linspace(0.0, duration_s, DRAWN), time_s]))
    outlet_at = (fine_s - protocol.zero_s) / unit_s
    axes.plot(outlet_at, Outlet(protocol)(fine_s) / KPA, color="#d1662f", lw=1.0, label="nominal controller")
    low, high = protocol.pressure_pa.min() / KPA, protocol.pressure_pa.max() / KPA
    room = 0.12 * max(high - low, 1.0)
    axes.set_ylim(low - room, high + room)
    for limit, name in ((protocol.limits.min_pa, "lower limit"), (protocol.limits.max_pa, "upper limit")):
        if low - room <= limit / KPA <= high + room:
            axes.axhline(limit / KPA, color="#8a8a8a", ls="--", lw=1.0, label=name)
    axes.axvspan(at[0], 0.0, color="#000000", alpha=0.04, lw=0)
    axes.axvline(0.0, color="#8a8a8a", lw=0.8)
    axes.set_xlim(at[0], at[-1])
    axes.set(
        xlabel=f"time from the start of the main part / {unit}", ylabel="gauge pressure / kPa", title=protocol.name
    )
    axes.grid(alpha=0.25)
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    try:
        figure.savefig(path, dpi=130)
    except (OSError, ValueError) as error:
        raise ReplayError(f"{path}: the picture cannot be written: {error}; give another name with -o") from None


def thinned(time_s: Floats, pressure_pa: Floats) -> tuple[Floats, Floats]:
    """A line of many points by its lowest and highest in each of ``DRAWN`` stretches: it looks the same."""
    if len(time_s) <= 2 * DRAWN:
        return time_s, pressure_pa
    starts = np.linspace(0, len(time_s), DRAWN, endpoint=False).astype(np.int64)
    low, high = np.minimum.reduceat(pressure_pa, starts), np.maximum.reduceat(pressure_pa, starts)
    ends_s, ends_pa = [time_s[0], time_s[-1]], [pressure_pa[0], pressure_pa[-1]]
    return (
        np.concatenate([ends_s[:1], np.repeat(time_s[starts], 2), ends_s[1:]]),
        np.concatenate([ends_pa[:1], np.stack([low, high], axis=1).ravel(), ends_pa[1:]]),
    )


def length_of(time_s: float) -> str:
    """Seconds, and what they are in a unit that people have a feeling for."""
    unit, unit_s = next((one for one in UNITS_S.items() if time_s > 2 * one[1]), ("s", 1.0))
    return f"{time_s:g} s" if unit == "s" else f"{time_s:g} s ({time_s / unit_s:.3g} {unit})"
