"""A protocol as a picture: the command, a controller's response, and the limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from straw.rig.outlet import Outlet
from straw.rig.protocol import PressureProtocol

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

KPA = 1e3
DRAWN = 4000  # more points than can be distinguished on a picture of 1170 pixels
#: Units of the time axis, each from where the protocol has more than two of them.
UNITS_S = {"days": 86400.0, "h": 3600.0, "min": 60.0, "s": 1.0}


def protocol_figure(protocol: PressureProtocol) -> Figure:
    """Command against time, the response of a controller of nominal speed, and the limits."""
    from matplotlib.figure import Figure  # slow to import

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
    return figure


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
