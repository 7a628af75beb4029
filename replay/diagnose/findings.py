"""Findings: what an inquiry says, in the contract's words: verdict, causes, constants, improvement on runs held out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.contest import Contestant
from straw.replay.diagnose.experiment import Experiment, next_experiment
from straw.replay.diagnose.figures import Held, constants_of, hold_out, smallest_seen
from straw.replay.diagnose.hypothesis import MEASUREMENT, applied
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import COVERED, Judgement, by_cause, surviving
from straw.replay.diagnose.locate import Located, Wandering, locate, sentence, wandering
from straw.replay.diagnose.missing import Missing, Told, missing_force, silent

Floats = NDArray[np.float64]

#: A hypothesis this probable is named alone; less, and the set that survives is named.
NAMED_ALONE = 0.8
#: Nothing is called missing, or the cause unknown, when that is more probable than not.
MORE_THAN_NOT = 0.5


@dataclass(frozen=True, eq=False)
class Findings:
    """What the runs say. ``best`` is the hypothesis that explains them best, ``straw`` the model with it."""

    verdict: str
    causes: list[str]
    judgement: Judgement
    located: list[Located]
    wandering: list[Wandering]
    where: str
    says: str
    best: Contestant | None
    straw: StrawParameters
    parameters: dict[str, dict[str, dict[str, Any]]]
    held: Held | None
    smallest: dict[str, str]
    indistinguishable: list[list[str]]
    experiment: Experiment | None
    notes: tuple[str, ...]
    missing: Missing | None = None  # what stands for the cause where it is unknown

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
            "smallest_effect_seen": self.smallest,
            "indistinguishable": self.indistinguishable,
            "next_experiment": self.experiment.as_json() if self.experiment else None,
            "missing": self.missing.as_json() if self.missing else None,
            "notes": list(self.notes),
            "straw": self.straw.to_toml(),
        }


def conclude(found: Inquiry, notes: Sequence[str] = (), told: Told = silent, *, brief: bool = False) -> Findings:
    """Findings of an inquiry, finished or cut short. An unknown cause is looked for as a curve, a minute, and the next
    experiment is chosen, unless ``brief``.
    """
    campaign, judgement = found.campaign, found.judgement()
    probability = judgement.probability
    top = next(iter(probability))
    fitted = {c.name: c for c in found.contestants}
    verdict, causes = verdict_of(probability)
    if not found.whole:  # what was not looked at counts as impossible in the probabilities, so nothing is settled
        verdict, causes = "ambiguous", [c for c in causes if c != "unknown"]
    best = fitted.get(top) if verdict not in ("complete", "unknown_physics") else None
    if verdict == "ambiguous":
        best = next((fitted[n] for n in probability if n in fitted), None)
    fit, straw_of = best.fit if best else found.null, campaign
    missing = None
    if found.whole and verdict == "unknown_physics" and not brief:
        missing = missing_force(campaign, found.null, told)
    if missing and missing.formula:
        fit, straw_of = missing.curve.fit, missing.curve.campaign
    straw = applied(straw_of.straw, fit.unknowns, fit.u)[0]
    located = locate(campaign, found.null)
    wander = wandering(campaign, found.null)
    notes = [*notes, *_doubts(found)]
    experiment = None
    if found.whole and verdict in ("ambiguous", "unknown_physics") and not brief:
        nearest = sorted(found.singles.values(), key=lambda c: c.cost)[:2]  # of what is not the answer, but something
        # what comes nearest survives where the cause is unknown, but explains nothing
        survivors = surviving(probability) if verdict == "ambiguous" else []
        rivals = [fitted[n] for n in survivors if n in fitted and fitted[n] is not best][:3]
        among = [c for c in (best, *rivals) if c]
        experiment = next_experiment(campaign, among or nearest, explain=bool(among))
    return Findings(
        verdict=verdict,
        causes=causes,
        judgement=judgement,
        located=[] if verdict == "complete" else located,
        wandering=wander,
        where=sentence([] if verdict == "complete" else located, wander),
        says=_says(verdict, causes, probability, found),
        best=best,
        straw=straw,
        parameters=constants_of(campaign, best) if best else {},
        held=hold_out(straw_of, found.null, fit, located) if found.whole else None,
        smallest=smallest_seen(campaign, found) if verdict == "complete" else {},
        indistinguishable=[causes] if verdict == "ambiguous" and len(causes) > 1 else [],
        experiment=experiment,
        notes=tuple(notes),
        missing=missing,
    )


def verdict_of(probability: Mapping[str, float]) -> tuple[str, list[str]]:
    """The contract's verdict and the causes it names, from probabilities, largest first."""
    top = next(iter(probability))
    names = [n for n in surviving(probability) if n != "unknown"] or [top]
    if top == "complete" and probability[top] > MORE_THAN_NOT:
        return "complete", []
    if top == "unknown" and probability[top] > MORE_THAN_NOT:
        return "unknown_physics", ["unknown"]
    marginal = by_cause(probability)
    certain = [cause for cause, p in marginal.items() if p >= NAMED_ALONE]
    if probability[top] >= NAMED_ALONE or (certain and set(certain) == set(top.split("+"))):
        causes = sorted(top.split("+"), key=lambda c: -marginal[c])
        return ("measurement_fault" if set(causes) <= set(MEASUREMENT) else "missing_physics"), causes
    if certain:  # one cause is sure, only what stands beside it is not
        return ("measurement_fault" if set(certain) <= set(MEASUREMENT) else "missing_physics"), certain
    told = [cause for name in names if name != "complete" for cause in name.split("+")]
    return "ambiguous", sorted(set(told), key=lambda c: -marginal.get(c, 0.0))


