"""Findings: the result of an inquiry in the contract's words: verdict, causes, constants, improvement on held-out
runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.figures import constants_of, smallest_seen
from straw.replay.diagnose.fit import Contestant, Fit
from straw.replay.diagnose.formed import Model
from straw.replay.diagnose.heldout import Held, helpful, hold_out, moves, noise_floor, plain_rms
from straw.replay.diagnose.inquiry import Inquiry, Told, silent
from straw.replay.diagnose.judge import Judgement, surviving
from straw.replay.diagnose.locate import Located, Wandering, locate, sentence, wandering
from straw.replay.diagnose.one_thread import one_blas_thread
from straw.replay.diagnose.said import Refuted, doubts, made_worse, says
from straw.replay.diagnose.tolerance import Tolerance
from straw.replay.diagnose.verdict import verdict_of

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Findings:
    """The result. ``best`` is the hypothesis that explains the runs best, ``model`` the system's with it."""

    verdict: str
    causes: list[str]
    judgement: Judgement
    located: list[Located]
    wandering: list[Wandering]
    where: str
    says: str
    best: Contestant | None
    fitted: Model  # to all runs: the improved one, or the base
    model: Any
    written: dict[str, str]  # the model as text, by its name in findings
    parameters: dict[str, dict[str, dict[str, Any]]]
    held: Held | None
    smallest: dict[str, str]
    indistinguishable: list[list[str]]
    experiment: Any
    notes: tuple[str, ...]
    missing: Any = None  # the curve of an unknown cause
    discovered: dict[str, Any] | None = None  # the same in the contract's words, where runs held out got better by it

    @property
    def improved(self) -> bool:
        """Whether there is a model that improves on the base: with a cause, or with a curve of what is missing."""
        return self.best is not None or self.discovered is not None

    def as_json(self) -> dict[str, Any]:
        """The contract's Findings."""
        held = self.held
        return {
            "verdict": self.verdict,
            "causes": self.causes,
            "probability": dict(self.judgement.probability),
            "located": [
                {**{k: v for k, v in vars(one).items() if k != "cells"}, "cells": list(one.cells)}
                for one in self.located
            ],
            "where": self.where,
            "says": self.says,
            "wandering": [vars(w) for w in self.wandering[:4]],
            "parameters": self.parameters,
            "fit": {
                "train": {
                    "runs": list(held.train) if held else [],
                    "reduced_chi2_before": held.chi2_before if held else None,
                    "reduced_chi2_after": held.chi2_after if held else None,
                },
                "heldout": {
                    "runs": list(held.heldout) if held else [],
                    "rms_before": held.before if held else {},
                    "rms_after": held.after if held else {},
                    "noise_floor": held.floor if held else {},
                },
            },
            "explained": held.explained() if held else [],
            "remainder": held.remainder if held else {},
            "discovered": self.discovered,
            "smallest_effect_seen": self.smallest,
            "indistinguishable": self.indistinguishable,
            "next_experiment": self.experiment.as_json() if self.experiment else None,
            "missing": self.missing.as_json() if self.missing else None,
            "notes": list(self.notes),
            **self.written,
        }


@one_blas_thread()
def conclude(
    found: Inquiry,
    notes: Sequence[str] = (),
    told: Told = silent,
    *,
    brief: bool = False,
    tolerance: Tolerance | None = None,
) -> Findings:
    """Findings of an inquiry, finished or cut short. An unknown cause is fitted as a curve, for minutes, and the next
    experiment is chosen, unless ``brief``. Where the base is within the ``tolerance``, that is the verdict.

    A cause that makes held-out runs worse is not named, however probable: the model stays the refitted base, and a
    curve is located but explains nothing.
    """
    campaign, judgement = found.campaign, found.judgement()
    probability, system = judgement.probability, campaign.system
    verdict, causes, best = _most_probable(found, probability)
    improved = Model(campaign, best.fit if best else found.null)
    located = locate(campaign, found.null)
    wander = wandering(campaign, found.null)
    notes = [*notes, *doubts(found)]
    held = hold_out(campaign, found.null, _added(found, best), located) if found.whole else None
    refuted = None
    if best and held and held.worse:
        refuted = Refuted(best.name, made_worse(held, system.channels))
        verdict = "ambiguous"
        best, improved, held = None, Model(campaign, found.null), held.of_base()
    missing, discovered = None, None
    if found.whole and verdict == "unknown_physics" and not brief:
        missing, discovered, better = _missing(found, located, told)
        if better:
            held, improved = better, missing.model
    if missing and missing.tells and not discovered:
        notes.append("the curve of what is missing does not make the runs held out better: located, not explained")
    within = tolerance is not None and _within(tolerance, campaign, found.null, held)
    if tolerance is not None and verdict != "complete":
        if within:
            verdict, causes = "within_tolerance", []
        elif held and tolerance.holds(held.remainder, held.moves):
            notes.append("what the improved model leaves is within the tolerance")
    there = improved.campaign.system
    model = there.fitted(*improved.parameters())
    experiment = None
    if found.whole and verdict in ("ambiguous", "unknown_physics") and not brief:
        experiment = _experiment(found, best, probability if verdict == "ambiguous" else {})
    return Findings(
        verdict=verdict,
        causes=causes,
        judgement=judgement,
        located=[] if verdict == "complete" else located,
        wandering=wander,
        where=sentence([] if verdict == "complete" else located, wander, system.channels),
        says=says(
            verdict,
            causes,
            probability,
            found,
            refuted=refuted,
            experiment=experiment is not None,
            modelled=missing.noun if missing and discovered else "",
        ),
        best=best,
        fitted=improved,
        model=model,
        written=there.written(model),
        parameters=constants_of(system, best) if best else {},
        held=held,
        smallest=smallest_seen(campaign, found) if verdict == "complete" else {},
        indistinguishable=[causes] if verdict == "ambiguous" and len(causes) > 1 else [],
        experiment=experiment,
        notes=tuple(notes),
        missing=missing,
        discovered=discovered,
    )


