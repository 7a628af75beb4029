"""Compares a recorded run with the model's prediction: same pressure, same start, same times."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.model.simulate import TOLERANCE_M, Prediction, simulate
from straw.replay.compare.driving import driving_pressure
from straw.replay.compare.judge import (
    Motion,
    limit_of,
    measured_motion,
    moved_inputs,
    pairs_of,
    predicted_motion,
    quantities,
)
from straw.replay.errors import ReplayError
from straw.replay.metrics import Metrics, metrics_of
from straw.replay.metrics.snaps import Pair
from straw.replay.metrics.validation import Quantity, signal_verdict
from straw.rig.run import Run

Floats = NDArray[np.float64]

CHANNELS = ("x_m", "z_m", "phi_rad")
#: Factor on the tolerance of a second integration, which gives the numerical error.
FINER = 0.1


@dataclass(frozen=True)
class Signal:
    """One channel at the tip's valid samples: arrays (n,), SI; sigma NaN where unknown.

    ``u_val`` (n,): standard validation uncertainty of each sample: measurement, integration and inputs together.
    """

    time_s: Floats
    measured: Floats
    sigma: Floats
    predicted: Floats
    u_val: Floats
    metrics: Metrics
    verdict: str


@dataclass(frozen=True)
class Comparison:
    """A run, the prediction of it, and both side by side: signals by channel, snaps in pairs, figures judged.

    ``inputs``: the uncertain inputs of the prediction.
    """

    run: Run
    straw: StrawParameters
    prediction: Prediction
    signals: dict[str, Signal]
    measured: Motion
    predicted: Motion
    pairs: list[Pair]
    quantities: list[Quantity]
    inputs: tuple[str, ...]


def setting(
    run: Run, straw: StrawParameters
) -> tuple[StrawParameters, Callable[[Floats], Floats], Floats, tuple[int, ...]]:
    """Arguments of `straw.model.simulate.simulate` for a gathered run: straw, pressure, times (the tip's last), start.

    The recording's measured pressure drives the model, never the command; the specimen's wear follows the run's cycle.
    Raises ReplayError where straw and run do not belong together.
    """
    assert run.pressure is not None
    assert run.tip is not None
    assert run.initial_deployed is not None
    if run.cells != straw.cells:
        raise ReplayError(f"{run.path}: recorded on {run.cells} cells, the straw has {straw.cells}; give its file")
    # The prediction starts at rest, so it starts where the earliest log does.
    start_s = min(float(run.pressure.time_s[0]), float(run.tip.time_s[0]))
    time_s = run.tip.time_s if start_s >= run.tip.time_s[0] else np.concatenate([[start_s], run.tip.time_s])
    pressure = driving_pressure(run.pressure, run.command)
    return straw.in_run(run.cycle, run.zero_time_ns), pressure, time_s, run.initial_deployed


def predict(run: Run, straw: StrawParameters, *, tolerance_m: float = TOLERANCE_M) -> Prediction:
    """Motion of a straw under a gathered run's measured pressure, at the tip's samples (n,), from the run's start.

    Raises what `setting` raises, and ModelError where the model cannot follow.
    """
    return simulate(*setting(run, straw), tolerance_m=tolerance_m)


def compare(run: Run, straw: StrawParameters, uncertain: Mapping[str, float] | None = None) -> Comparison:
    """Predict a gathered run and compare the tip; raises what `predict` raises.

    ``uncertain``: standard uncertainties of constants by name. Their effects on the prediction, that of the
    pressure's sigma (taken as common to all readings, the worst case) and a finer integration make up ``u_val``.
    """
    prediction = predict(run, straw)
    fine = predict(run, straw, tolerance_m=FINER * TOLERANCE_M)
    inputs = {name: predict(run, moved) for name, moved in moved_inputs(straw, uncertain or {}).items()}
    if (pushed := _pushed(run)) is not None:
        inputs["pressure"] = predict(pushed, straw)
    assert run.tip is not None
    tip, valid = run.tip, run.tip.valid
    signals = {}
    for channel in CHANNELS:

        def at_tip(p: Prediction, channel: str = channel) -> Floats:
            return np.asarray(getattr(p, channel)[-len(tip) :][valid], dtype=np.float64)

        predicted = at_tip(prediction)
        measured, sigma = getattr(tip, channel)[valid], getattr(tip, f"sigma_{channel}")[valid]
        moved = [at_tip(p) - predicted for p in (fine, *inputs.values())]
        u_val = np.sqrt(sigma**2 + np.sum(np.square(moved), axis=0))
        metrics = metrics_of(tip.time_s[valid], measured, sigma, predicted)
        verdict = signal_verdict(predicted - measured, u_val)
        signals[channel] = Signal(tip.time_s[valid], measured, sigma, predicted, u_val, metrics, verdict)
    limit_rad = limit_of(straw)
    assert run.pressure is not None
    drove = limit_rad, driving_pressure(run.pressure, run.command)(tip.time_s[valid])
    seen, said = measured_motion(tip, *drove), predicted_motion(prediction, tip, *drove)
    finer = predicted_motion(fine, tip, *drove)
    by_input = {name: predicted_motion(p, tip, *drove) for name, p in inputs.items()}
    judged = quantities(seen, said, finer, by_input, limit_rad)
    return Comparison(run, straw, prediction, signals, seen, said, pairs_of(seen, said), judged, tuple(inputs))


def _pushed(run: Run) -> Run | None:
    """The run with all its pressures one sigma higher; None where sigma is unknown."""
    assert run.pressure is not None
    sigma_pa = float(np.median(run.pressure.sigma_pa))
    if not sigma_pa > 0:
        return None
    higher = dataclasses.replace(run.pressure, pressure_pa=run.pressure.pressure_pa + sigma_pa)
    return dataclasses.replace(run, pressure=higher)