def _says(verdict: str, causes: Sequence[str], probability: Any, found: Inquiry) -> str:
    """The verdict in one sentence."""
    words = [c.replace("_", " ") for c in causes]
    runs = len(found.campaign.observations)
    if not found.whole:
        so_far = f"; so far {' and '.join(words)} would explain these runs best" if words else ""
        return f"Stopped before every cause was looked at: nothing is named and nothing excluded{so_far}."
    if verdict == "complete":
        return f"Nothing is missing: the base model, its constants refitted, explains all {runs} runs to repeatability."
    if verdict == "unknown_physics":
        return f"Something is missing that no hypothesis in the library explains in these {runs} runs; none is named."
    sure = f"(probability {sum(p for n, p in probability.items() if set(causes) & set(n.split('+'))):.2f})"
    if verdict == "ambiguous":
        others = {"complete": "nothing missing", "unknown": "something no hypothesis holds"}
        among = [*words, *(text for name, text in others.items() if probability[name] > 1 - COVERED)]
        told = f"{' from '.join(among)} {sure if causes else ''}".rstrip()
        return f"These runs cannot tell {told}; the next experiment below would."
    what = "The recording is at fault" if verdict == "measurement_fault" else "The model leaves out"
    return f"{what}{':' if verdict == 'measurement_fault' else ''} {' and '.join(words)} {sure}."


def _doubts(found: Inquiry) -> list[str]:
    """What a reader should know about how this was found."""
    runs = found.campaign.observations
    out = []
    if not found.whole:
        out.append("the search was cut short: causes not looked at yet count as impossible here; --thorough goes on")
    if found.whole and found.campaign.tally["left_out"]:
        out.append("the search took long and was shortened at its end; with --thorough it goes on")
    out += [
        f"run {name} is looked at until {end_s:.2f} s: repeats of the straw would go two ways there, and it went "
        "another than the model"
        for name, end_s in found.forked.items()
    ]
    if len(runs) < 3:
        out.append(
            f"{len(runs)} run{'s' if len(runs) > 1 else ''}: nothing could be held out, and repeats are not known"
        )
    if not any(len(o.snaps_s) for o in runs):
        out.append("no run shows a snap: what acts only in snaps (film, cohesion, inertia, drag) was not tested")
    if len({o.run.cycle for o in runs}) < 2:
        out.append("all runs are of the same cycle: wear was not tested")
    if found.campaign.tally["failed"]:
        out.append(f"{found.campaign.tally['failed']} simulations could not follow and counted as very wrong")
    return out
