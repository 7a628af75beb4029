"""Findings in sentences: the verdict, why a cause is not named, and remarks on the search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from straw.replay.diagnose.heldout import Held
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.names import NO_CAUSE, words
from straw.replay.diagnose.recording import Channel
from straw.replay.diagnose.settings import BY_CHANCE, COVERED


@dataclass(frozen=True)
class Refuted:
    """A hypothesis that predicts held-out runs worse than the base does, and by how much."""

    name: str
    worse: str


def made_worse(held: Held, channels: Sequence[Channel]) -> str:
    """Channels that a model predicts worse than the base: RMS of both, where neither was fitted."""
    parts = []
    for c in channels:
        if c.name in held.worse:
            before, after = (c.shown_per_si * row[c.name] for row in (held.before, held.after))
            parts.append(f"{c.short} {before:.3g} -> {after:.3g} {c.shown_unit}")
    return ", ".join(parts)


def says(
    verdict: str,
    causes: Sequence[str],
    probability: Mapping[str, float],
    found: Inquiry,
    *,
    refuted: Refuted | None = None,
    experiment: bool = False,
    modelled: str = "",
) -> str:
    """The verdict in one sentence; ``experiment``: whether one is proposed that would tell more; ``modelled``: the
    missing law that was found from the runs, as a noun."""
    runs = len(found.campaign.observations)
    named = " and ".join(words(c) for c in causes)
    if not found.whole:
        so_far = f"; so far {named} would explain these runs best" if named else ""
        return f"Stopped before every cause was tried: nothing is named and nothing is excluded{so_far}."
    if verdict == "complete":
        return f"Nothing is missing: the base model, its constants refitted, explains all {runs} runs to repeatability."
    if verdict == "within_tolerance":
        return f"Complete within the tolerance: the refitted base model is good enough for these {runs} runs."
    if verdict == "unknown_physics" and modelled:
        return (
            f"Something is missing that no hypothesis in the library explains in these {runs} runs; it looks like "
            f"{modelled}, which makes the prediction of runs held out better."
        )
    if verdict == "unknown_physics":
        return f"Something is missing that no hypothesis in the library explains in these {runs} runs; none is named."
    if verdict == "ambiguous":
        tail = "; the next experiment below would tell more" if experiment else ""
        if refuted:
            return (
                f"Nothing is named: {words(refuted.name)} explains all runs together best (probability "
                f"{probability[refuted.name]:.2f}), but fitted without the runs held out it predicts them worse than "
                f"the base ({refuted.worse}){tail}."
            )
        return f"{_undecided(causes, probability)}{tail}."
    what = "The recording is at fault:" if verdict == "measurement_fault" else "The model leaves out"
    judgement = found.judgement()
    share = judgement.left_over / max(judgement.excess["complete"], judgement.left_over, 1e-300)
    left = f"; {100 * share:.2g} % of the misfit remains unexplained" if share else ""
    return f"{what} {named} (probability {_sure(causes, probability):.2f}){left}."


def doubts(found: Inquiry) -> list[str]:
    """Remarks on how this was found."""
    runs = found.campaign.observations
    out = []
    if not found.whole:
        out.append("the search was cut short: causes that were not tried have probability zero here")
    if found.spent:
        out.append("the search spent its budget of steps: what was not fitted by then has probability zero here")
    if len(runs) < 3:
        out.append(
            f"{len(runs)} run{'s' if len(runs) > 1 else ''}: nothing could be held out, and repeats are not known"
        )
    if chance := found.chance.get(next(iter(found.judgement().probability))):
        first, share = words(chance.first), 1 - BY_CHANCE
        out.append(
            f"the second cause gains {chance.gain:.0f} squared standard deviations beside {first}; in {share:.0%} of "
            f"{chance.simulated} simulated campaigns with {first} alone, any second gains less than {chance.most:.0f}"
        )
    out += [
        f"run {name} is fitted with constants of its own, near to the others': its motion is close to a bifurcation"
        for name in found.campaign.own
    ]
    out += found.campaign.system.doubts(runs)
    if found.campaign.tally["failed"]:
        out.append(f"{found.campaign.tally['failed']} simulations failed and were counted as large misfits")
    return out


def _sure(causes: Sequence[str], probability: Mapping[str, float]) -> float:
    """Probability that at least one of these causes takes part."""
    return sum(p for name, p in probability.items() if set(causes) & set(name.split("+")))


def _undecided(causes: Sequence[str], probability: Mapping[str, float]) -> str:
    """Hypotheses that cannot be distinguished, with probabilities; a single cause may be too improbable to be named."""
    sure = {words(c): _sure([c], probability) for c in causes}
    sure |= {text: probability[name] for name, text in NO_CAUSE.items() if probability[name] > 1 - COVERED}
    among = [f"{name} ({p:.2f})" for name, p in sure.items()]
    if len(among) < 2:
        return f"These runs do not settle it: {''.join(among) or 'nothing'} is most probable, but not enough"
    return f"These runs cannot tell {' from '.join(among)}, probabilities in brackets"
