"""What was accepted made simpler: a law without its lag, without laws before it, or one with a curve it refines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from straw.replay.diagnose.discover.choose import OF_NEARLY, OF_NOTE, of_note, written
from straw.replay.diagnose.discover.formulas import formulas
from straw.replay.diagnose.discover.trial import Trial, tried
from straw.replay.diagnose.systems.function.codes import CLOCK, STRENGTH
from straw.replay.diagnose.systems.function.laws import Law
from straw.replay.diagnose.systems.function.passed import Passed
from straw.replay.diagnose.systems.function.shapes import TABLE

#: Points of a curve that replaces two, and those added to one that is refined: twice those of a candidate's.
POINTS = 16


def without_lag(trial: Trial) -> Trial:
    """The trial with its last law over the state itself, where a lag gives no relevant improvement."""
    law, number = trial.laws[-1], len(trial.laws) - 1
    if law.state.lag_s is None or law.own:
        return trial
    prompt = replace(law, state=replace(law.state, lag_s=None))
    keep = [k for k, one in enumerate(trial.fit.unknowns) if one.target != f"law.{number}.lag_s"]
    campaign = trial.campaign.with_system(trial.system.with_laws(*trial.laws[:-1], prompt))
    unknowns = [trial.fit.unknowns[k] for k in keep]
    fewer = tried(campaign, unknowns, trial.fit.u[keep], trial.unit)
    return fewer if OF_NOTE * fewer.predicts <= trial.predicts else trial


def pruned(trial: Trial) -> Trial:
    """The trial without earlier laws that its last law has made redundant (backward elimination)."""
    for number in range(len(trial.laws) - 2, -1, -1):
        if any(_multiplies(law, number) for law in trial.laws):
            continue
        laws = [_moved(law, number) for k, law in enumerate(trial.laws) if k != number]
        keep = [k for k, one in enumerate(trial.fit.unknowns) if not one.target.startswith(f"law.{number}.")]
        unknowns = [trial.fit.unknowns[k] for k in keep if not trial.fit.unknowns[k].target.startswith("law.")]
        unknowns += [one for k, law in enumerate(laws) for one in law.unknowns(k)]
        campaign = trial.campaign.with_system(trial.system.with_laws(*laws))
        fewer = tried(campaign, unknowns, trial.fit.u[keep], trial.unit)
        if OF_NEARLY * fewer.predicts <= trial.predicts:
            trial = fewer
    return trial


def _multiplies(law: Law, number: int) -> bool:
    return law.place.kind == STRENGTH and law.place.which == number


def _moved(law: Law, gone: int) -> Law:
    """A law as it is without that of the number ``gone``: one that multiplies a later law multiplies the one before."""
    if law.place.kind != STRENGTH or law.place.which < gone:
        return law
    which = law.place.which - 1
    return replace(law, place=replace(law.place, which=which, name=f"strength:{which}"))


def refined(trial: Trial, before: Trial, seen: Sequence[Passed]) -> Trial:
    """The trial with its last law, a curve, as a finer one, or a formula of that, where this predicts better by a
    relevant share: what a coarse curve leaves is no law of its own."""
    law, number = trial.laws[-1], len(trial.laws) - 1
    if law.shape != TABLE or law.state.remembers or law.place.kind == CLOCK:
        return trial
    fine = _finer(law, POINTS)
    others = [k for k, one in enumerate(trial.fit.unknowns) if not one.target.startswith(f"law.{number}.")]
    unknowns = [*(trial.fit.unknowns[k] for k in others), *fine.unknowns(number)]
    u = np.concatenate([trial.fit.u[others], law.curve(number, trial.values, np.array(fine.at)) / fine.unit])
    finer = tried(trial.campaign.with_system(trial.system.with_laws(*trial.laws[:-1], fine)), unknowns, u, trial.unit)
    best = written([finer, *formulas(finer, before, seen, fine=True)])[0]
    return best if of_note(best, trial) else trial


def _finer(law: Law, more: int) -> Law:
    """A curve with so many more points, evenly spaced."""
    even = np.linspace(law.state.low, law.state.high, more)
    return law.tabled([float(x) for x in np.unique(np.concatenate([even, law.at]))])


def merged(trial: Trial, before: Trial, seen: Sequence[Passed]) -> Trial:
    """The trial with its last law and a curve that it refines as one law, finer or a formula, where that predicts as
    well; ``before`` is the trial without its last law, ``seen`` what the recordings visit."""
    last = trial.laws[-1]
    for number, law in enumerate(trial.laws[:-1]):
        factor = _multiplies(last, number)
        alone = not any(x.place.kind == STRENGTH for x in trial.laws[:-1])
        if law.shape == TABLE and alone and _refines(last, law, factor):
            one = _as_one(trial, number, factor)
            best = written([one, *formulas(one, before, seen, fine=True)])[0]
            return best if OF_NEARLY * best.predicts <= trial.predicts else trial
    return trial


def _refines(last: Law, law: Law, factor: bool) -> bool:
    same = last.state.name == law.state.name and not last.state.remembers and not law.state.remembers
    return same and (factor or last.place.name == law.place.name)


def _as_one(trial: Trial, number: int, factor: bool) -> Trial:
    """The last law added to the curve of that number, or multiplied with it, as a finer curve that is the last law."""
    law, values, many = trial.laws[number], trial.values, len(trial.laws)
    fine = _finer(law, POINTS - len(law.at))
    at = np.array(fine.at)
    curve, more = law.curve(number, values, at), trial.laws[-1].curve(many - 1, values, at)
    others = [k for k in range(many - 1) if k != number]
    laws = [*(trial.laws[k] for k in others), fine]
    constants = [k for k, one in enumerate(trial.fit.unknowns) if not one.target.startswith("law.")]
    keep = [k for of in others for k, one in enumerate(trial.fit.unknowns) if one.target.startswith(f"law.{of}.")]
    unknowns = [trial.fit.unknowns[k] for k in constants]
    unknowns += [one for k, x in enumerate(laws) for one in x.unknowns(k)]
    both = curve * (1 + more) if factor else curve + more
    u = np.concatenate([trial.fit.u[[*constants, *keep]], both / fine.unit])
    return tried(trial.campaign.with_system(trial.system.with_laws(*laws)), unknowns, u, trial.unit)
