"""The course of recordings with a fit: states, rates and channels, as measured where a channel tells them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.system import FunctionSystem

Floats = NDArray[np.float64]

#: Values whose spread is a smaller share of them are constant: rounding leaves some 1e-16.
ROUNDING = 1e-12
#: Units of angles.
ANGLES = ("rad", "deg", "°")


@dataclass(frozen=True, eq=False)
class Passed:
    """The course of a recording with a fit: states, their rates, channels and inputs, each (rows, n).

    ``speeds``: magnitudes of velocities (n,), by the bits of their components among the states.
    """

    recording: Recorded
    states: Floats
    rates: Floats
    shown: Floats
    simulated: tuple[Floats, Floats]  # states and their rates, whether a channel measures them or not
    speeds: dict[int, Floats] = field(default_factory=dict)


def passed(system: FunctionSystem, recordings: Sequence[Recorded], values: dict[str, float]) -> list[Passed]:
    """Simulated with these values. A state that a channel measures is taken as measured, as the model is wrong."""
    names = [y.name for y in system.model.channels]
    out = []
    for one in recordings:
        start, _ = system.started(one)
        shown = system.profiled(one, values)[0]
        _, states, rates = system.played(one, values, start)
        n = len(system.model.states)
        simulated = states[:n], rates[:n]
        states, rates = states[:n].copy(), rates[:n].copy()
        for i, state in enumerate(system.model.starts):
            if state.state in names:
                states[i] = smooth(one, names.index(state.state), shown)
                rates[i] = np.gradient(states[i], one.time_s)
        out.append(Passed(one, states, rates, shown, simulated))
    for speed, of in still_speeds(system, out).items():
        for p in out:
            p.states[speed] = p.rates[of]
            p.rates[speed] = np.gradient(p.states[speed], p.recording.time_s)
    for group in velocities(system, out):
        for p in out:
            p.speeds[sum(1 << k for k in group)] = np.sqrt(sum(p.rates[of] ** 2 for of in group.values()))
    return out


def still_speeds(system: FunctionSystem, seen: Sequence[Passed]) -> dict[int, int]:
    """States that stay as they start in every simulation, and are the rate of a state that a channel measures, by that
    state: such a base, as of a body without any force, does not tell where a law over its speed would be visited."""
    names, out = [y.name for y in system.model.channels], {}
    for speed, name in enumerate(system.model.states):
        rows = [p.simulated[0][speed] for p in seen]
        if name in names or any(np.ptp(row) > ROUNDING * np.max(np.abs(row)) for row in rows):
            continue
        for of, other in enumerate(system.model.states):
            if other in names and defines(of, speed, seen):
                out[speed] = of
    return out


def defines(which: int, speed: int, seen: Sequence[Passed]) -> bool:
    """Whether a state's rate is another state, as a height's is the speed."""
    rate, row = (np.concatenate([p.simulated[k][i] for p in seen]) for k, i in ((1, which), (0, speed)))
    return bool(np.max(np.abs(row - rate)) <= 1e-9 * np.max(np.abs(rate)))


def velocities(system: FunctionSystem, seen: Sequence[Passed]) -> list[dict[int, int]]:
    """Components of a velocity, each with its coordinate: states that are the rates of others, in one unit that is no
    angle's."""
    groups: dict[str, dict[int, int]] = {}
    for speed, name in enumerate(system.model.states):
        of = [k for k in range(len(system.model.states)) if k != speed and defines(k, speed, seen)]
        unit = system.model.unit(name)
        if of and unit.partition("/")[0] not in (*ANGLES, "1"):
            groups.setdefault(unit, {})[speed] = of[0]
    return [one for one in groups.values() if len(one) > 1]


def smooth(recording: Recorded, channel: int, shown: Floats) -> Floats:
    """A channel (n,) with noise smoothed, and gaps filled by a simulation's channels (channels, n) and its difference
    on both sides."""
    row, t = recording.seen[channel], recording.time_s
    base = shown[channel] if np.isfinite(shown[channel]).all() else np.zeros_like(t)
    good = np.isfinite(row)
    return np.asarray(gaussian_filter1d(base + np.interp(t, t[good], (row - base)[good]), 1.0))


def typical(values: Floats) -> float:
    """The size of a change of values (n,): their standard deviation, or, where they are constant but for rounding, what
    they are; 1 where that is zero."""
    values = values[np.isfinite(values)]
    most = float(np.max(np.abs(values), initial=0.0))
    size = float(np.std(values)) if len(values) else 0.0
    return (size if size > ROUNDING * most else most) or 1.0
