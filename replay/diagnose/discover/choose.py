"""The choice among fitted laws, by cross-validation: relevant, distinguishable, and the simplest form."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.discover.trial import Trial, covariance_of, of_all
from straw.replay.diagnose.settings import WORSE
from straw.replay.diagnose.systems.function.codes import (
    ALONG,
    CHANNEL,
    CLOCK,
    DELAY,
    FACTOR,
    INPUT,
    OF_INPUT,
    OF_SHOWN,
    OF_TIME,
    RATE,
    SHIFT,
    STRENGTH,
)
from straw.replay.diagnose.systems.function.laws import Law
from straw.replay.diagnose.systems.function.shapes import (
    CUBE,
    LINEAR,
    PLAY,
    POWER,
    QUADRATIC,
    ROOT,
    SQUARE,
    TABLE,
    YIELDS,
)

Floats = NDArray[np.float64]

#: A law is relevant when it reduces the root mean square prediction error by a tenth; less would not count as found.
OF_NOTE = 0.9**2
#: A drift is relevant when it halves it: what changes once in a recording goes with time a little, whatever it is.
OF_DRIFT = 0.5**2
#: What was chosen is accepted if its held-out RMS is at most this share of the base's: half of a relevant improvement.
HELD = 0.95
#: Difference of Schwarz's criterion that is strong evidence (Kass and Raftery 1995: 6 to 10).
STRONG = 10.0
#: Standard deviations of the blockwise difference within which two laws explain equally well.
TOLD_APART = 2.0
#: Squared error of twice the error. Where that did not distinguish, 36 of 50 planted systems would be found in place of
#: 42, and nothing wrong either way (`python -m tests.benchmarks.planted`).
TWICE = 4.0
#: Shapes that are powers of the state's magnitude.
EXPONENTS = {ROOT: 0.5, LINEAR: 1.0, SQUARE: 2.0, QUADRATIC: 2.0, CUBE: 3.0}
#: Laws whose prediction errors differ by less are the same in another form.
OF_NEARLY = 0.95


def written(trials: Sequence[Trial]) -> list[Trial]:
    """For each place and state the simplest of the best (`_near_best`); the best first, and among nearly equal ones
    those in an equation first."""
    groups: dict[tuple[str, str], list[Trial]] = {}
    worth = min((one.worth for one in trials), default=1.0)

    def order(one: Trial) -> tuple[float, ...]:
        return *simplest(one), one.evidence(worth)

    for one in trials:
        groups.setdefault((one.laws[-1].place.name, one.laws[-1].over), []).append(one)
    out = [min(_near_best(group, worth), key=order) for group in groups.values()]
    out.sort(key=lambda one: one.predicts)
    if out:
        near = [one for one in out if OF_NEARLY * one.predicts <= out[0].predicts]
        out = [*sorted(near, key=order), *(one for one in out if one not in near)]
        if drifts(out[0].laws[-1]):  # time is no cause: a law that is as good as a drift comes before it
            causes = [one for one in out if not drifts(one.laws[-1]) and not apart(one, out[0])]
            out = [*causes, *(one for one in out if one not in causes)]
    return out


def _near_best(group: Sequence[Trial], worth: float) -> list[Trial]:
    """Those that predict nearly as well as the best; of formulas those against which Schwarz's criterion is no strong
    evidence for another that leaves no more than noise, so that likelihoods are right."""
    best = min(one.predicts for one in group)
    near = [one for one in group if OF_NOTE * one.predicts <= best]
    right = [one for one in near if one.laws[-1].shape != TABLE and one.to_noise]
    least = min((one.evidence(worth) for one in right), default=np.inf)
    return [one for one in near if one.laws[-1].shape == TABLE or one.evidence(worth) <= least + STRONG]


def drifts(law: Law) -> bool:
    """Whether a law is over time, where nothing repeats and anything can be fitted."""
    return law.state.kind == OF_TIME and law.place.kind != CLOCK


def rivals(law: Law, accepted: Law) -> bool:
    """Whether a law differs from an accepted one.

    A law over the history of a state includes the one over the state, with zero lag; hysteresis includes dry friction,
    with no play, and a spring, with more than is visited. An equation over time is excluded: time is no cause, and
    without repetition it correlates with everything; an instrument may drift with it.
    """
    if law.shape in (PLAY, YIELDS) and law.place.name == accepted.place.name and not accepted.state.remembers:
        return False
    if (law.place.name, law.state.name) == (accepted.place.name, accepted.state.name):
        return accepted.state.lag_s is not None and law.state.lag_s is None
    return law.state.kind != OF_TIME or drifts(accepted) or law.place.kind in (CHANNEL, INPUT, CLOCK)


def forms_of(accepted: Trial, trials: Sequence[Trial]) -> list[Trial]:
    """Trials of other shapes that cannot be distinguished from an accepted formula, the best first.

    At one place and over one state, Schwarz's criterion distinguishes forms, too.
    """
    law = accepted.laws[-1]
    if law.shape == TABLE:
        return []
    out = []
    for one in trials:
        other = one.laws[-1]
        here = (other.place.name, other.over) == (law.place.name, law.over)
        another = here and other.shape not in (TABLE, law.shape) and not same_form(one, accepted)
        if another and not of_note(accepted, one) and not apart(one, accepted):
            out.append(one)
    return out


def degenerate(one: Trial, accepted: Trial) -> bool:
    """Whether the last formula of a trial has more constants than an accepted one, or one of them at its bound: where
    both are the same curve, it is that of the accepted, as a saturation far beyond what was visited is a line."""
    last = [k for k, unknown in enumerate(one.fit.unknowns) if unknown.target.startswith(f"law.{len(one.laws) - 1}.")]
    at_bound = any(one.fit.u[k] in (one.fit.unknowns[k].low, one.fit.unknowns[k].high) for k in last)
    return at_bound or len(last) > len(accepted.laws[-1].unknowns(0))


def same_form(one: Trial, accepted: Trial) -> bool:
    """Whether a shape is that of an accepted formula: a square with sign of a state that has one sign, or a power whose
    exponent is determined as that of the formula."""
    law, other = accepted.laws[-1], one.laws[-1]
    exponent, state = EXPONENTS.get(law.shape), law.state
    if exponent is None or (law.shape == QUADRATIC and state.signed):
        return False
    if other.shape == POWER:
        k = [unknown.target for unknown in one.fit.unknowns].index(f"law.{len(one.laws) - 1}.exponent")
        unknown, u, sd = one.fit.unknowns[k], float(one.fit.u[k]), float(np.sqrt(covariance_of(one)[k, k]))
        return unknown.value(u - TOLD_APART * sd) <= exponent <= unknown.value(u + TOLD_APART * sd)
    return EXPONENTS.get(other.shape) == exponent and not state.signed


def of_note(one: Trial, current: Trial) -> bool:
    """Whether a trial predicts better by a relevant share, beyond the cost of its constants; a drift, by half."""
    if one.laws[-1].beyond and not outside_range(one):
        return False  # a better fit of the base, not a law
    share = OF_DRIFT if drifts(one.laws[-1]) else OF_NOTE
    return one.predicts < share * current.predicts and against(current, one)


def outside_range(one: Trial) -> bool:
    """Whether the last law of a trial, a factor on a constant, takes it out of the range that the file gives."""
    which, strength = one.laws[-1].place.which, one.values[f"law.{len(one.laws) - 1}.strength"]
    constant = one.system.model.constants[which]
    return not constant.low <= float(one.system.constants(one.values)[which]) * (1 + strength) <= constant.high


def fitting(trials: Sequence[Trial], current: Trial) -> list[Trial]:
    """Trials that fit better beyond the cost of their constants, whether they predict or not, the best first."""
    worth = min([current.worth, *(one.worth for one in trials)])
    better = [one for one in trials if one.evidence(worth) < current.evidence(worth) - STRONG]
    return sorted(better, key=lambda one: one.evidence(worth))


def holds(before: Floats, after: Floats) -> bool:
    """Whether held-out RMS (channels,) is better after than before, of all channels and clearly worse in none."""
    better = of_all(after**2) < HELD**2 * of_all(before**2)
    return better and not np.any(after > WORSE * before)


def refusals(held: Sequence[Floats]) -> int:
    """How many of the last trials to refuse, by the held-out RMS (channels,) of the base and each: those that are no
    better than what they were added to, and all where what then remains is no better than the base."""
    kept = len(held) - 1
    while kept and not holds(held[kept - 1], held[kept]):
        kept -= 1
    if kept and not holds(held[0], held[kept]):
        kept = 0
    return len(held) - 1 - kept


def simplest(one: Trial) -> tuple[float, ...]:
    """Among laws that predict equally well a formula comes before a table, fewer constants before more, a law over a
    state before one over a rate, a constant beyond its range before any, and one in an equation before the same effect
    in a constant, an input or an instrument; what is equally simple, by Schwarz's criterion."""
    law = one.laws[-1]
    order = (SHIFT, RATE, ALONG, CHANNEL, STRENGTH, FACTOR, DELAY, INPUT, CLOCK).index(law.place.kind)
    own = law.place.kind == CHANNEL and law.state.kind == OF_SHOWN
    if law.beyond:
        order = -1
    constants = len(law.unknowns(0)) + 2 * law.state.remembers
    return drifts(law), law.shape == TABLE, constants, law.state.is_rate, order + 4 * own


