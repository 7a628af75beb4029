"""straw diagnose --system: what a user's own system leaves out, from tables of readings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from straw.replay.commands.searching import searching
from straw.replay.diagnose.discover.discover import discover
from straw.replay.diagnose.discover.findings import SystemFindings
from straw.replay.diagnose.discover.page import page
from straw.replay.diagnose.discover.said import text
from straw.replay.diagnose.systems.function.check import check_on
from straw.replay.diagnose.systems.function.model import load_model
from straw.replay.diagnose.systems.function.read_recordings import read_recordings
from straw.replay.diagnose.systems.function.system import FunctionSystem
from straw.replay.errors import ReplayError
from straw.replay.output import check_places, write_json, write_text


def run(args: argparse.Namespace) -> int:
    """Diagnose; 0 when nothing is missing or all is within the tolerance, 1 when something is, or is ambiguous or
    unknown."""
    for option in ("straw", "laws", "without", "output", "experiment", "partial"):
        if getattr(args, option):
            raise ReplayError(f"--{option}: is for a straw; leave it out with --system")
    check_places(args.report, args.json, given=[args.system, *args.runs])
    model = load_model(args.system, [_given(one) for one in args.given])
    recordings = read_recordings(model, args.runs, args.hold_out)
    tolerance = _tolerances(args.tolerance, [y.name for y in model.channels])
    system = FunctionSystem(model)
    check_on(system, recordings)
    with searching(args) as (pool, told, stop):
        found = discover(system, recordings, executor=pool, told=told, stop=stop)
    findings = SystemFindings(found, tuple(recordings), tolerance)
    print(text(findings))
    written = []
    if args.report:
        write_text(args.report, page(findings))
        written.append(args.report)
    if args.json:
        write_json(args.json, findings.as_json())
        written.append(args.json)
    if written:
        print(f"\nwritten to {', '.join(map(str, written))}")
    return 0 if findings.verdict in ("complete", "within_tolerance") else 1


def _given(text_: str) -> tuple[str, float, float, float]:
    """NAME=VALUE,LOW,HIGH."""
    name, _, numbers = text_.partition("=")
    try:
        value, low, high = (float(x) for x in numbers.split(","))
    except ValueError:
        raise ReplayError(f"--given {text_}: give NAME=VALUE,LOW,HIGH, for example c=0.28,0.27,0.29") from None
    return name, value, low, high


def _tolerances(text_: str | None, channels: Sequence[str]) -> dict[str, float]:
    out: dict[str, float] = {}
    for part in text_.split(",") if text_ is not None else ():
        name, value = _tolerance(part, channels)
        if name in out:
            raise ReplayError(f"--tolerance {text_}: {name} is given twice; give it once")
        out[name] = value
    return out


def _tolerance(part: str, channels: Sequence[str]) -> tuple[str, float]:
    """CHANNEL=VALUE in the channel's unit."""
    name, _, number = part.partition("=")
    if name not in channels:
        raise ReplayError(f"--tolerance {part!r}: give CHANNEL=VALUE; channels: {', '.join(channels)}")
    try:
        value = float(number)
    except ValueError:
        raise ReplayError(f"--tolerance {part}: give a number in the channel's unit, for example {name}=0.1") from None
    if not 0 < value < float("inf"):
        raise ReplayError(f"--tolerance {part}: {number} is no finite number above zero")
    return name, value
