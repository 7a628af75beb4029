"""Places and states of unknown laws in a user's system: all, unless the file restricts them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.systems.function.codes import (
    ALONG,
    CHANNEL,
    CLOCK,
    DELAY,
    FACTOR,
    INPUT,
    OF_INPUT,
    OF_NOTHING,
    OF_RATE,
    OF_SHOWN,
    OF_SPEED,
    OF_STATE,
    OF_TIME,
    RATE,
    SHIFT,
    STRENGTH,
)
from straw.replay.diagnose.systems.function.laws import Place, State
from straw.replay.diagnose.systems.function.model import Model
from straw.replay.diagnose.systems.function.passed import Passed, defines, typical
from straw.replay.diagnose.systems.function.system import FunctionSystem

Floats = NDArray[np.float64]

#: Lags searched: from two samples to this share of the longest recording, and their number, evenly in the logarithm.
LAGS, LAG_SHARE = 4, 0.25
#: A state is a function of another where a broken line of so many pieces leaves less than this share of its variance.
FUNCTION_BINS, FUNCTION = 20, 0.02
#: A state's span lies between its extremes, if these are not farther beyond these quantiles than this share of their
#: distance: peaks of oscillations count, single faulty readings do not.
VISITED, BEYOND = (0.002, 0.998), 0.5


def places(system: FunctionSystem, seen: Sequence[Passed]) -> list[Place]:
    """Every equation but definitions, every constant, channel, input and clock."""
    model, out = system.model, []
    wanted = model.get("places")
    for i, name in enumerate(model.states):
        if wanted is None and _is_a_state(i, seen):
            continue  # it defines that state, as a height's rate the speed: nothing can be missing
        size = typical(np.concatenate([p.rates[i] for p in seen]))
        unit = f"{model.unit(name)}/s"
        out.append(Place(RATE, i, f"rate:{name}", f"the rate of {model.named(name)}", unit, size))
    for group in seen[0].speeds:
        names = [name for i, name in enumerate(model.states) if group >> i & 1]
        size = typical(np.concatenate([p.rates[model.states.index(name)] for p in seen for name in names]))
        says = f"the rate of {_and([model.named(name) for name in names])}, in their direction"
        out.append(Place(ALONG, group, f"along:{', '.join(names)}", says, f"{model.unit(names[0])}/s", size))
    optional = system.optional
    for name, constants in model.get("laws", {}).items():  # the file's own: its first constant is its strength
        which = [k.name for k in model.constants].index(constants[0])
        constant = model.constants[which]
        size = max(abs(constant.low), abs(constant.high)) / 10
        out.append(Place(SHIFT, which, f"law:{name}", f"the law {model.named(name)}", constant.unit, size))
    for i, constant in enumerate(model.constants):
        if constant.name not in optional:
            says = model.says.get(constant.name, f"the constant {constant.name}")
            out.append(Place(FACTOR, i, f"constant:{constant.name}", says, "1", 0.3))
    for i, channel in enumerate(model.channels):
        size = typical(np.concatenate([p.recording.seen[i] for p in seen]))
        says = model.named(channel.name)
        out.append(Place(CHANNEL, i, f"channel:{channel.name}", f"the reading of {says}", channel.unit, size))
        step = float(np.median(np.concatenate([np.diff(p.recording.time_s) for p in seen])))
        out.append(Place(CLOCK, i, f"clock:{channel.name}", f"the clock of {says}", "s", step))
    for i, signal in enumerate(model.inputs):
        size = typical(np.concatenate([p.recording.inputs[i] for p in seen]))
        says = model.named(signal.name)
        out.append(Place(INPUT, i, f"input:{signal.name}", f"the input {says}", signal.unit, size))
        if not all(np.ptp(p.recording.inputs[i]) == 0 for p in seen):
            step = float(np.median(np.concatenate([np.diff(p.recording.time_s) for p in seen])))
            out.append(Place(DELAY, i, f"delay:{signal.name}", f"the delay of the input {says}", "s", step))
    for k, law in enumerate(system.laws):
        if law.place.kind in (CLOCK, DELAY):
            continue
        out.append(Place(STRENGTH, k, f"strength:{k}", f"the strength of the law in {law.place.says}", "1", 0.5))
    return out if wanted is None else [p for p in out if p.name in wanted or p.kind in (STRENGTH, SHIFT)]


def states(system: FunctionSystem, seen: Sequence[Passed]) -> list[State]:
    """Every state, its rate, every input and its rate, time; and the history of states and inputs."""
    model, out = system.model, [State(OF_NOTHING, 0, "nothing", "1", 0.0, 1.0)]

    def add(kind: int, which: int, name: str, unit: str, rows: list[Floats], symbol: str = "") -> None:
        low, high = visited(np.concatenate(rows))
        if high - low > 1e-9 * max(abs(low), abs(high)):
            out.append(State(kind, which, name, unit, float(low), float(high), symbol=symbol))

    many = len(model.inputs)
    for i, name in enumerate(model.states):
        add(OF_STATE, i, model.named(name), model.unit(name), [p.states[i] for p in seen], name)
        if not _is_a_state(i, seen):
            add(OF_RATE, i, f"the rate of {model.named(name)}", f"{model.unit(name)}/s", [p.rates[i] for p in seen])
    for group in seen[0].speeds:
        names = [name for i, name in enumerate(model.states) if group >> i & 1]
        says = f"the magnitude of {_and([model.named(name) for name in names])}"
        add(OF_SPEED, group, says, model.unit(names[0]), [p.speeds[group] for p in seen], "|v|")
    for i, signal in enumerate(model.inputs):
        says = model.named(signal.name)
        add(OF_INPUT, i, says, signal.unit, [p.recording.inputs[i] for p in seen], signal.name)
        rows = [p.recording.inputs[many + i] for p in seen]
        add(OF_INPUT, many + i, f"the rate of {says}", f"{signal.unit}/s", rows)
    add(OF_TIME, 0, "time", "s", [p.recording.time_s for p in seen])
    for i, channel in enumerate(model.channels):
        if channel.name not in model.states:
            add(OF_SHOWN, i, model.named(channel.name), channel.unit, [p.recording.seen[i] for p in seen], channel.name)
    longest = max(float(np.ptp(p.recording.time_s)) for p in seen)
    step = float(np.median(np.concatenate([np.diff(p.recording.time_s) for p in seen])))
    for one in list(out):
        moves = one.kind in (OF_STATE, OF_INPUT) and not one.name.startswith("the rate")
        if moves and 2 * step < LAG_SHARE * longest:
            for lag in np.geomspace(2 * step, LAG_SHARE * longest, LAGS):
                out.append(replace(one, lag_s=float(lag), longest_s=longest))
    wanted = model.get("depends_on")
    return out if wanted is None else [s for s in out if s.name in (*wanted, "nothing")]


def _and(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"


def visited(values: Floats) -> tuple[float, float]:
    """The span of values (n,) in the recordings."""
    values = values[np.isfinite(values)]
    low, high = np.quantile(values, VISITED)
    reach = BEYOND * (high - low)
    return float(max(values.min(), low - reach)), float(min(values.max(), high + reach))


def together(state: State, others: Sequence[State], seen: Sequence[Passed]) -> list[str]:
    """Other states that in all recordings are functions of this one, so that they cannot be distinguished.

    Time is not among them: it correlates with everything in a recording without repetition.
    """
    if state.kind in (OF_TIME, OF_NOTHING, OF_SHOWN):
        return []
    own = values_over(replace(state, lag_s=None), seen)
    order, out = np.argsort(own, kind="stable"), []
    for other in others:
        if other.kind in (OF_TIME, OF_NOTHING, OF_SHOWN) or other.lag_s is not None or other.name == state.name:
            continue
        values = values_over(other, seen)
        if len(values) != len(own):
            continue
        pieces = np.array_split(order, min(FUNCTION_BINS, max(2, len(own) // 8)))
        left = sum(_off_a_line(own[piece], values[piece]) for piece in pieces)
        if left < FUNCTION * float(np.sum((values - values.mean()) ** 2)):
            out.append(other.name)
    return out


def _off_a_line(x: Floats, y: Floats) -> float:
    """Residual sum of squares of a straight line through points (n,)."""
    x, y = x - x.mean(), y - y.mean()
    power = float(x @ x)
    slope = float(x @ y) / power if power > 0 else 0.0
    return float(np.sum((y - slope * x) ** 2))


def _is_a_state(which: int, seen: Sequence[Passed]) -> bool:
    """Whether a rate is one of the states: then it is searched once."""
    return any(defines(which, speed, seen) for speed in range(len(seen[0].simulated[0])))


def makes_sense(place: Place, state: State) -> bool:
    """Whether a law is searched here: clocks over time, delays as constants, an equation over anything."""
    if place.kind == CLOCK:
        return state.kind in (OF_TIME, OF_NOTHING)
    if place.kind in (DELAY, SHIFT):
        return state.kind == OF_NOTHING
    if place.kind == INPUT:
        own = state.kind == OF_INPUT and state.which == place.which and state.lag_s is None
        return own or state.kind in (OF_TIME, OF_NOTHING)
    if place.kind == FACTOR:
        return state.kind not in (OF_NOTHING, OF_SHOWN)
    if place.kind == STRENGTH:
        return state.kind not in (OF_NOTHING, OF_SHOWN) and state.lag_s is None
    if place.kind in (RATE, ALONG):
        # over its own rate a law is a factor on all other terms, and is searched as such
        return state.kind != OF_SHOWN and not (state.kind == OF_RATE and state.which == place.which)
    return True


def its_own(place: Place, state: State, model: Model) -> bool:
    """Whether a place is the reading of this state, or this input."""
    if place.kind == INPUT:
        return state.kind == OF_INPUT and state.which == place.which
    return reads(place, state, model)


def hysteretic(place: Place, state: State) -> bool:
    """Whether a state may act there with hysteresis: as a spring that slips (Jenkin 1922), of which sums make smooth
    loops (Prandtl and Ishlinskii). An input's is searched in the input."""
    return state.kind == OF_STATE and state.lag_s is None and place.kind in (RATE, CHANNEL)


