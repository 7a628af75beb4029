"""Ask: approval of an experiment by a person at the terminal, on a page or at another terminal."""

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
#: Called with (proposal, plan, ahead); returns who approves, or "".
Ask = Callable[[Proposal, Plan, Ahead], str]


def question(proposal: Proposal, plan: Plan, ahead: Ahead, emulated: bool) -> str:
    """What a person needs to know before approving."""
    lines = [f"\nnext: {proposal.why}"]
    if ahead.before:
        lines.append(f"  run {ahead.before} times before; a repeat is most informative")
    if not proposal.opening:
        lines.append(f"  {proposal.information_nats:.2f} nats expected, {proposal.separation_sigma:.0f} sigma")
    if ahead.runs > 1:
        lines.append(f"  some {ahead.runs} runs of it are expected to be needed; each is diagnosed before the next")
    lines.append(f"  {plan.says}")
    lines.append(f"  {plan.hand or ('the emulator sets the cells by itself' if emulated else '')}".rstrip())
    return "\n".join(lines)


def at_terminal(operator: str, emulated: bool) -> Ask:
    """Ask at the terminal; without a terminal the answer is no."""

    def ask(proposal: Proposal, plan: Plan, ahead: Ahead) -> str:
        say(question(proposal, plan, ahead, emulated))
        if not sys.stdin or not sys.stdin.isatty():
            say("there is no terminal to ask at; --yes N approves N rounds that need no work by hand")
            return ""
        say("run it? [y/N] ")
        try:
            answer = sys.stdin.readline().strip().lower()
        except ValueError:
            answer = ""
        return (operator or getpass.getuser()) if answer in ("y", "yes") else ""

    return ask


def from_elsewhere(place: Path, pulse: Pulse, emulated: bool) -> Ask:
    """Wait until another process answers in a file; answers to other questions are ignored."""

    def ask(proposal: Proposal, plan: Plan, ahead: Ahead) -> str:
        path = place / ANSWER
        with suppress(OSError):
            path.unlink()
        say(question(proposal, plan, ahead, emulated))
        say("waiting for the lab's page, or: straw investigate FOLDER --answer yes")
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
    """Answer the loop that waits in a folder; return the answer in words. ReplayError where none waits."""
    pulse = read_pulse(place)
    asked = pulse.get("asked") if pulse else None
    if not asked:
        why = f"it is busy: {pulse['doing']}" if pulse else "none is running"
        raise ReplayError(f"{place}: no straw investigate is waiting for an answer there ({why})")
    who = " ".join(who.split()) or getpass.getuser()
    write_json(place / ANSWER, {**asked, "yes": yes, "who": who})
    return f"round {asked['round']}: {who} says {'yes' if yes else 'no'}"
