"""Stop: the reasons for which a loop ends, and the one that a diagnosis amounts to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from straw.replay.investigate.steps import Found

#: Every reason, with what it means; a log's last line and the command's last line name one of them.
REASONS = {
    "complete": "nothing is missing",
    "within_tolerance": "the model is good enough",
    "named": "what is missing is named with the required certainty",
    "unknown": "something is missing that the library does not hold, and no experiment would change that",
    "nothing_left": "no experiment is expected to be informative",
    "budget": "the budget is spent, or does not suffice for an informative experiment",
    "refused": "the experiment was not approved, or nobody was there to approve it",
    "aborted": "a run did not end well",
    "untracked": "a run's video is not tracked yet",
    "interrupted": "Ctrl-C, or a signal; a run is vented and recorded first",
    "error": "an input is wrong, as the message says",
}
#: Reasons that are an answer; all others are the answer "no".
ANSWERS = ("complete", "within_tolerance", "named")
#: After so many consecutive runs that changed no probability by more than the allowed doubt the loop stops, whatever
#: was expected of them: one run may be uninformative by chance, three hardly.
IDLE_RUNS = 3
#: An answer that rests on few runs is accepted when a run recorded after it was first found has not changed it.
SAID_BY = 2
#: Number of runs of the apparatus' whole campaign. The probabilities were calibrated on most of it: three runs or six
#: (tests.benchmarks.concealed). With fewer, a flexible law may explain by chance what it does not cause.
WHOLE_CAMPAIGN = 8


@dataclass(frozen=True)
class Stop:
    """Why the loop ended: one of `REASONS`, and in words."""

    reason: str
    says: str

    @property
    def code(self) -> int:
        """The command's exit code."""
        return 0 if self.reason in ANSWERS else 1


def reached(found: Found, history: Sequence[Found], certainty: float) -> Stop | None:
    """The answer, where a diagnosis is one; ``history`` are those of each set of recordings, `found` the last."""
    if found.verdict == "within_tolerance":
        return Stop("within_tolerance", found.says)
    p = certainty_of(found)
    if p < certainty or found.untried or unconfirmed(found, history, certainty):
        return None
    return Stop("complete" if found.verdict == "complete" else "named", f"{found.says} (p = {p:.2f})")


def unconfirmed(found: Found, history: Sequence[Found], certainty: float) -> bool:
    """Whether a cause is named with certainty, but only after the last of few runs: one that no run has tested yet."""
    if found.verdict == "complete" or certainty_of(found) < certainty or found.runs >= WHOLE_CAMPAIGN:
        return False
    last = history[-SAID_BY:]
    return len(last) < SAID_BY or any((one.verdict, one.causes) != (found.verdict, found.causes) for one in last)


def certainty_of(found: Found) -> float:
    """Probability of a diagnosis: that nothing is missing, or that each named cause takes part; else 0."""
    probability = found.probability or {}
    if found.verdict == "complete":
        return probability.get("complete", 0.0)
    if found.verdict not in ("missing_physics", "measurement_fault") or not found.causes:
        return 0.0
    parts = [sum(p for name, p in probability.items() if cause in name.split("+")) for cause in found.causes]
    return min(parts)


def idle(history: Sequence[Found], certainty: float) -> bool:
    """Whether the last `IDLE_RUNS` diagnoses changed nothing."""
    last = [one for one in history if one.probability][-IDLE_RUNS - 1 :]
    if len(last) <= IDLE_RUNS or len({one.verdict for one in last}) > 1:
        return False
    return all(_moved(one, last[-1]) < 1 - certainty for one in last[:-1])


def unknown_again(history: Sequence[Found]) -> bool:
    """Whether "unknown" was found before and after the last run."""
    last = history[-SAID_BY:]
    return len(last) == SAID_BY and all(one.verdict == "unknown_physics" for one in last)


def _moved(before: Found, after: Found) -> float:
    """The total variation distance between two posteriors."""
    p, q = before.probability or {}, after.probability or {}
    return sum(abs(p.get(name, 0.0) - q.get(name, 0.0)) for name in {*p, *q}) / 2