def _most_probable(found: Inquiry, probability: Mapping[str, float]) -> tuple[str, list[str], Contestant | None]:
    """Verdict and causes by the probabilities, largest first, and the hypothesis of the improved model."""
    verdict, causes = verdict_of(probability, found.campaign.system.faults)
    if not found.whole:  # causes not looked at have probability zero, so nothing is settled
        verdict, causes = "ambiguous", [c for c in causes if c != "unknown"]
    fitted = {c.name: c for c in found.contestants}
    if verdict == "ambiguous":
        return verdict, causes, next((fitted[name] for name in probability if name in fitted), None)
    settled = verdict in ("complete", "unknown_physics")
    return verdict, causes, None if settled else fitted.get(next(iter(probability)))


def _missing(found: Inquiry, located: Sequence[Located], told: Told) -> tuple[Any, dict[str, Any] | None, Held | None]:
    """The curve of an unknown cause, None where there is none; where it makes held-out runs better, it in the
    contract's words, and the errors there."""
    campaign, system = found.campaign, found.campaign.system
    laws = system.missing(campaign, found.null, told)
    helps = helpful(found.null, laws, located) if laws else None
    if not helps:
        return (laws[-1] if laws else None), None, None
    missing, held = helps
    places = (system.places(campaign, found.null, o) for o in campaign.observations)
    return missing, missing.discovered(sorted({place for run in places for place in run})), held


def _experiment(found: Inquiry, best: Contestant | None, probability: Mapping[str, float]) -> Any:
    """The run that would decide between the hypotheses that survive by their ``probability``; a single survivor, or
    none where the cause is unknown, is compared with the nearest others."""
    fitted = {c.name: c for c in found.contestants}
    survivors = surviving(probability) if probability else []
    rivals = [fitted[n] for n in survivors if n in fitted and fitted[n] is not best][:3]
    among = [c for c in (best, *rivals) if c]
    explain = len(among) > 1
    if not explain:
        among += [c for c in found.ranked_singles[:2] if c not in among]
    return found.campaign.system.experiment(found.campaign, among, explain=explain)


def _added(found: Inquiry, best: Contestant | None) -> list[tuple[str, Model]]:
    """Models with the first of the best hypothesis' causes, with two, ...; the cause that explains most alone comes
    first."""
    if best is None:
        return []
    alone = [found.singles[cause] for cause in best.hypothesis.causes if cause in found.singles]
    if len(best.hypothesis.causes) == 1 or not alone:
        return [("+".join(best.hypothesis.causes), Model(found.campaign, best.fit))]
    first = min(alone, key=lambda c: c.cost)
    rest = [cause for cause in best.hypothesis.causes if cause != first.name]
    return [(first.name, Model(found.campaign, first.fit)), ("+".join(rest), Model(found.campaign, best.fit))]


def _within(tolerance: Tolerance, campaign: Campaign, null: Fit, held: Held | None) -> bool:
    """Whether the base is good enough, on the runs held out or, where there are none, on all."""
    if held is not None:
        return tolerance.holds(held.above_noise(held.before), held.moves)
    rms, floor = plain_rms(campaign, null.unknowns, null.u), noise_floor(campaign)
    left = {name: float(np.sqrt(max(0.0, value**2 - floor[name] ** 2))) for name, value in rms.items()}
    return tolerance.holds(left, moves(campaign))
