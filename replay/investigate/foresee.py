"""Foresee: what a diagnosis would say after an experiment, by the judge's own weighing; so how many runs alike tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.judge import Judgement, weighed

Floats = NDArray[np.float64]

#: Runs alike that are looked ahead, at most: each leaves what the runs before it left.
MOST_ALIKE = 8


@dataclass(frozen=True)
class Foreseen:
    """``information_nats`` of one run; ``chances`` that after 1, 2, ... runs alike something is certain enough."""

    information_nats: float
    chances: tuple[float, ...]


def foreseen(
    judgement: Judgement,
    constants: Mapping[str, int],
    among: Sequence[str],
    separation: Floats,
    certainty: float,
) -> Foreseen:
    """What is expected of an experiment that puts the hypotheses ``among`` so many sigmas apart, ``separation`` (k, k).

    If hypothesis i holds, n runs alike add n s_ik^2 to what k leaves unexplained and nothing to what i leaves; what the
    judge then makes of it is the posterior. So a repeat counts by what the judge gives for it, which is ever less, and
    a cause that leaves much itself is not foreseen to be named by any experiment. A hypothesis that cannot play it is
    left as it is, those that are not ``among`` are left out. What is expected is over the present probabilities, and
    the information that of which of them holds: E ln (p after / p before) of the one that does.
    """
    inside = [*among, *(name for name in ("complete",) if name not in among)]
    now = {name: judgement.excess[name] for name in inside}
    counted = {name: constants[name] for name in among if name != "complete"}
    before = weighed(now, counted)
    prior = np.array([judgement.probability[name] for name in among])
    prior = prior / prior.sum()
    told, chances = 0.0, []
    for runs in range(1, MOST_ALIKE + 1):
        sure = 0.0
        for true, name in enumerate(among):
            apart = np.nan_to_num(separation[true]) ** 2
            after = weighed(now | _more(now, among, runs * apart), counted)
            sure += prior[true] * (takes_part(after, name.split("+")) >= certainty)
            if runs == 1:
                told += prior[true] * float(np.log(after[name] / before[name]))
        chances.append(float(sure))
    return Foreseen(max(0.0, float(told)), tuple(chances))


def _more(now: Mapping[str, float], among: Sequence[str], added: Floats) -> dict[str, float]:
    return {name: now[name] + float(more) for name, more in zip(among, added, strict=True)}


def takes_part(probability: Mapping[str, float], causes: Sequence[str]) -> float:
    """How probable it is that each of the causes takes part: that of the least probable one."""
    return min(sum(p for name, p in probability.items() if cause in name.split("+")) for cause in causes)
