"""Checks a track against the run's model: a tip that moves the other way, or as if it were filmed in slow motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.replay.compare.driving import driving_pressure
from straw.replay.errors import USER_ERRORS
from straw.rig.run import Run
from straw.tracking.camera import Camera
from straw.tracking.trace import TipTrace

Floats = NDArray[np.float64]

RATE_HZ = 240.0
_LONGEST_S = 60.0  # of the run: one minute suffices, and its prediction takes a hundredth of that
# least motion that determines a direction
_CHANNELS = {"X": ("x_m", 5e-4), "Z": ("z_m", 5e-4), "Phi": ("phi_rad", 5e-3)}
_AGAINST = -0.5  # correlation: no missing physics reverses a motion
_SLOWER = 3.0  # factor; slow motion is 4 to 40 times slower than real time
_PATH = (0.05, 0.95)  # shares of the tip's path between which its duration is taken


def against_model(run: Run, tip: TipTrace, straw: StrawParameters, camera: Camera) -> list[str]:
    """Return warnings, one line each; none where the run does not determine the motion, or all agrees.

    Directions and durations of the motion are compared, which are right even if the model lacks some physics.
    """
    if run.pressure is None or run.initial_deployed is None or run.cells != straw.cells:
        return []
    if np.count_nonzero(tip.valid) < 10:
        return []
    begin_s = float(run.pressure.time_s[0])
    host_s = np.arange(begin_s, min(float(run.pressure.time_s[-1]), begin_s + _LONGEST_S), 1 / RATE_HZ)
    try:
        expected = simulate(straw, driving_pressure(run.pressure, run.command), host_s, run.initial_deployed)
    except USER_ERRORS:  # straw replay reports it
        return []
    pairs = {}
    for name, (channel, least) in _CHANNELS.items():
        seen, predicted = getattr(tip, channel)[tip.valid], np.asarray(getattr(expected, channel), dtype=np.float64)
        if name == "Phi":
            seen, predicted = np.unwrap(seen), np.unwrap(predicted)
        if min(np.ptp(seen), np.ptp(predicted)) > least:
            pairs[name] = seen - seen[0], predicted - predicted[0]
    if not pairs:
        return []
    slow = _slower(tip.time_s[tip.valid], host_s, pairs)
    if slow > _SLOWER:
        fps = slow / float(np.median(np.diff(tip.time_s)))
        what = f"the tip takes {slow:.1f} times as long for its motion as the run's model"
        return [f"{what}: filmed in slow motion? then give the rate it was filmed at, near --fps {fps:.0f}"]
    reversed_ = [
        f"{name} ({correlation:.2f})"
        for name, (seen, predicted) in pairs.items()
        if (correlation := _correlation(tip.time_s[tip.valid], seen, host_s, predicted)) < _AGAINST
    ]
    if not reversed_:
        return []
    what = f"{', '.join(reversed_)} moves against what the run's model expects (correlation)"
    return [f"{what}: is board_x_in_image '{camera.board_x_in_image}', and mount '{camera.mount}'?"]


def _correlation(seen_s: Floats, seen: Floats, host_s: Floats, predicted: Floats) -> float:
    """Correlation of two displacements from rest, without subtracting means, as the direction is wanted."""
    there = np.interp(seen_s, host_s, predicted)
    size = float(np.linalg.norm(seen) * np.linalg.norm(there))
    return float(seen @ there) / size if size > 0 else 0.0


def _slower(seen_s: Floats, host_s: Floats, pairs: dict[str, tuple[Floats, Floats]]) -> float:
    """Factor by which the tip takes longer for most of its path than predicted."""
    seen = np.column_stack([one / np.ptp(other) for one, other in pairs.values()])
    predicted = np.column_stack([other / np.ptp(other) for _, other in pairs.values()])
    return _moving_s(seen_s, seen) / max(_moving_s(host_s, predicted), 1 / RATE_HZ)


def _moving_s(time_s: Floats, place: Floats) -> float:
    """Seconds between 5 % and 95 % of the path; steps below 1 % of it count as noise."""
    coarse = np.round(place / 0.01) * 0.01
    gone = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(coarse, axis=0), axis=1))))
    if gone[-1] <= 0:
        return 0.0
    first, last = (int(np.searchsorted(gone, share * gone[-1])) for share in _PATH)
    return float(time_s[last] - time_s[first])
