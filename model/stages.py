"""Data of an integration: its state, the stages of a step, the limits of a step, and scratch arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.articulated import Articulated, articulated_for
from straw.model.channel import STATES, Channel, channel_of
from straw.model.compiled import allocates_nothing, compiled
from straw.model.constants import Constants
from straw.model.frusta import MEMORIES
from straw.model.kinematics import Chain, empty_chain
from straw.model.scheme import COEFFICIENTS, STAGES
from straw.model.straw import Room, room_for
from straw.model.terms.elasticity import softest

Floats = NDArray[np.float64]

#: Residual at which Newton stops, in units of the tolerance: the first in general; the second where states accumulate
#: it, as those of friction and of the water in the channel do: with more, energy drifts and steps multiply.
NEWTON_SHARE, CARRIED_SHARE = 1e-2, 3e-4
#: The mean pressure of a step is resolved to what moves a frustum by this share of the tolerance.
SEEN_SHARE = 1e-2


class State(NamedTuple):
    """State of an integration."""

    q: Floats  # (coordinates,)
    v: Floats
    a: Floats
    memory: Floats  # (cells, 2, MEMORIES, 2), see straw.model.frusta
    inlet: Floats  # (STATES,), see straw.model.channel
    clock: Floats  # time_s, next step_s, pressure inside_pa


class Stages(NamedTuple):
    """What the stages of the last step found; the last stage is the step's end."""

    q: Floats  # (STAGES, coordinates)
    v: Floats
    a: Floats
    inside_pa: Floats  # (STAGES,)
    memory: Floats  # (STAGES, cells, 2, MEMORIES, 2)
    known_memory: Floats  # what each starts from: memory = known + step_s GAMMA memory'
    inlet: Floats  # (STAGES, STATES)
    known_inlet: Floats


class Limits(NamedTuple):
    """Limits of a step."""

    end_s: float
    max_step_s: float
    tolerance_m: float
    missing: float  # share of the tolerance at which Newton stops
    within_pa: float  # see straw.model.drive.seen
    remembers: bool
    steps: int  # most that may have been tried


class Work(NamedTuple):
    """Scratch arrays of a step, allocated once."""

    channel: Channel
    room: Room
    start: Chain  # the straw at the step's start
    memory_rate: Floats
    inlet_rate: Floats
    inlet: Floats
    newton: Articulated
    blocks: Floats
    K: Floats
    push: Floats
    yields: Floats
    left: Floats
    dq: Floats
    error_q: Floats
    error_v: Floats


@compiled
def stages_for(c: Constants, n: int) -> Stages:
    """Allocate the stages of a straw of n coordinates."""
    memory = np.zeros((STAGES, c.cells, 2, MEMORIES, 2))
    return Stages(
        np.zeros((STAGES, n)),
        np.zeros((STAGES, n)),
        np.zeros((STAGES, n)),
        np.zeros(STAGES),
        memory,
        memory.copy(),
        np.zeros((STAGES, STATES)),
        np.zeros((STAGES, STATES)),
    )


@compiled
def work_for(c: Constants, n: int) -> Work:
    """Scratch for a straw of n coordinates."""
    return Work(
        channel_of(c),
        room_for(c),
        empty_chain(c.cells),
        np.zeros((STAGES, c.cells, 2, MEMORIES, 2)),
        np.zeros((STAGES, STATES)),
        np.zeros(STATES),
        articulated_for(c),
        np.zeros((c.cells, 2, 2, 2)),
        np.zeros((c.cells, 2, 2, 2)),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
    )


@compiled
def limits_for(c: Constants, end_s: float, max_step_s: float, tolerance_m: float, steps: int) -> Limits:
    """Limits of the steps of a straw; ``steps`` may be tried in all."""
    channel = channel_of(c)
    carries = c.remembers or channel.gas_m3 > 0 or channel.inertance > 0 or channel.lag_s > 0
    missing = CARRIED_SHARE if carries else NEWTON_SHARE
    within_pa = SEEN_SHARE * tolerance_m * softest(c) / c.C3
    return Limits(end_s, max_step_s, tolerance_m, missing, within_pa, c.remembers, steps)


@allocates_nothing
def copy(of: Floats, into: Floats) -> None:
    """Copy what a row of numbers holds."""
    for i in range(len(of)):
        into[i] = of[i]


@allocates_nothing
def recall(start: Floats, rate: Floats, h: float, i: int, known: Floats) -> None:
    """What the frusta remember as stage i starts, into ``known`` (cells, 2, MEMORIES, 2)."""
    for at in range(len(start)):
        for f in range(2):
            for m in range(MEMORIES):
                for x in range(2):
                    total = start[at, f, m, x]
                    for j in range(i):
                        total += h * COEFFICIENTS[i, j] * rate[j, at, f, m, x]
                    known[at, f, m, x] = total


@allocates_nothing
def remembered_rate(known: Floats, now: Floats, hg: float, rate: Floats) -> None:
    """How fast what the frusta remember changes in a stage, into ``rate``."""
    for at in range(len(known)):
        for f in range(2):
            for m in range(MEMORIES):
                for x in range(2):
                    rate[at, f, m, x] = (now[at, f, m, x] - known[at, f, m, x]) / hg


@allocates_nothing
def arrive(state: State, s: Stages, time_s: float) -> None:
    """Put the state where the step's last stage is, at ``time_s``."""
    end = STAGES - 1
    copy(s.q[end], state.q)
    copy(s.v[end], state.v)
    copy(s.a[end], state.a)
    copy(s.inlet[end], state.inlet)
    recall(s.memory[end], s.memory, 0.0, 0, state.memory)
    state.clock[0], state.clock[2] = time_s, s.inside_pa[end]
