"""Budget: how many rounds, minutes on the rig and snaps of the straw may be spent, and the share of it that a run
takes."""

from __future__ import annotations

from dataclasses import dataclass

#: Rounding error of shares, which are computed from sums of minutes.
ROUNDED = 1e-9


@dataclass(frozen=True)
class Spent:
    """Cost of runs: rounds, minutes of driving the rig, snaps of cells."""

    rounds: int = 0
    minutes: float = 0.0
    snaps: int = 0

    def and_also(self, minutes: float, snaps: int) -> Spent:
        """With one more round."""
        return Spent(self.rounds + 1, self.minutes + minutes, self.snaps + snaps)


@dataclass(frozen=True)
class Budget:
    """The most that may be spent; None: no limit."""

    rounds: int | None = 8
    minutes: float | None = None
    snaps: int | None = None

    def share(self, spent: Spent, minutes: float, snaps: int) -> float:
        """The largest share of any remaining resource that an experiment takes; above 1: more than is left.

        This needs no exchange rate between minutes and snaps: the scarcest resource decides.
        """
        after = spent.and_also(minutes, snaps)
        parts = (
            (self.rounds, spent.rounds, after.rounds),
            (self.minutes, spent.minutes, after.minutes),
            (self.snaps, spent.snaps, after.snaps),
        )
        shares = [_share(most, before, then) for most, before, then in parts if most is not None]
        return max(shares, default=1.0)

    def pays(self, spent: Spent, minutes: float, snaps: int) -> bool:
        """Whether the rest suffices for an experiment."""
        return self.share(spent, minutes, snaps) <= 1 + ROUNDED

    def affords(self, spent: Spent, minutes: float, snaps: int, most: int) -> int:
        """Number of identical runs for which the rest suffices, at most ``most``."""
        for runs in range(most):
            if not self.pays(spent, minutes, snaps):
                return runs
            spent = spent.and_also(minutes, snaps)
        return most

    def why_over(self, spent: Spent) -> str:
        """What is spent, in words; empty while something is left of everything."""
        for name in ("rounds", "minutes", "snaps"):
            most, used = getattr(self, name), getattr(spent, name)
            if most is not None and used >= most:
                return f"{used:.3g} of {most:g} {name} are spent"
        return ""


def _share(most: float, before: float, then: float) -> float:
    if then == before:
        return 0.0
    return (then - before) / (most - before) if most > before else float("inf")
