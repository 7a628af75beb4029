"""Ask: who says yes to an experiment: a person at the terminal, or one who answers from a page or another terminal."""

from __future__ import annotations

import getpass
import json
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from straw.replay.errors import ReplayError
from straw.replay.investigate.pulse import Pulse, read_pulse
from straw.replay.investigate.steps import Ahead, Plan, Proposal
from straw.replay.output import write_json
from straw.replay.progress import say
from straw.rig.interrupts import Interrupts

ANSWER = "answer.json"
LOOKS_S = 0.1
#: Asked with (proposal, plan, ahead); answers who says yes, or nothing.
Ask = Callable[[Proposal, Plan, Ahead], str]


def question(proposal: Proposal, plan: Plan, ahead: Ahead, emulated: bool) -> str:
    """What a person has to know before a yes."""
    lines = [f"\nnext: {proposal.why}"]
    if ahead.before:
        lines.append(f"  run {ahead.before} times before; a repeat tells most")
    if not proposal.opening:
        lines.append(f"  {proposal.information_nats:.2f} nats expected, {proposal.separation_sigma:.0f} sigma")
    if ahead.runs > 1:
        lines.append(f"  some {ahead.runs} runs of it are expected to be needed; each is looked at before the next")
    lines.append(f"  {plan.says}")
    lines.append(f"  {plan.hand or ('the emulator sets the cells by itself' if emulated else '')}".rstrip())
    return "\n".join(lines)


def at_terminal(operator: str, emulated: bool) -> Ask:
    """Ask whoever sits there; where nobody does, nobody says yes."""

    def ask(proposal: Proposal, plan: Plan, ahead: Ahead) -> str:
        say(question(proposal, plan, ahead, emulated))
        if not sys.stdin or not sys.stdin.isatty():
            say("nobody is at the terminal to say yes; --yes N says it for N rounds that need no hand")
            return ""
        say("run it? [y/N] ")
        try:
            answer = sys.stdin.readline().strip().lower()
        except ValueError:
            answer = ""
        return (operator or getpass.getuser()) if answer in ("y", "yes") else ""

    return ask


def from_elsewhere(place: Path, pulse: Pulse, emulated: bool) -> Ask:
    """Wait until another process answers in a file; an answer to any other question is none."""

    def ask(proposal: Proposal, plan: Plan, ahead: Ahead) -> str:
        path = place / ANSWER
        with suppress(OSError):
            path.unlink()
        say(question(proposal, plan, ahead, emulated))
        say("waits for the lab's page, or: straw investigate FOLDER --answer yes")
        pulse.tell("wait for an answer", asked={"round": ahead.number, "key": proposal.key})
        with Interrupts() as interrupts:
            while True:
                interrupts.check()
                with suppress(OSError, ValueError, KeyError, TypeError):
                    said = json.loads(path.read_text(encoding="utf-8"))
                    path.unlink()
                    if (said["round"], said["key"]) == (ahead.number, proposal.key):
                        pulse.tell("run" if said["yes"] else "end")
                        return str(said["who"]) if said["yes"] else ""
                time.sleep(LOOKS_S)

    return ask


def answer(place: Path, yes: bool, who: str) -> str:
    """Answer the loop that waits in a folder; what was answered, in words. ReplayError where none waits."""
    pulse = read_pulse(place)
    asked = pulse.get("asked") if pulse else None
    if not asked:
        why = f"it is busy: {pulse['doing']}" if pulse else "none goes on"
        raise ReplayError(f"{place}: no straw investigate waits for an answer there ({why})")
    who = " ".join(who.split()) or getpass.getuser()
    write_json(place / ANSWER, {**asked, "yes": yes, "who": who})
    return f"round {asked['round']}: {who} says {'yes' if yes else 'no'}"