def reads(place: Place, state: State, model: Model) -> bool:
    """Whether a place is the reading of this state."""
    if place.kind != CHANNEL or state.kind != OF_STATE:
        return False
    return model.states[state.which] == place.name.partition(":")[2]


def as_simulated(state: State, seen: Sequence[Passed]) -> tuple[State, list[Passed]]:
    """One of the system's states as simulated, and what is visited with it: one whose reading is wrong may go where no
    reading does."""
    low, high = visited(np.concatenate([p.simulated[0][state.which] for p in seen]))
    there = replace(state, low=min(low, state.low), high=max(high, state.high))
    return there, [replace(p, states=p.simulated[0]) for p in seen]


def values_over(state: State, seen: Sequence[Passed]) -> Floats:
    """All values of a state (without its lag) in the recordings."""
    rows = {
        OF_STATE: lambda p: p.states[state.which],
        OF_RATE: lambda p: p.rates[state.which],
        OF_INPUT: lambda p: p.recording.inputs[state.which],
        OF_TIME: lambda p: p.recording.time_s,
        OF_SHOWN: lambda p: p.recording.seen[state.which],
        OF_SPEED: lambda p: p.speeds[state.which],
    }
    out = np.concatenate([rows[state.kind](p) for p in seen])
    return np.asarray(out[np.isfinite(out)])


def points(place: Place, state: State, seen: Sequence[Passed]) -> tuple[float, ...]:
    """Points of a table, half way between even and proportional to the recordings' density; many over a clock's
    time."""
    many = 24 if place.kind == CLOCK else 12 if state.kind == OF_TIME else 8
    even = np.linspace(state.low, state.high, many)
    often = np.clip(np.quantile(values_over(state, seen), np.linspace(0, 1, many)), state.low, state.high)
    out = np.unique(0.5 * (even + often))
    apart = [0, *(k for k in range(1, len(out)) if out[k] - out[k - 1] > 1e-6 * state.span)]
    return tuple(float(x) for x in out[apart])
