"""Builds the missing part law by law: screens every place and state, fits the best, writes them as formulas.

A law is accepted where it reduces the prediction error by a relevant share, beyond the cost of its constants, and the
held-out error too. A law that is worse on held-out samples is never shown as an improvement.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.discover.blocks import BLOCKS
from straw.replay.diagnose.discover.choose import (
    FITTED,
    OF_NEARLY,
    OF_NOTE,
    apart,
    better,
    forms_of,
    of_note,
    picked,
    rivals,
    written,
)
from straw.replay.diagnose.discover.formulas import formulas
from straw.replay.diagnose.discover.inline import Inline, never
from straw.replay.diagnose.discover.same import written_otherwise
from straw.replay.diagnose.discover.screen import Candidate, screened
from straw.replay.diagnose.discover.trial import LAST_ROUNDS, LAST_SHARE, Trial, noise_in, rough, tried
from straw.replay.diagnose.fit import cost_at
from straw.replay.diagnose.inquiry import Told, silent
from straw.replay.diagnose.systems.function.kernel import STRENGTH
from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.shapes import TABLE
from straw.replay.diagnose.systems.function.system import FunctionSystem

Floats = NDArray[np.float64]

#: Laws accepted at most; written as formulas.
LAWS, FORMULAS = 3, 3
#: Samples that suffice where nothing is integrated: a law of a dozen constants needs hundreds.
ENOUGH = 4000
#: The base explains a held-out channel if its RMS is within this multiple of the noise.
TO_NOISE = 1.3


@dataclass(frozen=True, eq=False)
class Step:
    """One round: the trial accepted, if any; all fitted ones, the best first; those that cannot be distinguished from
    it.

    ``same`` are the accepted law in other places, ``forms`` names of other shapes that it may have, ``errors``
    (1 + alike, blocks) those of accepted and alike on the search's samples.
    """

    accepted: Trial | None
    fitted: tuple[Trial, ...]
    alike: tuple[Trial, ...]
    promised: tuple[Candidate, ...]
    same: tuple[Trial, ...] = ()
    forms: tuple[str, ...] = ()
    errors: Floats = field(default_factory=lambda: np.zeros((1, 1)))


@dataclass(frozen=True, eq=False)
class Discovery:
    """The base's trial and the rounds; ``held``: held-out RMS (channels,) of each."""

    base: Trial
    steps: tuple[Step, ...]
    noise: Floats
    held: tuple[Floats, ...] = field(default=())  # of the base, then of each accepted trial
    whole: bool = True

    @property
    def accepted(self) -> list[Trial]:
        """Trials accepted, in order."""
        return [step.accepted for step in self.steps if step.accepted]

    @property
    def best(self) -> Trial:
        """The last accepted, or the base's."""
        return ([self.base, *self.accepted])[-1]


def discover(
    system: FunctionSystem,
    recordings: Sequence[Recorded],
    *,
    executor: Executor,
    told: Told = silent,
    stop: Callable[[], bool] = never,
) -> Discovery:
    """Fit the base, then add laws while they improve the prediction; if stopped, the accepted ones count."""
    told("base model", 0, LAWS + 1)
    whole, recordings = recordings, thinned(system, recordings)
    base = with_unseen(base_trial(system, recordings), whole)
    noise = noise_in(recordings)
    held = [held_out(base, whole)]
    steps: list[Step] = []
    if not np.all(held[0] <= TO_NOISE * noise):
        for k in range(LAWS):
            current = steps[-1].accepted if steps else base
            if stop() or current is None:
                break
            told("laws that may be missing", k + 1, LAWS + 1)
            step = one_round(current, whole, held[-1], base.unit, executor, stop)
            steps.append(step)
            if step.accepted is None:
                break
            held.append(held_out(step.accepted, whole))
    steps = [replace(one, accepted=on_all(one.accepted, whole) if one.accepted else None) for one in steps]
    base = on_all(base, whole)
    held = [held_out(one, whole) for one in (base, *(s.accepted for s in steps if s.accepted))]
    return Discovery(base, tuple(steps), noise, tuple(held), not stop())


