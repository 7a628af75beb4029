"""The loop itself: diagnose, propose, dry run, a yes, run, track, again; it knows neither straw nor rig."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

from straw.replay.errors import USER_ERRORS
from straw.replay.investigate.budget import Budget
from straw.replay.investigate.log import Log
from straw.replay.investigate.state import State
from straw.replay.investigate.steps import Found, Plan, Proposal, Ran, Steps

#: Reasons to stop that are an answer; all others are the answer "no".
ANSWERS = ("complete", "within_tolerance", "named")


@dataclass(frozen=True)
class Stop:
    """Why the loop ended: complete, within_tolerance, named, nothing_left, budget, refused, aborted, untracked."""

    reason: str
    says: str

    @property
    def code(self) -> int:
        """The command's exit code."""
        return 0 if self.reason in ANSWERS else 1


@dataclass
class Loop:
    """``yes``: so many rounds of this call need no question. ``certainty``: below it nothing counts as named."""

    log: Log
    steps: Steps
    budget: Budget
    certainty: float = 0.9
    yes: int = 0
    say: Callable[[str], None] = lambda text: None

    def run(self) -> Stop:
        """Go on from wherever the log ends until there is a reason to stop, and write it down."""
        self.state = State.of(self.log.lines)
        if self.state.last is not None and not self.state.last.well:
            self.yes = 0  # after a run that did not end well somebody looks first
        if self.state.recording:
            self.yes = 0
            self._write("ran", **asdict(self.steps.after(self.state.recording)))
        while (stop := self._round()) is None:
            pass
        self._write("stopped", reason=stop.reason, says=stop.says, spent=asdict(self.state.spent))
        return stop

    def _round(self) -> Stop | None:
        state = self.state
        if not state.tracked:
            assert state.last is not None
            if not self.steps.track(state.last.recording):
                return Stop(
                    "untracked", f"{state.last.recording} has no track; add one and give the same command again"
                )
            self._close()
        found = self._diagnosed()
        if stop := self._reached(found):
            return stop
        if over := self.budget.why_over(state.spent):
            return Stop("budget", f"{over}; {found.says}")
        if state.proposal is None:
            chosen = self._choose(found)
            if isinstance(chosen, Stop):
                return chosen
            proposal, plan = chosen
            self._write("proposed", proposal=asdict(proposal), plan=asdict(plan), key=proposal.key)
        proposal, plan = self._pending()
        who = self._yes(proposal, plan)
        self._write("answered", yes=bool(who), who=who)
        if not who:
            return Stop("refused", f"nobody said yes to {proposal.why}")
        ran = self._run(proposal)
        if not ran.well:
            return Stop("aborted", f"{ran.recording}: {ran.reason or ran.status}; look at the rig, then go on")
        return None

    def _pending(self) -> tuple[Proposal, Plan]:
        assert self.state.proposal is not None
        assert self.state.plan is not None
        return self.state.proposal, self.state.plan

    def _diagnosed(self) -> Found:
        """What is known: from the log, where it is of the recordings that there are, and still needed for nothing."""
        found = self.state.found
        fresh = found is not None and found.recordings == self.steps.recordings()
        if found is not None and fresh and (self.state.proposal is not None or self._reached(found)):
            return found
        found = self.steps.diagnose()
        self._write("diagnosed", **asdict(found))
        self.say(f"round {self.state.number}: {found.says}")
        return found

    def _reached(self, found: Found) -> Stop | None:
        if found.verdict == "within_tolerance":
            return Stop("within_tolerance", found.says)
        p = certainty_of(found)
        if p < self.certainty:
            return None
        return Stop("complete" if found.verdict == "complete" else "named", f"{found.says} (p = {p:.2f})")

    def _choose(self, found: Found) -> tuple[Proposal, Plan] | Stop:
        """The experiment that is expected to tell most for what it costs, that limits and budget allow."""
        state = self.state
        offered = [one for one in self.steps.propose(found) if self._could_tell(one)]
        offered.sort(key=lambda one: -self._worth(one))
        dear, forbidden = 0, ""
        for one in offered:
            if self.budget.share(state.spent, one.minutes, one.snaps) > 1:
                dear += 1
                continue
            try:
                plan = self.steps.dry_run(one, state.ends)
            except USER_ERRORS as error:  # a limit, or a start that the model knows no rest for
                forbidden = forbidden or str(error)
                continue
            if self.budget.share(state.spent, plan.minutes, plan.snaps) > 1:
                dear += 1
                continue
            return one, plan
        if dear:
            return Stop("budget", f"what is left of the budget pays for none of {dear} experiments; {found.says}")
        no = f"; the first that would is forbidden: {forbidden}" if forbidden else ""
        return Stop("nothing_left", f"no experiment is expected to tell more{no}; {found.says}")

    def _repeats(self, one: Proposal) -> int:
        return max(one.run_before, self.state.run_before.get(one.key, 0))

    def _worth(self, one: Proposal) -> float:
        """Expected nats for the share of the budget that it takes. What n runs alike have not told, one more tells the
        less: it adds 1 / (n + 1) of the precision of their mean."""
        share = self.budget.share(self.state.spent, one.minutes, one.snaps)
        return one.information_nats / (1 + self._repeats(one)) / max(share, 1e-9)

    def _could_tell(self, one: Proposal) -> bool:
        """Whether it can bring even odds to the certainty: s sigma apart are s^2 / 2 nats of evidence on average."""
        if one.opening:
            return True
        needed = math.log(self.certainty / (1 - self.certainty))
        return one.separation_sigma**2 / 2 / (1 + self._repeats(one)) >= needed

    def _yes(self, proposal: Proposal, plan: Plan) -> str:
        if self.yes > 0 and not plan.hand:
            self.yes -= 1
            return "--yes"
        who = self.steps.ask(proposal, plan, self._repeats(proposal))
        if who and self.yes > 0:
            self.yes -= 1
        return who

    def _run(self, proposal: Proposal) -> Ran:
        """Drive it; that it starts, and that it has ended, is on the disk before anything else happens."""
        recording, failed = self.steps.recording_of(proposal, self.state.number), ""
        self._write("started", recording=recording, key=proposal.key)
        try:
            self.steps.run(proposal, recording)
        except USER_ERRORS as error:
            failed = " ".join(str(error).split())
        except BaseException as error:  # Ctrl-C: it has vented
            self._write("ran", **asdict(self._ended(recording, type(error).__name__)))
            self._write("stopped", reason="interrupted", says=type(error).__name__, spent=asdict(self.state.spent))
            raise
        ran = self._ended(recording, failed)
        self._write("ran", **asdict(ran))
        return ran

    def _ended(self, recording: str, failed: str) -> Ran:
        ran = self.steps.after(recording)
        if not failed:
            return ran
        return replace(ran, status="fail" if ran.well else ran.status, reason=failed)

    def _close(self) -> None:
        """The line of a whole round: what was run, why, who said yes, what it was, what was thought before it."""
        told: dict[str, dict[str, object]] = {}
        for line in self.log.lines:
            told[line["kind"]] = line
        proposed, ran = told.get("proposed", {}), told.get("ran", {})
        found, answered = told.get("diagnosed", {}), told.get("answered", {})
        self._write(
            "round",
            round=self.state.spent.rounds,
            key=proposed.get("key"),
            recording=ran.get("recording"),
            sha256=ran.get("sha256"),
            proposal=proposed.get("proposal"),
            who=answered.get("who"),
            verdict_before=found.get("verdict"),
            probability_before=found.get("probability"),
            spent=asdict(self.state.spent),
        )

    def _write(self, kind: str, **said: object) -> None:
        self.state.take(self.log.write(kind, **{"round": self.state.number, **said}))


def certainty_of(found: Found) -> float:
    """How probable what a diagnosis says is: that nothing is missing, or that each named cause takes part; else 0."""
    probability = found.probability or {}
    if found.verdict == "complete":
        return probability.get("complete", 0.0)
    if found.verdict not in ("missing_physics", "measurement_fault") or not found.causes:
        return 0.0
    parts = [sum(p for name, p in probability.items() if cause in name.split("+")) for cause in found.causes]
    return min(parts)
