"""The states over which a curve promises most: every state tried to first order beside a fit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, evaluated
from straw.replay.diagnose.systems.straw.constants import applied
from straw.replay.diagnose.systems.straw.curve import Curve, downhill, with_points
from straw.replay.diagnose.systems.straw.of import straw_of
from straw.replay.diagnose.systems.straw.simulated import simulated
from straw.replay.diagnose.systems.straw.states import State
from straw.replay.diagnose.systems.straw.tables import points

Floats = NDArray[np.float64]

#: Steps of the search to the size of force that the first slopes predict, and its limit in units.
STEPS, LARGEST = 3.0, 1000.0


@dataclass(frozen=True, eq=False)
class Start:
    """A state's curve at zero, beside the base's fit: the cost predicted by its slopes."""

    curve: Curve
    promise: float


def promising(
    wide: Campaign,
    known: Fit,
    beneath: Floats,
    values: int,
    observations: Sequence[Any],
    told: Callable[[str, int], None],
    states: Sequence[State],
    most: int,
) -> list[list[Start]]:
    """Curves at zero over the few states, at most ``most``, that promise most, the best first; of each state from all
    of its starts, as the first slopes do not tell where a point lies. None where the search was stopped."""
    starts: dict[str, list[Start]] = {}
    for start in _starts(wide, known, beneath, values, observations, told, states):
        starts.setdefault(start.curve.state.name, []).append(start)
        if wide.stop():
            return []
    return sorted(starts.values(), key=lambda some: min(one.promise for one in some))[:most]


def _starts(
    campaign: Campaign,
    null: Fit,
    beneath: Floats,
    values: int,
    observations: Sequence[Any],
    told: Callable[[str, int], None],
    states: Sequence[State],
) -> Iterator[Start]:
    """Every state's curve at zero with its slopes; its points lie where all observations pass.

    The last unknowns of the fit, ``values`` of them, are those of another curve; a state's further constants come
    before them, so that all curves come last.
    """
    straw, _ = applied(straw_of(campaign), null.unknowns, null.u)
    seen = [(o, simulated(o, straw_of(campaign), null.unknowns, null.u).prediction) for o in observations]
    before = len(null.u) - values
    for k, state in enumerate(states):
        told(state.name, k)
        at = points(state, [state.visited(straw, o, p) for o, p in seen])
        if at is None:
            continue
        more = len(state.further)
        base = (*null.unknowns[:before], *state.further, *null.unknowns[before:])
        rows = np.insert(beneath, [before] * more, 0.0, axis=1)
        here, unknowns, smooth = with_points(campaign, base, rows, state, at)
        u = np.insert(null.u, [before] * more, [one.mean for one in state.further])
        u = np.concatenate([u, np.zeros(len(unknowns) - len(base))])
        fit = evaluated(here, unknowns, u, smooth)
        unit, wanted = unknowns[-1].scale, -downhill(fit, smooth)[0][len(base) :]
        # in units of the predicted size a large force is as near as a small one
        larger = float(np.clip(np.max(np.abs(wanted)) / STEPS, 1.0, LARGEST))
        slopes = fit.slopes.copy()
        slopes[:, len(base) :] *= larger
        unknowns = (*base, *(replace(k, scale=unit * larger) for k in unknowns[len(base) :]))
        fit = replace(fit, unknowns=unknowns, slopes=slopes)
        yield Start(Curve(state, here, smooth, rows, fit, at, at), fit.cost - downhill(fit, smooth)[1])