def base_trial(system: FunctionSystem, recordings: Sequence[Recorded]) -> Trial:
    """The base from its file's values and from across their ranges, sigma following the fit."""
    spread = [float(np.nanstd(np.concatenate([o.seen[k] for o in recordings]))) for k in range(len(system.channels))]
    noise = noise_in(recordings)
    wide = replace(system, sigma=tuple(float(x) for x in np.maximum(0.1 * np.array(spread), noise)))
    wide = replace(wide, longest_s=longest_step(wide, recordings))
    campaign = Campaign(recordings, wide, Inline())
    fit, _ = wide.fit_base(campaign, [])
    first = tried(campaign, fit.unknowns, fit.u, np.array(wide.sigma), tempered=4)
    unit = np.array(first.system.sigma)
    finer = replace(first.system, longest_s=longest_step(first.system.at(first.values), recordings))
    return tried(campaign.with_system(finer), fit.unknowns, first.fit.u, unit)


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
    step = float(np.median(np.concatenate([np.diff(o.time_s) for o in recordings])))
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


def with_unseen(trial: Trial, recordings: Sequence[Recorded]) -> Trial:
    """The trial with its held-out squared errors, by blocks, in its unit."""
    out = []
    total = max(sum(int(one.held.sum()) for one in recordings), 1)
    runs = [one for one in trial.campaign.observations if isinstance(one, Recorded)]
    fewer = sum(int(one.fitted.sum()) for one in runs) / total
    for one in recordings:
        if not one.held.any():
            continue
        shown = trial.system.simulated(one, trial.fit.unknowns, trial.fit.u)
        off = ((shown - one.seen) / trial.unit[:, None])[:, one.held]
        square = np.nansum(np.nan_to_num(off, nan=0.0, posinf=1e6, neginf=-1e6) ** 2, axis=0)
        out += [float(part.sum()) for part in np.array_split(square, max(1, round(BLOCKS * one.held.sum() / total)))]
    # held-out and fitted samples have equal weight, whichever are more
    noise = noise_in(recordings) / trial.unit
    least = float(np.sum(noise**2)) * sum(int(one.held.sum()) for one in recordings) * fewer
    return replace(trial, unseen=np.array(out) * fewer, noise=trial.noise + (0.0 if len(trial.unseen) else least))


def polished(trial: Trial, recordings: Sequence[Recorded]) -> Trial:
    """A trial fitted to its end."""
    start = trial.fit
    end = tried(trial.campaign, start.unknowns, start.u, trial.unit, rounds=LAST_ROUNDS, share=LAST_SHARE)
    return with_unseen(end, recordings)


def pruned(trial: Trial, recordings: Sequence[Recorded], held: Floats) -> Trial:
    """The trial without earlier laws that its last law has made redundant (backward elimination)."""
    for number in range(len(trial.laws) - 2, -1, -1):
        if any(law.place.kind == STRENGTH for law in trial.laws[number + 1 :]):
            continue  # it may multiply this one
        laws = [law for k, law in enumerate(trial.laws) if k != number]
        named = [(k, int(one.target.split(".")[1])) for k, one in enumerate(trial.fit.unknowns) if _of_law(one.target)]
        keep = [k for k, of in named if of != number]
        constants = [k for k, one in enumerate(trial.fit.unknowns) if not _of_law(one.target)]
        unknowns = [trial.fit.unknowns[k] for k in constants]
        unknowns += [one for k, law in enumerate(laws) for one in law.unknowns(k)]
        campaign = trial.campaign.with_system(trial.system.with_laws(*laws))
        fewer = with_unseen(tried(campaign, unknowns, trial.fit.u[[*constants, *keep]], trial.unit), recordings)
        if OF_NEARLY * fewer.predicts <= trial.predicts and better(fewer, held, held_out(fewer, recordings)):
            trial = fewer
    return trial


def _of_law(target: str) -> bool:
    return target.startswith("law.")


def on_all(trial: Trial, recordings: Sequence[Recorded]) -> Trial:
    """A trial of some recordings, fitted to all."""
    runs: Sequence[Any] = trial.campaign.observations
    if sum(int(o.fitted.sum()) for o in runs) == sum(int(o.fitted.sum()) for o in recordings):
        return trial
    campaign = Campaign(recordings, trial.system, Inline())
    return with_unseen(tried(campaign, trial.fit.unknowns, trial.fit.u, trial.unit, tempered=1), recordings)


