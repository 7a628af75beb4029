"""Foresee: the expected posterior after an experiment, by the diagnosis' own weights, for 1, 2, ... identical runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.judge import Judgement, weighed

Floats = NDArray[np.float64]

#: Largest number of identical runs looked ahead.
MOST_ALIKE = 8


@dataclass(frozen=True)
class Foreseen:
    """``information_nats`` of one run; ``chances`` that after 1, 2, ... identical runs an answer is certain enough."""

    information_nats: float
    chances: tuple[float, ...]


def foreseen(
    judgement: Judgement,
    constants: Mapping[str, int],
    among: Sequence[str],
    separation: Floats,
    certainty: float,
) -> Foreseen:
    """Expected result of an experiment that separates the hypotheses ``among`` by ``separation`` (k, k) sigmas.

    If hypothesis i holds, n identical runs add n s_ik^2 to the misfit of k and nothing to that of i; the diagnosis'
    weights then give the posterior. So a repeat has a diminishing effect, and a cause with a large misfit of its own is
    not expected to be named after any experiment. A hypothesis that cannot simulate the experiment keeps its misfit;
    one not ``among``, but in ``constants``, is as far from the one that holds as the nearest of those that are, as each
    may be improbable and all together not. Expectations are over the present probabilities, and the information is
    E ln (p after / p before) of the hypothesis that holds.
    """
    now = {name: judgement.excess[name] for name in dict.fromkeys([*among, "complete", *constants])}
    aside = [name for name in now if name not in among and name != "complete"]
    counted = {name: count for name, count in constants.items() if name != "complete"}
    before = weighed(now, counted, judgement.faults)
    prior = np.array([judgement.probability[name] for name in among])
    prior = prior / prior.sum()
    told, chances = 0.0, []
    for runs in range(1, MOST_ALIKE + 1):
        sure = 0.0
        for true, name in enumerate(among):
            apart = np.nan_to_num(separation[true]) ** 2
            nearest = np.min(np.delete(apart, true), initial=np.inf)
            added = runs * np.append(apart, np.full(len(aside), nearest if np.isfinite(nearest) else 0.0))
            after = weighed(now | _more(now, [*among, *aside], added), counted, judgement.faults)
            sure += prior[true] * (takes_part(after, name.split("+")) >= certainty)
            if runs == 1:
                told += prior[true] * float(np.log(after[name] / before[name]))
        chances.append(float(sure))
    return Foreseen(max(0.0, float(told)), tuple(chances))


def _more(now: Mapping[str, float], among: Sequence[str], added: Floats) -> dict[str, float]:
    return {name: now[name] + float(more) for name, more in zip(among, added, strict=True)}


def takes_part(probability: Mapping[str, float], causes: Sequence[str]) -> float:
    """Probability that each of the causes takes part: that of the least probable one."""
    return min(sum(p for name, p in probability.items() if cause in name.split("+")) for cause in causes)
