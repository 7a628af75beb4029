"""The loop itself: diagnose, propose, dry run, approval, run, track, repeat; independent of straw and rig."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace

from straw.replay.errors import USER_ERRORS, ReplayError
from straw.replay.investigate.budget import Budget
from straw.replay.investigate.choose import Chooser
from straw.replay.investigate.log import Log
from straw.replay.investigate.state import State
from straw.replay.investigate.steps import Found, Plan, Proposal, Ran, Steps
from straw.replay.investigate.stop import IDLE_RUNS, Stop, idle, reached


@dataclass
class Loop:
    """``yes``: number of rounds approved in advance. ``certainty``: the least probability of an answer."""

    log: Log
    steps: Steps
    budget: Budget
    certainty: float = 0.9
    yes: int = 0
    say: Callable[[str], None] = lambda text: None

    def run(self) -> Stop:
        """Continue from the end of the log until there is a reason to stop, and log it."""
        self.state = State.of(self.log.lines)
        if self.state.last is not None and not self.state.last.well:
            self.yes = 0  # a person must look after a run that did not end well
        if self.state.recording:
            self.yes = 0
            self._write("ran", **asdict(self.steps.after(self.state.recording)))
        try:
            while (stop := self._round()) is None:
                pass
        except (KeyboardInterrupt, SystemExit) as error:
            self._stopped(Stop("interrupted", type(error).__name__))
            raise
        except USER_ERRORS as error:
            with suppress(ReplayError):  # the log itself may be what cannot be written
                self._stopped(Stop("error", " ".join(str(error).split())))
            raise
        self._stopped(stop)
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
        if stop := reached(found, state.history, self.certainty):
            return stop
        if over := self.budget.why_over(state.spent):
            return Stop("budget", f"{over}; {found.says}")
        if state.proposal is None:
            chosen = self._choose(found)
            if isinstance(chosen, Stop):
                if chosen.reason == "unknown":
                    return Stop("unknown", f"{chosen.says} {self.steps.unknown(found)}".rstrip())
                return chosen
            proposal, plan = chosen
            runs = self._chooser().ahead(proposal).runs
            self._write("proposed", proposal=asdict(proposal), plan=asdict(plan), key=proposal.key, runs=runs)
        proposal, plan = self._pending()
        who = self._yes(proposal, plan)
        self._write("answered", yes=bool(who), who=who)
        if not who:
            return Stop("refused", f"not approved: {proposal.why}")
        ran = self._run(proposal)
        if not ran.well:
            return Stop("aborted", f"{ran.recording}: {ran.reason or ran.status}; look at the rig, then go on")
        return None

    def _pending(self) -> tuple[Proposal, Plan]:
        assert self.state.proposal is not None
        assert self.state.plan is not None
        return self.state.proposal, self.state.plan

    def _diagnosed(self) -> Found:
        """The findings: from the log if they are of the present recordings, else by a new diagnosis."""
        found, history = self.state.found, self.state.history
        fresh = found is not None and found.recordings == self.steps.recordings()
        if found is not None and fresh and (self.state.proposal is not None or reached(found, history, self.certainty)):
            return found
        found = self.steps.diagnose()
        self._write("diagnosed", **asdict(found))
        self.say(f"round {self.state.number}: {found.says}")
        return found

    def _choose(self, found: Found) -> tuple[Proposal, Plan] | Stop:
        """The next experiment, or why there is none."""
        if idle(self.state.history, self.certainty):
            reason = "unknown" if found.verdict == "unknown_physics" else "nothing_left"
            return Stop(reason, f"the last {IDLE_RUNS} runs changed nothing; {found.says}")
        return self._chooser().choose(
            found, self.steps.propose(found), lambda one: self.steps.dry_run(one, self.state.ends)
        )

    def _chooser(self) -> Chooser:
        return Chooser(self.state, self.budget, self.certainty)

    def _yes(self, proposal: Proposal, plan: Plan) -> str:
        if self.yes > 0 and not plan.hand:
            self.yes -= 1
            return "--yes"
        who = self.steps.ask(proposal, plan, self._chooser().ahead(proposal))
        if who and self.yes > 0:
            self.yes -= 1
        return who

    def _run(self, proposal: Proposal) -> Ran:
        """Drive it; start and end are written to disk before anything else happens."""
        recording, failed = self.steps.recording_of(proposal, self.state.number), ""
        self._write("started", recording=recording, key=proposal.key)
        try:
            self.steps.run(proposal, recording)
        except USER_ERRORS as error:
            failed = " ".join(str(error).split())
        except BaseException as error:  # Ctrl-C: it has vented
            self._write("ran", **asdict(self._ended(recording, type(error).__name__)))
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
        """The line of a whole round: what was run, why, who approved, the outcome, the findings before it."""
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

    def _stopped(self, stop: Stop) -> None:
        self._write("stopped", reason=stop.reason, says=stop.says, spent=asdict(self.state.spent))

    def _write(self, kind: str, **said: object) -> None:
        self.state.take(self.log.write(kind, **{"round": self.state.number, **said}))
