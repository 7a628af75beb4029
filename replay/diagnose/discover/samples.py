"""The samples of a search: what it sees, what it predicts, how finely these are integrated, and the held-out error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.discover.blocks import how_held
from straw.replay.diagnose.discover.trial import Trial
from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.system import FunctionSystem

Floats = NDArray[np.float64]

#: Samples that suffice where nothing is integrated: a law of a dozen constants needs hundreds.
ENOUGH = 4000
#: Samples at least of each held-out recording whose prediction is looked at.
FEWEST = 50
#: The longest step of an integration is at first this many times the median interval of samples.
LATE = 1.25


def asked_as(some: Sequence[Recorded], recordings: Sequence[Recorded]) -> tuple[Recorded, ...]:
    """Recordings that know how they must predict what is held out of all of them."""
    return tuple(replace(one, asked=how_held(some, recordings)) for one in some)


def to_predict(system: FunctionSystem, recordings: Sequence[Recorded]) -> tuple[Recorded, ...]:
    """Held-out recordings without readings but those that tell their starts; of many samples the first."""
    whole = [one for one in recordings if one.held.any() and not one.fitted.any()]
    blind = [replace(one, seen=np.where(one.tells_start, one.seen, np.nan)) for one in whole]
    most = max(ENOUGH // max(len(blind), 1), FEWEST)
    if not system.model.states:
        return tuple(one.every(max(1, len(one.time_s) // most)) for one in blind)
    return tuple(one.until(most) for one in blind)


def thinned(system: FunctionSystem, recordings: Sequence[Recorded]) -> list[Recorded]:
    """The search's samples where there are more than it needs: evenly thinned ones, or, where a system is integrated
    from sample to sample, the first recordings. Accepted laws are finally fitted to all."""
    every = int(np.ceil(sum(int(o.fitted.sum()) for o in recordings) / ENOUGH))
    if every < 2:
        return list(recordings)
    if not system.model.states:
        return [o.every(every) for o in recordings]
    kept, total = [], 0
    for one in recordings:
        if one.fitted.any() and total < ENOUGH:
            kept.append(one)
            total += int(one.fitted.sum())
    return kept


def longest_step(system: FunctionSystem, recordings: Sequence[Recorded]) -> float:
    """The longest step (s) whose halving changes the result by less than a tenth of a sigma."""
    if system.model.plain or not system.model.states:
        return np.inf
    # a sample that is a little late needs no second step
    step = LATE * float(np.median(np.concatenate([np.diff(o.time_s) for o in recordings])))
    some = recordings[:3]

    def shown(longest_s: float) -> list[Floats]:
        here = replace(system, longest_s=longest_s)
        return [here.played(o, here.fixed, here.started(o)[0])[0] for o in some]

    before = shown(step)
    for _ in range(8):
        after = shown(step / 2)
        off = [np.max(np.abs(a - b) / np.array(system.sigma)[:, None]) for a, b in zip(before, after, strict=True)]
        if np.isfinite(off).all() and max(off) < 0.1:
            break
        step, before = step / 2, after
    return step


def held_out(trial: Trial, recordings: Sequence[Recorded]) -> Floats:
    """Held-out RMS, (channels,), in the channels' units; where nothing is held out, of the fit."""
    total, count = np.zeros(len(trial.unit)), np.zeros(len(trial.unit))
    for one in recordings:
        where = one.held if any(o.held.any() for o in recordings) else one.fitted
        if not where.any():
            continue
        shown = trial.system.simulated(one, trial.fit.unknowns, trial.fit.u)
        off = (shown - one.seen)[:, where]
        good = np.isfinite(one.seen[:, where])
        total += np.sum(np.where(good, off, 0.0) ** 2, axis=1)
        count += good.sum(axis=1)
    return np.asarray(np.sqrt(total / np.maximum(count, 1)))
