"""Whether two laws are one law in two places: the same right-hand sides wherever the recordings went."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.discover.trial import Trial
from straw.replay.diagnose.systems.function.codes import CLOCK, DELAY
from straw.replay.diagnose.systems.function.passed import typical
from straw.replay.diagnose.systems.function.recording import Recorded

Floats = NDArray[np.float64]

#: Right-hand sides are compared in so many samples, and are the same where they differ by less than this share (RMS) of
#: what the law changes of the base's: a tenth, less than which no law is relevant.
ASKED, SAME = 240, 0.1


def written_otherwise(one: Trial, other: Trial, base: Trial, recordings: Sequence[Recorded]) -> bool:
    """Whether the last laws of two trials turn one ``base`` into the same equations.

    Every trial has its own constants: a straight line in a force is the same as another stiffness. A law over history
    is the same as none but itself; clocks and delays are no equations.
    """
    for trial in (one, other):
        law = trial.laws[-1]
        if law.place.kind in (CLOCK, DELAY) or law.state.remembers:
            return False
    total = sum(len(r.time_s) for r in recordings)
    apart = changed = 0.0
    for recording in recordings:
        every = max(1, -(-total // ASKED))
        at = np.arange(0, len(recording.time_s) - 1, every)
        states = one.system.played(recording, one.values, one.system.profiled(recording, one.values)[1])[1]
        rows = [right_hand_side(trial, recording, states, at) for trial in (one, other, base)]
        size = np.array([[typical(row)] for row in rows[0]])
        mine, theirs, bare = (row / size for row in rows)
        good = np.isfinite(mine + theirs + bare)
        apart += float(np.sum((mine - theirs)[good] ** 2))
        changed += float(np.sum((mine - bare)[good] ** 2))
    return apart < SAME**2 * changed


def right_hand_side(trial: Trial, recording: Recorded, states: Floats, at: NDArray[np.int64]) -> Floats:
    """Rates of the states, and the channels, (states + channels, n), by a trial's equations at
    ``states`` (states with lagging ones, samples) of some samples (n,)."""
    system, values = trial.system, trial.values
    many = len(system.model.states)
    if many == 0:
        return system.profiled(recording, values)[0][:, at]
    out = np.empty((many + len(system.channels), len(at)))
    for column, k in enumerate(at):
        two = replace(recording, time_s=recording.time_s[k : k + 2], inputs=recording.inputs[:, k : k + 2])
        shown, _, rates = system.played(two, values, states[:many, k])
        out[:many, column], out[many:, column] = rates[:many, 0], shown[:, 0]
    return out
