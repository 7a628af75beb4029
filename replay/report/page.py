"""Builds the report: template, style, script and data in one HTML file that needs no network."""

from __future__ import annotations

import base64
import html
import json
import re
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.compare import Comparison
from replay.output import finite

#: How each channel is shown: title, unit, factor from SI.
SHOWN = {
    "x_m": ("X", "mm", 1e3),
    "z_m": ("Z", "mm", 1e3),
    "phi_rad": ("Φ", "deg", 180 / np.pi),
}


def page(comparisons: list[Comparison]) -> str:
    """The HTML text of the report on one or more compared runs."""
    here = files("replay.report")

    def part(name: str) -> str:
        return here.joinpath(name).read_text(encoding="utf-8")

    # No "<" in the data: a name from a recording must not end the script element it stands in.
    data = json.dumps(finite([_data(c) for c in comparisons]), allow_nan=False).replace("<", "\\u003c")
    many = len(comparisons)
    title = comparisons[0].run.run_id if many == 1 else f"{many} runs of {_specimens(comparisons)}"
    filled = {
        "title": html.escape(title),
        "sentence": html.escape(sentence(comparisons)),
        "style": part("vendor/uPlot.min.css") + part("page.css"),
        "uplot": part("vendor/uPlot.iife.min.js"),
        "data": data,
        "script": part("page.js"),
    }
    # One pass: braces in a recording's name stay a name.
    return re.sub(r"\{\{(\w+)\}\}", lambda place: filled[place[1]], part("page.html"))


def sentence(comparisons: list[Comparison]) -> str:
    """What the comparison says, in one sentence."""
    worst = max(comparisons, key=_misfit)
    x, z, phi = (worst.signals[name].metrics.rmse for name in SHOWN)
    which = "the model" if len(comparisons) == 1 else f"the worst run, {worst.run.run_id},"
    off = f"{x * 1e6:.0f} µm in X, {z * 1e6:.0f} µm in Z and {phi * 1e3:.2f} mrad in Φ"
    return f"RMS from model to measurement: {which} is off by {off}."


def _misfit(c: Comparison) -> float:
    """Largest misfit of a run's signals in sigmas, squared; those without a sigma count for nothing."""
    return max(float(np.nan_to_num(s.metrics.reduced_chi2)) for s in c.signals.values())


def _specimens(comparisons: list[Comparison]) -> str:
    return ", ".join(sorted({c.run.specimen or "an unnamed specimen" for c in comparisons}))


def _data(c: Comparison) -> dict[str, Any]:
    run, p = c.run, c.prediction
    assert run.pressure is not None
    signals = {}
    for name, (title, unit, factor) in SHOWN.items():
        s = c.signals[name]
        m = s.metrics
        signals[name] = {
            "title": title,
            "unit": unit,
            "time": _pack(s.time_s),
            "measured": _pack(s.measured * factor),
            "sigma": _pack(s.sigma * factor),
            "predicted": _pack(s.predicted * factor),
            "bias": m.bias * factor,
            "rmse": m.rmse * factor,
            "max": m.max_abs * factor,
            "maxAt": m.max_at_s,
            "nrmse": m.nrmse_of_range,
            "within": m.within_2_sigma,
            "chi2": m.reduced_chi2,
        }
    return {
        "id": run.run_id,
        "specimen": run.specimen,
        "deployed": ",".join(map(str, run.initial_deployed or ())) or "none",
        "cycle": run.cycle,
        "file": run.path.name,
        "sha": run.sha256,
        "lost": list(run.lost),
        "events": [[e.time_s, e.kind] for e in run.events],
        "signals": signals,
        "pressure": {
            "time": _pack(run.pressure.time_s),
            "measured": _pack(run.pressure.pressure_pa / 1e3),
            "command": _pack(run.command(run.pressure.time_s) / 1e3) if run.command else None,
            "inside": _pack(np.interp(run.pressure.time_s, p.time_s, p.pressure_pa) / 1e3),
        },
        "straw": c.straw.to_toml(),
    }


def _pack(values: NDArray[np.float64]) -> str:
    """Little-endian float32 in base64: a third of the size of the digits, and exact enough for a screen."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode()
