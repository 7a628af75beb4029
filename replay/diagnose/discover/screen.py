"""Every place with every state, to first order: the reduction of the prediction error by a table there.

The columns of a table's values come from the simulation; states that a channel measures are taken from the recording,
so that a law is evaluated where the system went, not where a wrong model went. The gain is profiled over the base's
constants (a score test) and cross-validated in short blocks: to first order no law predicts far.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.discover.blocks import blocks, how_asked, predicted
from straw.replay.diagnose.discover.trial import Trial, of_all, rough
from straw.replay.diagnose.inquiry import Told
from straw.replay.diagnose.systems.function.codes import (
    CHANNEL,
    OF_INPUT,
    OF_NOTHING,
    OF_RATE,
    OF_SPEED,
    OF_STATE,
    OF_TIME,
)
from straw.replay.diagnose.systems.function.laws import Law
from straw.replay.diagnose.systems.function.passed import Passed, defines, passed, smooth, still_speeds
from straw.replay.diagnose.systems.function.places import (
    as_simulated,
    hysteretic,
    its_own,
    makes_sense,
    places,
    points,
    reads,
    states,
)
from straw.replay.diagnose.systems.function.recording import HeldOut, Recorded
from straw.replay.diagnose.systems.function.shapes import CONSTANT, FOLLOWS, LINEAR, PLAY, TABLE
from straw.replay.diagnose.systems.function.stack import Stack, stacked
from straw.replay.diagnose.systems.function.system import FunctionSystem

Floats = NDArray[np.float64]

#: Half widths of a play from which it is fitted, in units of the state's span.
PLAYS = (0.01, 0.03, 0.1, 0.3)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A law to be tried: the share of the prediction error that remains to first order, and the step to it."""

    law: Law
    leaves: float
    step: Floats  # of the trial's unknowns and the law's


def screened(trial: Trial, pool: Executor, told: Told) -> tuple[list[Candidate], list[Passed]]:
    """All candidates beside a trial, the most promising first, and the states that the recordings visit."""
    system, campaign = trial.system, trial.campaign
    recordings = [one for one in campaign.observations if isinstance(one, Recorded)]
    seen = passed(system, recordings, trial.values)
    laws = [law for law in candidates(system, seen) if told_ahead(law, how_asked(campaign))]
    number, unknowns = len(system.laws), trial.fit.unknowns
    extended = [_with_measured(one) for one in seen]
    base = system.at(trial.values)
    alone = base.encoding(())
    shown, starts, stack = stacked(base, extended).profiled(base, alone, alone.at(np.zeros(0)), fresh=True)
    speeds = still_speeds(system, seen)
    measured = [_measured(system, law, speeds, list(seen[0].speeds)) for law in laws]
    jobs = [pool.submit(_columns, base, stack, (shown, starts), law, number) for law in measured]
    without = blocks(campaign, trial.fit.residual, trial.fit.slopes, fine=True)
    own = of_all(predicted(without, unknowns, trial.fit.u)[0].sum(axis=1))
    out = []
    for k, (law, job) in enumerate(zip(laws, jobs, strict=True)):
        told(f"{law.says}", k, len(laws))
        columns = job.result()
        if columns is None or not np.any(columns):
            continue
        every = (*unknowns, *law.unknowns(number)[: columns.shape[1]])
        u = np.concatenate([trial.fit.u, np.zeros(columns.shape[1])])
        both = blocks(campaign, trial.fit.residual, np.hstack([trial.fit.slopes, columns]), fine=True)
        errors, step = predicted(both, every, u, rough(every, (*system.laws, law)))
        out.append(Candidate(law, of_all(errors.sum(axis=1)) / own, step))
    return sorted(out, key=lambda c: c.leaves), seen


def lines(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Tables as straight lines through zero, which have fewer constants to be undetermined."""
    out = []
    for one in candidates:
        if one.law.shape != TABLE:
            continue
        law, at = replace(one.law, shape=LINEAR, at=()), np.array(one.law.at)
        rest, values = one.step[: -len(at)], one.step[-len(at) :] * one.law.unit
        out.append(replace(one, law=law, step=np.append(rest, values @ at / (at @ at) / law.unit)))
    return out


def told_ahead(law: Law, asked: HeldOut) -> bool:
    """Whether what is fitted can tell a law where it is asked: at later times it cannot tell one over time."""
    return not (asked.lies == "after" and law.state.kind == OF_TIME)


def candidates(system: FunctionSystem, seen: Sequence[Passed]) -> list[Law]:
    """Laws to screen: tables over states at every place, constants, straight lines over history."""
    many = range(len(system.model.states))
    out, speeds = [], {k for k in many if any(defines(of, k, seen) for of in many)}
    for place in places(system, seen):
        for state in states(system, seen):
            if its_own(place, state, system.model) and state.lag_s is not None:
                out.append(Law(place, state, FOLLOWS))
            elif its_own(place, state, system.model) or (hysteretic(place, state) and state.which not in speeds):
                out += [Law(place, replace(state, play=share * state.span), PLAY) for share in PLAYS]
            if not makes_sense(place, state):
                continue
            own, here = as_simulated(state, seen) if reads(place, state, system.model) else (state, seen)
            if state.kind == OF_NOTHING:
                law = Law(place, state, CONSTANT)
            elif state.lag_s is not None:
                law = Law(place, state, LINEAR)
            else:
                law = Law(place, own, TABLE, points(place, own, here))
                if len(law.at) < 3:
                    law = Law(place, own, LINEAR)
            out.append(law)
    return out


def _with_measured(of: Passed) -> Recorded:
    """The recording with its channels, their rates, and speeds as further inputs."""
    one = of.recording
    rows = [smooth(one, k, of.shown) for k in range(len(one.seen))]
    rates = [np.gradient(row, one.time_s) for row in rows]
    return replace(one, inputs=np.concatenate([one.inputs, rows, rates, *([row] for row in of.speeds.values())]))


def _measured(system: FunctionSystem, law: Law, speeds: Mapping[int, int], groups: Sequence[int]) -> Law:
    """The law over the state as measured, where a channel measures it or, of ``speeds``, that of which it is the
    rate, or over a speed of ``groups``. A channel's own reading is not explained by itself as measured: that would
    fit any channel."""
    names, state = [y.name for y in system.model.channels], law.state
    if state.kind == OF_SPEED:
        row = 2 * (len(system.model.inputs) + len(names)) + groups.index(state.which)
        return replace(law, state=replace(state, kind=OF_INPUT, which=row))
    if state.kind not in (OF_STATE, OF_RATE):
        return law
    speed = state.kind == OF_STATE and state.which in speeds
    name = system.model.states[speeds[state.which] if speed else state.which]
    if name not in names:
        return law
    if law.place.kind == CHANNEL and law.place.which == names.index(name):
        return law
    rate = speed or state.kind == OF_RATE
    row = 2 * len(system.model.inputs) + names.index(name) + (len(names) if rate else 0)
    return replace(law, state=replace(state, kind=OF_INPUT, which=row))


def _columns(base: FunctionSystem, stack: Stack, begun: tuple[Floats, Floats], law: Law, number: int) -> Floats | None:
    """Derivatives (m, values) of all recordings by a law's strengths at zero; None where the model cannot follow.

    Laws are linear in their strengths. ``begun``: channels and starts of the recordings as profiled without it.
    """
    system = base.with_laws(*base.laws, law)
    unknowns = tuple(k for k in law.unknowns(number) if not k.target.endswith((".lag_s", ".play")))
    out = stack.varied(system, system.encoding(unknowns), np.zeros(len(unknowns)), *begun)
    return out if np.isfinite(out).all() else None
