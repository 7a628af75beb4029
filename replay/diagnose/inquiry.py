"""The state of an inquiry: what has been fitted so far, and what repeats of one straw differ by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.contest import Contestant
from straw.replay.diagnose.hypothesis import REPEATS_MOUNT, repeat_steps
from straw.replay.diagnose.judge import Judgement, judge
from straw.replay.diagnose.search import Fit, measured_slopes

#: Said with (what is being done, steps done, steps in all).
Told = Callable[[str, int, int], None]


@dataclass(eq=False)
class Inquiry:
    """What has been found so far; usable at any time after the base fit."""

    campaign: Campaign
    null: Fit
    singles: dict[str, Contestant] = field(default_factory=dict)
    pairs: dict[str, Contestant] = field(default_factory=dict)
    forked: dict[str, float] = field(default_factory=dict)  # runs that are looked at until they fork, and when, s
    whole: bool = False  # whether every cause was looked at and the best were carried to their end

    @property
    def contestants(self) -> list[Contestant]:
        """All fitted hypotheses, best first."""
        return sorted([*self.singles.values(), *self.pairs.values()], key=lambda c: c.cost)

    @property
    def best(self) -> Fit:
        """The best fit but the base's, which it is where the library is empty."""
        return self.contestants[0].fit if self.contestants else self.null

    def judgement(self) -> Judgement:
        """Probabilities with what is known now."""
        return judge(self.campaign, self.null, self.contestants)

    def keep(self, one: Contestant) -> None:
        """Remember a contestant where it is better than what is known of its hypothesis."""
        kept = self.singles if len(one.hypothesis.causes) == 1 else self.pairs
        if one.name not in kept or one.cost < kept[one.name].cost:
            kept[one.name] = one


def allow_repeats(campaign: Campaign, fit: Fit) -> None:
    """From now on allow for what runs of one straw differ by, as felt at this fit."""
    campaign.scatter = None
    residual, moved = (
        campaign.residuals((*fit.unknowns, REPEATS_MOUNT), [np.append(fit.u, turned)])[0] for turned in (0.0, 1.0)
    )
    steps = repeat_steps(fit.unknowns)
    slopes = measured_slopes(campaign, fit.unknowns, fit.u, residual, list(steps))
    campaign.allow(np.column_stack([moved - residual, slopes * list(steps.values())]))
