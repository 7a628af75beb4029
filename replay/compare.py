"""Lays a model's prediction over a recorded run: same pressure, same start, same times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.parameters import StrawParameters
from model.simulate import TOLERANCE_M, Prediction, simulate
from replay.driving import driving_pressure
from replay.errors import ReplayError
from replay.metrics import Metrics, metrics_of
from rig.run import Run

Floats = NDArray[np.float64]

CHANNELS = ("x_m", "z_m", "phi_rad")


@dataclass(frozen=True)
class Signal:
    """One channel at the tip's valid samples: arrays (n,), SI; sigma NaN where unknown."""

    time_s: Floats
    measured: Floats
    sigma: Floats
    predicted: Floats
    metrics: Metrics


@dataclass(frozen=True)
class Comparison:
    """A run, the prediction of it, and both side by side; signals by channel name."""

    run: Run
    straw: StrawParameters
    prediction: Prediction
    signals: dict[str, Signal]


def predict(run: Run, straw: StrawParameters, *, tolerance_m: float = TOLERANCE_M) -> Prediction:
    """What a straw does under a gathered run's measured pressure, at the tip's samples (n,), from where it started.

    The recording's measured pressure drives the model, never the command; the specimen is as worn as the run says.
    Raises ReplayError where straw and run do not belong together, ModelError where the model cannot follow.
    """
    assert run.pressure is not None
    assert run.tip is not None
    assert run.initial_deployed is not None
    if run.cells != straw.cells:
        raise ReplayError(f"{run.path}: recorded on {run.cells} cells, the straw has {straw.cells}; give its file")
    # The prediction starts at rest, so it starts where the earliest log does.
    start_s = min(float(run.pressure.time_s[0]), float(run.tip.time_s[0]))
    time_s = run.tip.time_s if start_s >= run.tip.time_s[0] else np.concatenate([[start_s], run.tip.time_s])
    worn = straw.replace(cycle=float(run.cycle))
    pressure = driving_pressure(run.pressure, run.command)
    return simulate(worn, pressure, time_s, run.initial_deployed, tolerance_m=tolerance_m)


def compare(run: Run, straw: StrawParameters) -> Comparison:
    """Predict a gathered run and compare the tip; raises what `predict` raises."""
    prediction = predict(run, straw)
    assert run.tip is not None
    tip, valid = run.tip, run.tip.valid
    signals = {}
    for channel in CHANNELS:
        predicted = getattr(prediction, channel)[-len(tip) :][valid]
        measured, sigma = getattr(tip, channel)[valid], getattr(tip, f"sigma_{channel}")[valid]
        metrics = metrics_of(tip.time_s[valid], measured, sigma, predicted)
        signals[channel] = Signal(tip.time_s[valid], measured, sigma, predicted, metrics)
    return Comparison(run, straw, prediction, signals)
