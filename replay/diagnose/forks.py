"""Where a run forks: repeats of the straw would go two ways, so what comes after says little of its constants.

Which of two cells snaps first, or to which side, can hang on less than repeats differ by. No law is to blame where a
run then takes another way than the model, and no fit should be drawn there: such a run is looked at until it forks.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.hypothesis import REPEATS_MOUNT, repeat_steps
from straw.replay.diagnose.judge import beyond_noise, run_by_run
from straw.replay.diagnose.misfit import Misfit
from straw.replay.diagnose.observation import SHORTEST, Observation
from straw.replay.diagnose.search import Fit

Floats = NDArray[np.float64]

#: Repeats looked at: so many standard deviations of each kind, and of both dampings at once. A fit is not the straw, so
#: what hangs on a fork there may be some way off here.
SIZES = (0.0, 1.0, 2.0, 4.0)
#: Two of them went two ways where this many sigmas lie between them, in the mean over this long (s), when what moves
#: may be late by this much (s); and so many times more than what lies between the two before, by step.
APART_SIGMAS, APART_S, LATE_S, MORE = 5.0, 0.1, 5e-3, 3.0
#: A run is far off that leaves this many sigmas squared beyond noise, and this many times what the middle one leaves.
FAR_OFF, TIMES = 300.0, 4.0
#: Shares of what a far run leaves beyond noise: that lies after its fork, and that another way the straw may take there
#: explains; only then what was recorded may be one of the ways of the same straw, of which there are many more.
AFTER, EXPLAINS = 0.5, 1 / 3
#: Where another way explains this share, the run has forked however little lies between the two, and not later than
#: where this share of what that explains is still to come.
ALL, TO_COME = 0.9, 0.98
#: A run ends this long before it forks, and as long before the last snap that would be so near its end, s.
BEFORE_S = 0.05


def forks(campaign: Campaign, fit: Fit) -> dict[str, float]:
    """When (s) those runs fork that are far off though most others are explained, by name."""
    left = np.array(run_by_run(campaign, fit))
    far = left > np.maximum(FAR_OFF, TIMES * np.median(left))
    out = {}
    for k in np.flatnonzero(far):
        name = campaign.observations[k].name
        at = _fork(campaign.only([name]), fit)
        if at is not None:
            out[name] = at
    return out


def _fork(one: Campaign, fit: Fit) -> float | None:
    """When the only run of a campaign forks; None where it does not, where that would not explain what it leaves
    beyond noise, or where hardly anything of it would be left."""
    (observed,) = one.observations
    unknowns, u = (*fit.unknowns, REPEATS_MOUNT), np.append(fit.u, 0.0)
    points = [u + sign * size * kind for kind in _repeats(fit) for sign in (1, -1) for size in SIZES[1:]]
    first, *others = (row[0] for row in one.misfits(unknowns, [u, *points]))
    if first is None:
        return None
    each = len(SIZES) - 1
    ends = [_parting(observed, [first, *others[k : k + each]]) for k in range(0, len(others), each)]
    at = min((end for end in ends if end is not None), default=float(np.inf))
    beyond = np.clip(first.shape**2 - 1, 0, None).sum(axis=0)
    ways = [one for one in (first, *others) if one is not None]
    left = [beyond_noise(one.vector, one.shape.size) for one in ways]
    explained = 1 - min(left) / max(left[0], 1.0)
    if explained > ALL:
        gained = (first.shape**2 - ways[int(np.argmin(left))].shape ** 2).sum(axis=0)
        to_come = np.cumsum(gained[::-1])[::-1]
        at = min(at, float(observed.time_s[max(np.flatnonzero(to_come > TO_COME * to_come[0]), default=0)]))
    elif beyond[observed.time_s >= at].sum() < AFTER * beyond.sum() or explained < EXPLAINS:
        return None
    shown = np.isfinite(first.late_s)
    at = _calm(at - BEFORE_S, [*observed.snaps_s, *(observed.snaps_s + first.late_s)[shown]])
    return at if np.count_nonzero(observed.time_s <= at) >= SHORTEST else None


def _calm(at: float, snaps_s: Sequence[float]) -> float:
    """The last moment up to then with no snap near."""
    while near := [t for t in snaps_s if abs(t - at) < BEFORE_S]:
        at = min(near) - BEFORE_S * 1.001  # a little more, or rounding might leave it near for ever
    return at


def _repeats(fit: Fit) -> list[Floats]:
    """Directions (unknowns + 1,) in u by which repeats may differ, a standard deviation each; the last of u is how the
    straw is mounted."""
    e = np.eye(len(fit.u) + 1)
    steps = {fit.unknowns[k].target: step * e[k] for k, step in repeat_steps(fit.unknowns).items()}
    dampings = [step for target, step in steps.items() if target.startswith("straw.c_")]
    both = [a + sign * b for a, b in itertools.combinations(dampings, 2) for sign in (1, -1)]
    return [*steps.values(), e[-1], *both]


def _parting(observed: Observation, ways: Sequence[Misfit | None]) -> float | None:
    """From when on (s) two neighbours among plays of one run are apart, though those before were not."""
    step_s = float(np.median(np.diff(observed.time_s)))
    long = max(1, round(APART_S / step_s))
    before = np.zeros(len(observed.time_s))
    out = []
    for k, (one, other) in enumerate(itertools.pairwise(ways)):
        if one is None or other is None:
            break
        sigmas = np.max(np.abs(other.plain - one.plain) / observed.sigma(LATE_S), axis=0)
        mean = uniform_filter1d(np.minimum(sigmas, 4 * APART_SIGMAS), long) / (SIZES[k + 1] - SIZES[k])
        apart = np.flatnonzero((mean > APART_SIGMAS / (SIZES[k + 1] - SIZES[k])) & (mean > MORE * before))
        if len(apart):
            out.append(float(observed.time_s[apart[0]] - APART_S / 2))
        before = mean
    return min(out, default=None)
