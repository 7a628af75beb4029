"""Builds the missing part law by law: screens every place and state, fits the best, writes them as formulas.

A law is chosen where it reduces the cross-validated error by a relevant share, beyond its constants' cost, on folds of
what was fitted, arranged like the hold-out. What is held out is asked at the end, to refuse laws that do not help.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.discover.choose import (
    OF_NOTE,
    degenerate,
    distinguished,
    fitting,
    forms_of,
    of_note,
    of_one_kind,
    refusals,
    rivals,
    same_channels,
    written,
)
from straw.replay.diagnose.discover.formulas import formulas, gradual
from straw.replay.diagnose.discover.inline import Inline, never
from straw.replay.diagnose.discover.pick import FITTED, elsewhere, picked
from straw.replay.diagnose.discover.rounds import Discovery, Step
from straw.replay.diagnose.discover.same import written_otherwise
from straw.replay.diagnose.discover.samples import asked_as, held_out, longest_step, thinned, to_predict
from straw.replay.diagnose.discover.screen import Candidate, lines, screened
from straw.replay.diagnose.discover.simplify import merged, pruned, refined, without_lag
from straw.replay.diagnose.discover.trial import LAST_ROUNDS, LAST_SHARE, Trial, noise_in, rough, tried
from straw.replay.diagnose.fit import cost_at
from straw.replay.diagnose.inquiry import Told, silent
from straw.replay.diagnose.one_thread import one_blas_thread
from straw.replay.diagnose.systems.function.laws import Law
from straw.replay.diagnose.systems.function.least import least
from straw.replay.diagnose.systems.function.passed import Passed
from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.shapes import PLAY, SHAPES, TABLE
from straw.replay.diagnose.systems.function.stack import Stacked
from straw.replay.diagnose.systems.function.system import FunctionSystem

Floats = NDArray[np.float64]

#: Evaluations of a law's own fit with all else held, where only its constants of shape are not linear.
HELD_ROUNDS = 3
#: Laws chosen at most; places and states of which a law is written as formulas.
LAWS, FORMULAS = 3, 4


@one_blas_thread()
def discover(
    system: FunctionSystem,
    recordings: Sequence[Recorded],
    *,
    executor: Executor,
    told: Told = silent,
    stop: Callable[[], bool] = never,
) -> Discovery:
    """Fit the base, then add laws while they improve the prediction; if stopped, the chosen ones count.

    Held-out readings are taken away at first, and asked at the end how many of the chosen laws to keep (`refusals`).
    """
    told("base model", 0, LAWS + 1)
    searched = asked_as([one.without_held() for one in recordings if one.fitted.any()], recordings)
    base = base_trial(system, asked_as(thinned(system, searched), recordings), to_predict(system, recordings))
    noise = noise_in(recordings)
    steps: list[Step] = []
    if not base.to_noise:
        for k in range(LAWS):
            current = steps[-1].accepted if steps else base
            if stop() or current is None:
                break
            told("laws that may be missing", k + 1, LAWS + 1)
            step = one_round(current, base.unit, executor, stop)
            if k == 0 and not stop():
                step = second_look(step, base, executor, stop)
            steps.append(step)
            if step.accepted is None:
                break
    steps = [replace(one, accepted=on_all(one.accepted, searched) if one.accepted else None) for one in steps]
    base = on_all(base, searched)
    chosen = [base, *(one.accepted for one in steps if one.accepted)]
    held = tuple(held_out(one, recordings) for one in chosen)
    refused = refusals(held) if any(one.held.any() for one in recordings) else 0
    return Discovery(base, tuple(steps), noise, held, searched, refused, not stop())


def base_trial(system: FunctionSystem, recordings: Sequence[Recorded], ahead: tuple[Recorded, ...] = ()) -> Trial:
    """The base from its file's values and from across their ranges, sigma following the fit."""
    spread = [float(np.nanstd(np.concatenate([o.seen[k] for o in recordings]))) for k in range(len(system.channels))]
    noise = noise_in(recordings)
    wide = replace(system, sigma=tuple(float(x) for x in np.maximum(0.1 * np.array(spread), noise)))
    wide = replace(wide, longest_s=longest_step(wide, recordings))
    campaign = Stacked(recordings, wide, Inline())
    campaign.ahead = ahead
    fit, _ = wide.fit_base(campaign, [])
    first = tried(campaign, fit.unknowns, fit.u, np.array(wide.sigma), tempered=4)
    unit = np.array(first.system.sigma)
    finer = replace(first.system, longest_s=longest_step(first.system.at(first.values), recordings))
    return tried(campaign.with_system(finer), fit.unknowns, first.fit.u, unit)