def one_round(
    current: Trial, recordings: Sequence[Recorded], held: Floats, unit: Floats, pool: Executor, stop: Callable[[], bool]
) -> Step:
    """Screen, fit, write as formulas, accept or not."""
    runs = [one for one in current.campaign.observations if isinstance(one, Recorded)]
    promised, seen = screened(current, pool, silent)
    jobs = [pool.submit(_fitted, current, candidate, unit) for candidate in picked(promised)]
    tables = sorted((job.result() for job in jobs), key=lambda one: one.predicts)
    if not tables:
        return Step(None, (), (), tuple(promised[:FITTED]))
    near = [one for one in tables if one.predicts < OF_NOTE * current.predicts][:FORMULAS]
    open_ = [one for one in near if one.laws[-1].shape == TABLE or one.laws[-1].state.lag_s]
    more = [pool.submit(formulas, one, current, seen) for one in open_]
    every = [*tables]
    for job in more:
        every += job.result()
    every = [job.result() for job in [pool.submit(with_unseen, one, recordings) for one in every]]
    every.sort(key=lambda one: one.predicts)
    left = [one for one in written(every) if of_note(one, current)]
    accepted = next((one for one in left if better(one, held, held_out(one, recordings))), None)
    if accepted is not None:
        last = polished(accepted, recordings)
        if last.predicts < accepted.predicts and better(last, held, held_out(last, recordings)):
            every[every.index(accepted)] = left[left.index(accepted)] = last
            accepted = last
        accepted = at_once(accepted, recordings, held)
        alike = [one for one in left if rivals(one.laws[-1], accepted.laws[-1]) and not apart(one, accepted)]
        same = [one for one in alike if written_otherwise(accepted, one, current, runs)]
        alike = [one for one in alike if one not in same]
        forms = forms_of(accepted, every)
        accepted = pruned(accepted, recordings, held)
        errors = np.array([one.errors for one in (accepted, *alike)])
        return Step(accepted, tuple(every), tuple(alike), tuple(promised[:FITTED]), tuple(same), forms, errors)
    return Step(None, tuple(every), (), tuple(promised[:FITTED]))


def at_once(trial: Trial, recordings: Sequence[Recorded], held: Floats) -> Trial:
    """The trial with its last law over the state itself, where a lag gives no relevant improvement."""
    law, number = trial.laws[-1], len(trial.laws) - 1
    if law.state.lag_s is None:
        return trial
    prompt = replace(law, state=replace(law.state, lag_s=None))
    keep = [k for k, one in enumerate(trial.fit.unknowns) if one.target != f"law.{number}.lag_s"]
    campaign = trial.campaign.with_system(trial.system.with_laws(*trial.laws[:-1], prompt))
    unknowns = [trial.fit.unknowns[k] for k in keep]
    fewer = with_unseen(tried(campaign, unknowns, trial.fit.u[keep], trial.unit), recordings)
    return (
        fewer
        if OF_NOTE * fewer.predicts <= trial.predicts and better(fewer, held, held_out(fewer, recordings))
        else trial
    )


def _fitted(current: Trial, candidate: Candidate, unit: Floats) -> Trial:
    """A candidate fitted from zero strength, or from its first-order estimate, whichever has less misfit."""
    laws = (*current.laws, candidate.law)
    system = current.system.with_laws(*laws)
    unknowns = (*current.fit.unknowns, *candidate.law.unknowns(len(current.laws)))
    zero = np.concatenate([current.fit.u, candidate.law.start(len(current.laws))])
    step = np.pad(candidate.step, (0, len(zero) - len(candidate.step)))
    campaign = current.campaign.with_system(system)
    low, high = (np.array([getattr(k, end) for k in unknowns]) for end in ("low", "high"))
    points = [np.clip(zero + share * step, low, high) for share in (0.0, 0.1, 0.4, 1.0)]
    smooth = rough(unknowns, laws)
    costs = [cost_at(unknowns, u, r, smooth) for u, r in zip(points, campaign.residuals(unknowns, points), strict=True)]
    return tried(campaign, unknowns, points[int(np.argmin(costs))], unit)
