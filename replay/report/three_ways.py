"""The same protocol three ways, as a table for a terminal, for machines, and for the page."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from straw.replay.protocol.three_ways import ThreeWays

SHOWN = {"Pa": (1e-3, "kPa"), "m": (1e3, "mm"), "rad": (180 / np.pi, "deg")}
#: Points of a curve in the page's small pictures.
POINTS = 500


def differences_table(run_id: str, ways: ThreeWays) -> str:
    """One line a pair and signal."""
    lines = [f"\n{run_id}, the same protocol:   {'bias':>9} {'rms':>9} {'largest':>9}   {'at':<9} lag / ms"]
    for (one, other, name), m in ways.differences.items():
        factor, unit = SHOWN[ways.signals[one][name].unit]
        lag = (
            "beyond"
            if m.lag_at_bound
            else "-"
            if np.isnan(m.lag_s)
            else f"{m.lag_s * 1e3:.2f} +- {m.lag_sigma_s * 1e3:.2f}"
        )
        lines.append(
            f"{f'{other} - {one}':<21} {f'{name} / {unit}':<14} {m.bias * factor:9.4f} {m.rmse * factor:9.4f} "
            f"{m.max_abs * factor:9.4f}   {f'{m.max_at_s:.3f} s':<9} {lag}"
        )
    return "\n".join(lines)


def differences_data(ways: ThreeWays) -> list[dict[str, Any]]:
    """For JSON, SI."""
    return [
        {"one": one, "other": other, "signal": name, "unit": ways.signals[one][name].unit, **asdict(m)}
        for (one, other, name), m in ways.differences.items()
    ]


def three_ways_data(ways: ThreeWays) -> dict[str, Any]:
    """For the page: thinned curves and differences in the units it shows."""
    signals: dict[str, Any] = {}
    for who, by_name in ways.signals.items():
        for name, s in by_name.items():
            factor, unit = SHOWN[s.unit]
            at = np.linspace(0, len(s.time_s) - 1, min(POINTS, len(s.time_s))).astype(int)
            curve = {"time": np.round(s.time_s[at], 4).tolist(), "value": np.round(s.value[at] * factor, 4).tolist()}
            signals.setdefault(name, {"unit": unit, "curves": {}})["curves"][who] = curve
    differences = []
    for (one, other, name), m in ways.differences.items():
        factor, unit = SHOWN[ways.signals[one][name].unit]
        differences.append(
            {
                "one": one,
                "other": other,
                "signal": name,
                "unit": unit,
                "bias": m.bias * factor,
                "rmse": m.rmse * factor,
                "max": m.max_abs * factor,
                "at": m.max_at_s,
                "lag": m.lag_s,
                "lagSigma": m.lag_sigma_s,
                "beyond": m.lag_at_bound,
            }
        )
    return {"signals": signals, "differences": differences}