def polished(trial: Trial) -> Trial:
    """A trial fitted to its end, integrated as finely as its laws need."""
    start, system = trial.fit, trial.system
    runs: Sequence[Any] = trial.campaign.observations
    step = min(system.longest_s, longest_step(system.at(trial.values), runs))
    campaign = trial.campaign
    if step < system.longest_s:
        campaign = campaign.with_system(replace(system, longest_s=step))
    return tried(campaign, start.unknowns, start.u, trial.unit, rounds=LAST_ROUNDS, share=LAST_SHARE)


def on_all(trial: Trial, recordings: Sequence[Recorded]) -> Trial:
    """A trial of some recordings, fitted to all."""
    runs: Sequence[Any] = trial.campaign.observations
    if sum(int(o.fitted.sum()) for o in runs) == sum(int(o.fitted.sum()) for o in recordings):
        return trial
    campaign = Stacked(recordings, trial.system, Inline())
    return tried(campaign, trial.fit.unknowns, trial.fit.u, trial.unit, tempered=1)


def one_round(current: Trial, unit: Floats, pool: Executor, stop: Callable[[], bool], *, held: bool = False) -> Step:
    """Screen, fit, write as formulas, choose one or none; ``held`` as in `_fitted`."""
    runs = [one for one in current.campaign.observations if isinstance(one, Recorded)]
    promised, seen = screened(current, pool, silent)
    first = picked(promised)
    every = _tried(current, first, seen, unit, pool, stop, held=held)
    left = written([one for one in every if of_note(one, current)])
    if left and not stop():
        more = elsewhere(left[0].laws[-1], promised, first)
        every += _tried(current, more, seen, unit, pool, stop, held=held)
        left = written([one for one in every if of_note(one, current)])
    every.sort(key=lambda one: one.predicts)
    if not left:
        return Step(None, tuple(every), (), tuple(promised[:FITTED]))
    accepted = left[0]
    last = polished(accepted)
    if last.predicts < accepted.predicts:
        every[every.index(accepted)] = left[0] = accepted = last
    accepted = without_lag(accepted)
    other = [one for one in left if rivals(one.laws[-1], accepted.laws[-1]) and same_channels(one, accepted, current)]
    alike = [one for one in other if not distinguished(one, accepted, len(current.system.model.inputs))]
    best = min(of_one_kind(accepted, every), key=lambda one: one.predicts)
    same = [
        one
        for one in alike
        if written_otherwise(accepted, one, current, runs)
        or written_otherwise(best, min(of_one_kind(one, every), key=lambda x: x.predicts), current, runs)
    ]
    alike = [one for one in alike if one not in same]
    same = [one for one in same if one.laws[-1].says != accepted.laws[-1].says]
    forms = dict.fromkeys(
        SHAPES[one.laws[-1].shape].name
        for one in forms_of(accepted, every)
        if not (degenerate(one, accepted) and written_otherwise(accepted, one, current, runs))
    )
    accepted = merged(pruned(refined(accepted, current, seen)), current, seen)
    errors = np.array([one.error for one in (accepted, *alike)])
    return Step(accepted, tuple(every), tuple(alike), tuple(promised[:FITTED]), tuple(same), tuple(forms), errors)


