"""The state of an inquiry: what has been fitted so far."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit
from straw.replay.diagnose.judge import Judgement, judge, unexplained
from straw.replay.diagnose.settings import NOISE_LEAVES

#: Called with (activity, steps done, steps in all).
Told = Callable[[str, int, int], None]


def silent(_what: str, _done: int, _total: int) -> None:
    """Say nothing."""


@dataclass(frozen=True)
class Chance:
    """What a second cause gains beside the ``first``, squared sigmas, and the most that one gains by chance in all but
    the share `BY_CHANCE` of ``simulated`` campaigns that hold the first alone (`straw.replay.diagnose.bootstrap`)."""

    first: str
    gain: float
    most: float
    simulated: int


@dataclass(eq=False)
class Inquiry:
    """The state of a search; usable at any time after the base fit."""

    campaign: Campaign
    null: Fit
    singles: dict[str, Contestant] = field(default_factory=dict)
    pairs: dict[str, Contestant] = field(default_factory=dict)
    chance: dict[str, Chance] = field(default_factory=dict)  # of pairs that gain more than chance, by name
    whole: bool = False  # whether the search ended by itself; a stopped one settles nothing
    spent: bool = False  # whether it ended because its budget was spent
    linearised_at: float = field(init=False)  # cost of the fit at which random effects were linearised, before that
    beside: list[Fit] = field(default_factory=list)  # fits of single causes beside which second ones were sought

    def __post_init__(self) -> None:
        self.linearised_at = self.null.cost

    @property
    def contestants(self) -> list[Contestant]:
        """All fitted hypotheses, best first."""
        return sorted([*self.singles.values(), *self.pairs.values()], key=lambda c: c.cost)

    @property
    def ranked_singles(self) -> list[Contestant]:
        """Single causes that were fitted, best first."""
        return sorted(self.singles.values(), key=lambda c: c.cost)

    @property
    def best(self) -> Fit:
        """The best fit apart from the base's; the base's where the library is empty."""
        return self.contestants[0].fit if self.contestants else self.null

    @property
    def goes_on(self) -> bool:
        """Whether the best so far leaves more than noise, and the search was not stopped."""
        return not self.campaign.stop() and unexplained(self.campaign, self.best) > NOISE_LEAVES

    def judgement(self) -> Judgement:
        """Probabilities from the fits so far."""
        return judge(self.campaign, self.null, self.contestants)

    def keep(self, one: Contestant) -> None:
        """Keep a contestant where it is better than the present fit of its hypothesis."""
        kept = self.singles if len(one.hypothesis.causes) == 1 else self.pairs
        if one.name not in kept or one.cost < kept[one.name].cost:
            kept[one.name] = one
