"""The verdict: what probabilities suffice to name."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from straw.replay.diagnose.judge import by_cause, surviving
from straw.replay.diagnose.settings import NAMED_ALONE


def verdict_of(probability: Mapping[str, float], faults: Collection[str]) -> tuple[str, list[str]]:
    """The contract's verdict and the causes it names, from probabilities, largest first."""
    top = next(iter(probability))
    names = [n for n in surviving(probability) if n != "unknown"] or [top]
    if top == "complete" and probability[top] > 0.5:  # more probable than not
        return "complete", []
    if top == "unknown" and probability[top] > 0.5:
        return "unknown_physics", ["unknown"]
    marginal = by_cause(probability)
    certain = [cause for cause, p in marginal.items() if p >= NAMED_ALONE]
    if probability[top] >= NAMED_ALONE or (certain and set(certain) == set(top.split("+"))):
        causes = sorted(top.split("+"), key=lambda c: -marginal[c])
        return ("measurement_fault" if set(causes) <= set(faults) else "missing_physics"), causes
    if certain:  # one cause is certain, only the one beside it is not
        return ("measurement_fault" if set(certain) <= set(faults) else "missing_physics"), certain
    told = [cause for name in names if name != "complete" for cause in name.split("+")]
    return "ambiguous", sorted(set(told), key=lambda c: -marginal.get(c, 0.0))