def second_look(step: Step, base: Trial, pool: Executor, stop: Callable[[], bool]) -> Step:
    """The first round, or the same about the constants that its law has led to, where that predicts better by a
    relevant share: first order about a base that is far off, as without a strong law, does not tell which law it is.
    """
    first = step.accepted
    if first is None or first.to_noise:
        return step
    u = first.fit.u[: len(base.fit.u)]
    there = tried(base.campaign, base.fit.unknowns, u, base.unit, tempered=1, rounds=1)
    again = one_round(there, base.unit, pool, stop, held=True)
    better = again.accepted is not None and again.accepted.predicts < OF_NOTE * first.predicts
    return again if better else step


def _tried(
    current: Trial,
    candidates: Sequence[Candidate],
    seen: Sequence[Passed],
    unit: Floats,
    pool: Executor,
    stop: Callable[[], bool],
    *,
    held: bool,
) -> list[Trial]:
    """Candidates fitted beside the laws so far, tables also as straight lines, and the best of them as formulas."""
    both = (*candidates, *lines(candidates))
    jobs = [pool.submit(_fitted, current, candidate, unit, held) for candidate in both]
    fits = sorted((job.result() for job in jobs), key=lambda one: one.predicts)
    good = [one for one in fits if one.predicts < OF_NOTE * current.predicts]
    # where a curve of many values fits, a formula may predict, too
    chosen = [*_of_places(good), *_of_places([one for one in fitting(fits, current) if one not in good])]
    late = {
        (one.laws[-1].place.name, one.laws[-1].state.name) for one in chosen if one.laws[-1].state.lag_s is not None
    }
    # where a law over history predicts, one over the state itself may
    known = {(one.laws[-1].place.name, one.laws[-1].over) for one in chosen} | late
    open_ = [one for one in fits if _open(one.laws[-1]) and (one.laws[-1].place.name, one.laws[-1].over) in known]
    plays = [one for one in chosen if one.laws[-1].shape == PLAY]
    if stop():
        return fits
    more = [pool.submit(formulas, one, current, seen) for one in open_]
    yields = [pool.submit(gradual, one) for one in plays]
    return [*fits, *(trial for job in more for trial in job.result()), *(job.result() for job in yields)]


def _of_places(trials: Sequence[Trial]) -> list[Trial]:
    """The best at each place and over each state, as many as are written as formulas."""
    best: dict[tuple[str, str], Trial] = {}
    for one in trials:
        best.setdefault((one.laws[-1].place.name, one.laws[-1].over), one)
    return list(best.values())[:FORMULAS]


def _open(law: Law) -> bool:
    return law.shape == TABLE or (law.state.lag_s is not None and not law.own)


def _fitted(current: Trial, candidate: Candidate, unit: Floats, held: bool) -> Trial:
    """A candidate fitted from zero strength or from its first-order estimate, or, about constants that are not fitted
    (``held``), from its fit with these held, whichever has less misfit."""
    laws = (*current.laws, candidate.law)
    system = current.system.with_laws(*laws)
    unknowns = (*current.fit.unknowns, *candidate.law.unknowns(len(current.laws)))
    zero = np.concatenate([current.fit.u, candidate.law.start(len(current.laws))])
    step = np.pad(candidate.step, (0, len(zero) - len(candidate.step)))
    campaign = current.campaign.with_system(system)
    low, high = (np.array([getattr(k, end) for k in unknowns]) for end in ("low", "high"))
    points = [np.clip(zero + share * step, low, high) for share in (0.0, 0.1, 0.4, 1.0)]
    if held:
        own = candidate.law.unknowns(len(current.laws))
        alone = least(campaign.with_system(system.at(current.values)), own, zero[-len(own) :], rounds=HELD_ROUNDS)
        points.append(np.concatenate([current.fit.u, alone.u]))
    if candidate.law.own:  # late as a whole
        points.append(np.append(current.fit.u, candidate.law.start(len(current.laws), 1 / candidate.law.unit)))
    smooth = rough(unknowns, laws)
    costs = [cost_at(unknowns, u, r, smooth) for u, r in zip(points, campaign.residuals(unknowns, points), strict=True)]
    return tried(campaign, unknowns, points[int(np.argmin(costs))], unit)
