"""A comparison as the data of its page: display units, packed arrays."""

from __future__ import annotations

import base64
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.frustum import Frustum
from straw.model.frustum_table import TableFrustum, frustum_of
from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.replay.compare.comparison import Comparison
from straw.replay.metrics.snaps import Snap
from straw.replay.metrics.validation import Quantity
from straw.replay.report.words import order
from straw.rig.run import PressureLog

Floats = NDArray[np.float64]

#: How each channel is shown: title, unit, factor from SI.
SHOWN = {
    "x_m": ("X", "mm", 1e3),
    "z_m": ("Z", "mm", 1e3),
    "phi_rad": ("Φ", "deg", 180 / np.pi),
}
#: Figures of merit: unit shown, factor from SI, digits.
JUDGED = {"m": ("mm", 1e3, 4), "rad": ("deg", 180 / np.pi, 3), "s": ("ms", 1e3, 2), "Hz": ("Hz", 1, 3)}
#: Samples of a small multiple.
SMALL = 160
#: Numbers of all shapes together beyond which every second one is left out.
SHAPES = 300_000
BOARD_M = 8.8e-3


def data_of(c: Comparison, role: str = "") -> dict[str, Any]:
    """The page's data of one run."""
    run = c.run
    assert run.pressure is not None
    signals = {}
    for name, (title, unit, factor) in SHOWN.items():
        s = c.signals[name]
        known = bool(np.isfinite(s.metrics.reduced_chi2))
        signals[name] = {
            "title": title,
            "unit": unit,
            "factor": factor,
            "measured": packed(s.measured * factor),
            "sigma": packed(s.sigma * factor) if known else None,
            "predicted": packed(s.predicted * factor),
            "known": known,
            "metrics": asdict(s.metrics),
            "verdict": s.verdict,
            "small": {"measured": packed(small(s.measured)), "predicted": packed(small(s.predicted))},
        }
    return {
        "id": run.run_id,
        "role": role,
        "specimen": run.specimen,
        "deployed": ",".join(map(str, run.initial_deployed or ())) or "none",
        "cycle": run.cycle,
        "file": run.path.name,
        "sha": run.sha256,
        "lost": list(run.lost),
        "events": [[e.time_s, e.kind] for e in run.events],
        "snaps": [
            [snap.start_s, who]
            for who, seen in (("measured", c.measured), ("predicted", c.predicted))
            for snap in seen.snaps
        ],
        "snapping": list(dict.fromkeys(snap.cell for snap in c.predicted.snaps)),
        "pairs": [{"measured": _snap(p.measured), "predicted": _snap(p.predicted), "late": p.late_s} for p in c.pairs],
        "order": order(c),
        "quantities": [_quantity(q) for q in c.quantities],
        "inputs": "Uncertain inputs: " + (", ".join(c.inputs) or "none given") + ".",
        "time": packed(c.signals["x_m"].time_s),
        "signals": signals,
        "shape": shape(c.prediction, c.straw.form),
        "pressure": pressure(run.pressure, run.command),
        "straw": straw_data(c.straw),
        "toml": c.straw.to_toml(),
    }


def _snap(snap: Snap | None) -> dict[str, Any] | None:
    if snap is None:
        return None
    return {"start": snap.start_s, "turn": snap.turn_rad, "hinge": snap.hinge_m, "cell": snap.cell}


def _quantity(q: Quantity) -> dict[str, Any]:
    unit, factor, digits = JUDGED.get(q.unit, (q.unit, 1, 3))
    scaled = {
        name: getattr(q, name) * factor
        for name in ("measured", "predicted", "error", "u_val", "u_data", "u_num", "u_input")
    }
    return {"name": q.name, "unit": unit, "digits": digits, "verdict": q.verdict, **scaled}


def shape(p: Prediction, form: str) -> dict[str, Any]:
    """Every frustum that moves, in 16 bits a number, and the pressure inside (kPa)."""
    moving = slice(0, 2) if form == "full" else slice(1, 2)
    zeta, phi = (rows[:, :, moving].reshape(len(p.time_s), -1) for rows in (p.zeta_m, p.frustum_phi_rad))
    every = slice(None, None, int(np.ceil(2 * zeta.size / SHAPES)))
    return {
        "time": packed(p.time_s[every]),
        "inside": packed(p.pressure_pa[every] / 1e3),
        "zeta": rows_packed(zeta[every]),
        "phi": rows_packed(phi[every]),
    }


def pressure(log: PressureLog, command: PressureLog | None) -> dict[str, Any]:
    """Pressures in kPa."""
    return {
        "time": packed(log.time_s),
        "measured": packed(log.pressure_pa / 1e3),
        "command": packed(command(log.time_s) / 1e3) if command else None,
    }


def straw_data(straw: StrawParameters) -> dict[str, Any]:
    """The constants with which the page draws a straw and its energy, SI."""
    frusta = [frustum_of(straw, cell, sealed=True) for cell in range(1, straw.cells + 1)]
    bent = [e.phi_rad for e in frusta[0].equilibria() if e.stable and e.phi_rad > 0]
    return {
        "cells": straw.cells,
        "rI": straw.r_i_m,
        "rO": straw.r_o_m,
        "phi0": straw.phi_0_rad,
        "board": BOARD_M,
        "zeta0": straw.zeta0_m[:, 0].tolist(),
        "bent": min(bent, default=1.0),
        "frusta": [
            {"C1": f.C1, "C2": f.C2, "rI": f.r_i, "zeta0": f.zeta0, "area": f.area_m2, "wall": wall_of(f)}
            for f in frusta
        ],
    }


def wall_of(frustum: Frustum) -> list[float]:
    """A row of `straw.model.terms.shell_energy`; empty for equation 7."""
    return list(frustum.numbers) if isinstance(frustum, TableFrustum) else []


def packed(values: Floats) -> str:
    """Little-endian float32 in base64: a third of the size of the digits, and exact enough for a screen."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode()


def rows_packed(rows: Floats) -> dict[str, Any]:
    """Rows (n, k) as 16-bit multiples of one scale, in base64."""
    scale = float(np.abs(rows).max(initial=0.0)) / 32767 or 1.0
    whole = np.round(rows / scale).astype("<i2")
    return {"data": base64.b64encode(whole.tobytes()).decode(), "scale": scale, "width": rows.shape[1]}


def small(values: Floats) -> Floats:
    """A signal (n,) in SMALL samples, for a thumbnail."""
    return np.asarray(values[np.linspace(0, len(values) - 1, min(SMALL, len(values))).astype(int)])
