"""Propose: experiments on which the surviving hypotheses disagree: the menu, free designs, and repeats of runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import surviving
from straw.replay.diagnose.systems.straw.experiment import Rated, rated
from straw.replay.diagnose.systems.straw.menu import Choice, allowed, drawn, menu, varied, written
from straw.replay.diagnose.systems.straw.of import straw_of
from straw.replay.investigate.foresee import Foreseen, foreseen
from straw.replay.investigate.steps import Proposal
from straw.rig.limits import PressureLimits
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import protocol_from_toml

#: Largest number of hypotheses that judge an experiment: each simulates every candidate.
MOST_HYPOTHESES = 4
#: Free designs that are drawn, the best that are varied, variations of each: as many simulations as the menu twice.
DRAWN, FOLLOWED, VARIATIONS = 12, 3, 4
#: The first runs, one in each direction, when nothing is known.
OPENINGS = ("deploy-30kPa", "deploy-26kPa", "fold-22kPa", "fold-16kPa")


def proposals(found: Inquiry, limits: PressureLimits, known: Sequence[str], certainty: float = 0.9) -> list[Proposal]:
    """Experiments within the limits with expected information and cost; ``known``: protocols that were run, as TOML,
    once for each run; ``certainty``: the probability at which an answer is accepted. Empty where fewer than two
    hypotheses can be simulated."""
    probability, among = hypotheses(found)
    if len(among) < 2:
        return []
    campaign, cells = found.campaign, straw_of(found.campaign).cells
    rng = np.random.default_rng(len(campaign.observations))  # the same campaign gets the same proposals
    choices = [c for c in menu(cells) if allowed(c, limits)] + [drawn(rng, cells, limits) for _ in range(DRAWN)]
    first = _rated(campaign, among[:2], probability[:2], choices, limits)
    best = [choice for _, choice in sorted(first, key=lambda row: -row[0])[:FOLLOWED]]
    choices += [varied(choice, rng, limits) for choice in best for _ in range(VARIATIONS)]
    texts = list(dict.fromkeys([*(written(c, limits) for c in choices), *known]))
    why = {written(c, limits): c.why for c in choices}
    names = " from ".join(c.name.replace("_", " ") for c in among)
    judgement = found.judgement()
    constants = {c.name: len(c.hypothesis.unknowns) for c in found.contestants}
    out = []
    for text, one in zip(texts, rated(campaign, among, texts), strict=True):
        if one is None or any(limits.why_not(float(p)) for p in one.protocol.pressure_pa):
            continue
        expected = foreseen(judgement, constants, [c.name for c in among], one.separation, certainty)
        out.append(_proposal(text, one, expected, f"{why.get(text, 'once more')}; would distinguish {names}", known))
    return out


def hypotheses(found: Inquiry) -> tuple[list[float], list[Contestant]]:
    """The surviving hypotheses that can be simulated, most probable first, at least two if there are; "complete" is the
    base. "Unknown" cannot be simulated: the hypothesis nearest to it stands in."""
    probability = found.judgement().probability
    fitted = {c.name: c for c in found.contestants}
    fitted["complete"] = Contestant(Hypothesis((), (), ()), found.null)
    names = [name for name in probability if name in fitted]
    count = max(2, sum(name in fitted for name in surviving(probability)))
    chosen = names[: min(count, MOST_HYPOTHESES)]
    return [probability[name] for name in chosen], [fitted[name] for name in chosen]


def openings(cells: int, limits: PressureLimits, known: Sequence[str]) -> list[Proposal]:
    """Runs before anything can be diagnosed: one in each direction that was not run yet."""
    by_name = {c.name: c for c in menu(cells) if allowed(c, limits)}
    out = []
    for direction, first in (("deploy", "a first deployment"), ("fold", "a first folding")):
        mine = [by_name[name] for name in OPENINGS if name.startswith(direction) and name in by_name]
        texts = [written(c, limits) for c in mine]
        if not mine or any(text in known for text in texts):
            continue
        out.append(_opening(mine[0], f"{first}: nothing is known yet, so both directions come first", limits))
    return out


def extremes(cells: int, limits: PressureLimits, known: Sequence[str]) -> list[Proposal]:
    """The menu's runs at the largest pressure and suction within the limits, unless a ``known`` one went as far: what
    acts only there would not have been seen."""
    reached = [float(p) for text in known for p in protocol_from_toml(text, "a run").pressure_pa]
    out = []
    for sign, most in ((1, "pressure"), (-1, "suction")):
        held = [c for c in menu(cells) if allowed(c, limits) and len(c.holds) == 1 and sign * c.holds[0][0] > 0]
        farthest = max(held, key=lambda c: sign * c.holds[0][0], default=None)
        if farthest and all(sign * p < sign * 1e3 * farthest.holds[0][0] for p in reached):
            why = f"the largest {most} of the menu: what acts only there would not have been seen"
            out.append(_opening(farthest, why, limits))
    return out


def _opening(choice: Choice, why: str, limits: PressureLimits) -> Proposal:
    minutes = (1.0 + sum(s for _, s in choice.holds)) / 60
    return Proposal(written(choice, limits), choice.deployed, why, 0.0, 0.0, minutes, 0, opening=True)


def _rated(
    campaign: Campaign,
    among: Sequence[Contestant],
    probability: Sequence[float],
    choices: Sequence[Choice],
    limits: PressureLimits,
) -> list[tuple[float, Choice]]:
    """Candidates that can be simulated, with their information in nats."""
    seen = zip(choices, rated(campaign, among, [written(c, limits) for c in choices]), strict=True)
    return [(one.information(probability), choice) for choice, one in seen if one is not None]


def _proposal(text: str, one: Rated, expected: Foreseen, why: str, known: Sequence[str]) -> Proposal:
    protocol: PressureProtocol = one.protocol
    return Proposal(
        text,
        protocol.initial_deployed,
        why,
        expected.information_nats,
        float(np.nanmax(one.separation)),
        protocol.duration_s / 60,
        one.snaps,
        run_before=sum(text == other for other in known),
        chances=expected.chances,
    )