def same_channels(one: Trial, accepted: Trial, current: Trial) -> bool:
    """Whether a trial improves a channel, by a relevant share, that the accepted one improves: what explains another
    channel is no rival, but perhaps the next law."""
    improved, also = (trial.squared < OF_NOTE * current.squared for trial in (accepted, one))
    return bool(np.any(improved & also))


def against(one: Trial, other: Trial) -> bool:
    """Whether Schwarz's criterion is strong evidence against the first."""
    worth = min(one.worth, other.worth)
    return one.evidence(worth) > other.evidence(worth) + STRONG


def distinguished(one: Trial, accepted: Trial, inputs: int) -> bool:
    """Whether an accepted law can be told from another. Over the rate of one of so many inputs it is to first order a
    delay, so a late clock or a delay is a rival unless it leaves twice the error."""
    law, other = accepted.laws[-1], one.laws[-1]
    of_rate = law.state.kind == OF_INPUT and law.state.which >= inputs
    if of_rate and other.place.kind in (CLOCK, DELAY) and one.predicts <= TWICE * accepted.predicts:
        return False
    return apart(one, accepted)


def apart(one: Trial, other: Trial) -> bool:
    """Whether the first is worse than the second: by a relevant share, and blockwise by more than chance; or by twice
    the error, with Schwarz's criterion strongly against it, as one block may have all of it."""
    if OF_NOTE * one.predicts <= other.predicts:
        return False
    if one.predicts > TWICE * other.predicts and against(one, other):
        return True
    difference = (one.error - other.error)[one.error > 0]
    spread = float(np.std(difference, ddof=1)) * np.sqrt(len(difference)) if len(difference) > 1 else 0.0
    return float(np.sum(difference)) > TOLD_APART * spread


def of_one_kind(one: Trial, trials: Sequence[Trial]) -> list[Trial]:
    """A trial and all others whose last law has its place and state, in whatever form."""
    law = one.laws[-1]
    return [one, *(x for x in trials if (x.laws[-1].place.name, x.laws[-1].over) == (law.place.name, law.over))]
