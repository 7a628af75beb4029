"""Choose: the proposed experiment with the most information for its cost, and how many runs of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from straw.replay.errors import USER_ERRORS
from straw.replay.investigate.budget import ROUNDED, Budget
from straw.replay.investigate.state import State
from straw.replay.investigate.steps import Ahead, Found, Plan, Proposal
from straw.replay.investigate.stop import Stop, unconfirmed, unknown_again


@dataclass(frozen=True)
class Chooser:
    """``certainty``: the probability at which an answer is accepted."""

    state: State
    budget: Budget
    certainty: float

    def choose(
        self, found: Found, offered: Sequence[Proposal], dry_run: Callable[[Proposal], Plan]
    ) -> tuple[Proposal, Plan] | Stop:
        """The best by information for its share of the budget that could decide, within limits and budget.

        For an unknown cause nothing can be foreseen, so the most informative one is run once to see whether that helps;
        a name that no run has tested yet is tested by the most informative protocol that was not run yet.
        """
        spent = self.state.spent
        test = unconfirmed(found, self.state.history, self.certainty)
        confirm = test or (found.verdict == "unknown_physics" and not unknown_again(self.state.history))
        if test:
            why = f"to confirm {' and '.join(found.causes).replace('_', ' ')} by a run that was not fitted"
            fresh = [one for one in offered if not self._before(one)] or offered
            offered = [replace(one, why=f"{why}; {one.why}") for one in fresh]
        dear, many, forbidden = 0, 0, ""
        for one in sorted(offered, key=lambda one: -self._worth(one)):
            if not confirm and not self.runs(one):
                more = self._runs(one, len(one.chances))
                many = min(many or more, more) if more else many
                continue
            if not self.budget.pays(spent, one.minutes, one.snaps):
                dear += 1
                continue
            try:
                plan = dry_run(one)
            except USER_ERRORS as error:  # a limit, or a start without a rest state of the model
                forbidden = forbidden or str(error)
                continue
            if not self.budget.pays(spent, plan.minutes, plan.snaps):
                dear += 1
                continue
            return one, plan
        if dear:
            return Stop("budget", f"what is left of the budget pays for none of {dear} experiments; {found.says}")
        if many:
            return Stop("budget", f"it would take {many} runs alike, more than the budget has left; {found.says}")
        no = f"; the first that would is forbidden: {forbidden}" if forbidden else ""
        if found.verdict == "unknown_physics":
            return Stop("unknown", f"{found.says}{no}")
        return Stop("nothing_left", f"no experiment is expected to be informative{no}; {found.says}")

    def ahead(self, one: Proposal) -> Ahead:
        """Runs done and runs expected, for a person."""
        return Ahead(self.state.number, self._before(one), max(1, self.runs(one)))

    def runs(self, one: Proposal) -> int:
        """Number of identical runs expected to be needed, within the budget; 0: they could not decide."""
        return self._runs(one, self.budget.affords(self.state.spent, one.minutes, one.snaps, len(one.chances)))

    def _runs(self, one: Proposal, most: int) -> int:
        """A chance no larger than the allowed doubt counts as none; otherwise the fewest runs that reach the share
        ``certainty`` of the best chance."""
        if one.opening:
            return 1
        best = max(one.chances[:most], default=0.0)
        if best <= 1 - self.certainty + ROUNDED:
            return 0
        return next(n for n, chance in enumerate(one.chances, 1) if chance >= self.certainty * best)

    def _before(self, one: Proposal) -> int:
        return max(one.run_before, self.state.run_before.get(one.key, 0))

    def _worth(self, one: Proposal) -> float:
        """Expected nats per share of the budget. After n identical runs one more is worth less: it adds 1 / (n + 1) of
        the precision of their mean."""
        share = self.budget.share(self.state.spent, one.minutes, one.snaps)
        return one.information_nats / (1 + self._before(one)) / max(share, 1e-9)
