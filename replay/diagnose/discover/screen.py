"""Every place with every state, to first order: the reduction of the prediction error by a table there.

The columns of a table's values come from the simulation; states that a channel measures are taken from the recording,
so that a law is evaluated where the system went, not where a wrong model went. The gain is profiled over the base's
constants (a score test) and cross-validated.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.discover.blocks import blocks, predicted
from straw.replay.diagnose.discover.trial import Trial, rough
from straw.replay.diagnose.inquiry import Told
from straw.replay.diagnose.settings import STEP_U
from straw.replay.diagnose.systems.function.kernel import OF_INPUT, OF_NOTHING, OF_RATE, OF_STATE
from straw.replay.diagnose.systems.function.laws import Law
from straw.replay.diagnose.systems.function.places import Passed, makes_sense, passed, places, points, smooth, states
from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.shapes import CONSTANT, LINEAR, TABLE
from straw.replay.diagnose.systems.function.system import FunctionSystem

Floats = NDArray[np.float64]


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
    laws = candidates(system, seen)
    number, unknowns = len(system.laws), trial.fit.unknowns
    extended = [_with_measured(one) for one in recordings]
    base = system.at(trial.values)
    starts = [system.profiled(one, trial.values) for one in recordings]
    jobs = [pool.submit(_columns, base, extended, starts, _measured(system, law), number) for law in laws]
    alone = blocks(campaign, trial.fit.residual, trial.fit.slopes)
    own = float(predicted(alone, unknowns, trial.fit.u)[0].sum())
    out = []
    for k, (law, job) in enumerate(zip(laws, jobs, strict=True)):
        told(f"{law.says}", k, len(laws))
        columns = job.result()
        if columns is None or not np.any(columns):
            continue
        every = (*unknowns, *law.unknowns(number)[: columns.shape[1]])
        u = np.concatenate([trial.fit.u, np.zeros(columns.shape[1])])
        both = blocks(campaign, trial.fit.residual, np.hstack([trial.fit.slopes, columns]))
        error, step = predicted(both, every, u, rough(every, (*system.laws, law)))
        out.append(Candidate(law, float(error.sum()) / max(own, 1e-300), step))
    return sorted(out, key=lambda c: c.leaves), seen


def candidates(system: FunctionSystem, seen: Sequence[Passed]) -> list[Law]:
    """Laws to screen: tables over states at every place, constants, straight lines over history."""
    out = []
    for place in places(system, seen):
        for state in states(system, seen):
            if not makes_sense(place, state):
                continue
            if state.kind == OF_NOTHING:
                law = Law(place, state, CONSTANT)
            elif state.lag_s is not None:
                law = Law(place, state, LINEAR)
            else:
                law = Law(place, state, TABLE, points(place, state, seen))
                if len(law.at) < 3:
                    law = Law(place, state, LINEAR)
            out.append(law)
    return out


def _with_measured(one: Recorded) -> Recorded:
    """The recording with its channels, and their rates, as further inputs."""
    rows = [smooth(one, k) for k in range(len(one.seen))]
    rates = [np.gradient(row, one.time_s) for row in rows]
    return replace(one, inputs=np.concatenate([one.inputs, rows, rates]))


def _measured(system: FunctionSystem, law: Law) -> Law:
    """The law over the state as measured, where a channel measures it."""
    names = [y.name for y in system.model.channels]
    if law.state.kind not in (OF_STATE, OF_RATE) or system.model.states[law.state.which] not in names:
        return law
    channel = names.index(system.model.states[law.state.which])
    row = 2 * len(system.model.inputs) + channel + (len(names) if law.state.kind == OF_RATE else 0)
    return replace(law, state=replace(law.state, kind=OF_INPUT, which=row))


def _columns(
    base: FunctionSystem,
    recordings: Sequence[Recorded],
    starts: Sequence[tuple[Floats, Floats, Floats]],
    law: Law,
    number: int,
) -> Floats | None:
    """Derivatives (m, values) of all recordings by a law's strengths at zero; None where the model cannot follow.

    One-sided differences: laws are linear in their strengths. ``starts`` are the recordings' as profiled without it.
    """
    system = base.with_laws(*base.laws, law)
    unknowns = tuple(k for k in law.unknowns(number) if not k.target.endswith("lag_s"))
    rows = []
    for one, (shown, start, own) in zip(recordings, starts, strict=True):
        columns = np.zeros((one.seen.size + 1, len(unknowns)))
        for k in range(len(unknowns)) if one.fitted.any() else ():
            values = system.values(unknowns, STEP_U * np.eye(len(unknowns))[k])
            moved = (system.played(one, values, start)[0] - shown) / STEP_U / np.array(system.sigma)[:, None]
            columns[:-1, k] = np.where(one.fitted & np.isfinite(one.seen), moved, 0.0).ravel()
        if own.size and one.fitted.any():
            q, _ = np.linalg.qr(np.vstack([own, np.zeros((1, own.shape[1]))]))
            columns -= q @ (q.T @ columns)
        rows.append(columns)
    out = np.concatenate(rows)
    return out if np.isfinite(out).all() else None
