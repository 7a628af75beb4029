"""straw diagnose: what the model leaves out, or which instrument is wrong, from a campaign of recordings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from straw.model.straw_file import load_straw
from straw.replay.commands.searching import searching
from straw.replay.compare.gather import gather
from straw.replay.compare.plausible import check_plausible
from straw.replay.diagnose import figures
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import Findings, conclude
from straw.replay.diagnose.page.report import report
from straw.replay.diagnose.recording import Channel
from straw.replay.diagnose.system import System
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.diagnose.tolerance import parse_tolerance
from straw.replay.errors import ReplayError
from straw.replay.output import check_new, check_places, write_json, write_text
from straw.replay.progress import prepare, say
from straw.rig.run import Run

#: How many hypotheses the table shows.
SHOWN = 6


def run(args: argparse.Namespace) -> int:
    """Diagnose; 0 when nothing is missing, 1 when something is, or is ambiguous or unknown."""
    if args.system:
        from straw.replay.commands import diagnose_system

        return diagnose_system.run(args)
    for option in ("given", "hold_out"):
        if getattr(args, option):
            raise ReplayError(f"--{option.replace('_', '-')}: is for --system S.py; leave it out for a straw")
    straw = load_straw(args.straw)
    system = StrawSystem(straw)
    library = chosen(system, args.without)
    tolerance = parse_tolerance(args.tolerance, system.channels) if args.tolerance is not None else None
    for path in (args.output, args.experiment):
        if path:
            check_new(path)
    check_places(args.report, args.json, given=args.runs)
    runs = gather(args.runs, partial=args.partial)
    check_campaign(runs, straw.cells)
    observations = [observe(one) for one in runs]
    prepare(derivatives=True)
    with searching(args) as (pool, told, stop):
        found = inquire(observations, system, library=library, executor=pool, told=told, stop=stop)
        findings = conclude(found, _about(runs), told, tolerance=tolerance)
        page = report(findings, found) if args.report else ""
    print(text(findings, system.channels))
    written = []
    if args.output:
        write_text(args.output, findings.written["straw"])
        written.append(args.output)
    if args.experiment:
        if findings.experiment is None:
            say("no experiment is proposed: there is nothing left to distinguish")
        else:
            write_text(args.experiment, findings.experiment.protocol)
            written.append(args.experiment)
    if args.report:
        write_text(args.report, page)
        written.append(args.report)
    if args.json:
        write_json(args.json, findings.as_json())
        written.append(args.json)
    if written:
        print(f"\nwritten to {', '.join(map(str, written))}")
    return 0 if findings.verdict in ("complete", "within_tolerance") else 1


def chosen(system: System, without: Sequence[str]) -> list[str]:
    """The causes to be tried: all but some; ReplayError for an unknown one."""
    for name in without:
        if name not in system.causes:
            raise ReplayError(f"--without {name}: no such cause; known: {', '.join(system.causes)}")
    return [name for name in system.causes if name not in without]


def check_campaign(runs: Sequence[Run], cells: int) -> None:
    """Raise ReplayError where runs are of several specimens, of another straw, or implausible."""
    specimens = sorted({one.specimen for one in runs if one.specimen})
    if len(specimens) > 1:
        raise ReplayError(f"runs of {len(specimens)} specimens ({', '.join(specimens)}); diagnose one at a time")
    names = [one.run_id for one in runs]
    for name in names:
        if names.count(name) > 1:
            raise ReplayError(f"run {name} is given twice; give each run once")
    for one in runs:
        if one.cells != cells:
            raise ReplayError(f"{one.path}: recorded on {one.cells} cells, the straw has {cells}; give its --straw")
        check_plausible(one)


def text(f: Findings, channels: Sequence[Channel]) -> str:
    """Findings for a terminal: the verdict first."""
    lines = [f.says, f.where, ""]
    for name, p in list(f.judgement.probability.items())[:SHOWN]:
        lines.append(f"  {p:6.3f}  {name.replace('_', ' ')}")
    for cause, constants in f.parameters.items():
        lines += [f"{cause}: {constant}" for constant in figures.told(constants)]
    if f.missing:
        lines.append(f"{f.missing.says}.")
        for formula in filter(None, (law.formula for law in f.missing.laws)):
            lines.append(f"  as a formula: {formula.text}; keeps {100 * formula.keeps:.0f} % of what the curve gains")
    if f.held:
        lines.append(f"fitted without {', '.join(f.held.heldout)}, there (RMS):")
        for channel in channels:
            held = (f.held.before, f.held.after, f.held.floor)
            before, after, floor = (channel.shown_per_si * row[channel.name] for row in held)
            unit = channel.shown_unit
            path = f"{before:8.3f} -> {after:8.3f}" if f.improved else f"base {before:8.3f}"
            lines.append(f"  {channel.short:<4} {path} {unit}, noise {floor:.3f} {unit}")
        for one in f.held.explained():
            shares = ", ".join(f"{100 * share:.0f} % in {channel}" for channel, share in one["share"].items())
            lines.append(f"  {one['cause'].replace('_', ' ')} explains {shares} of the mean squared misfit above noise")
        left = f.held.remainder
        rest = [f"{c.short} {c.shown_per_si * left[c.name]:.3g} {c.shown_unit}" for c in channels]
        lines.append(f"  what remains above noise: {', '.join(rest)} RMS")
    if f.smallest:
        lines.append("the smallest effects that would have been seen:")
        lines += [f"  {cause.replace('_', ' ')}: {size}" for cause, size in sorted(f.smallest.items())]
    if f.experiment:
        e = f.experiment
        lines.append(f"next experiment: {e.why} ({e.expected_separation_sigma:.0f} sigma apart)")
    return "\n".join([*lines, *(f"note: {note}" for note in f.notes)])


def _about(runs: Sequence[Run]) -> list[str]:
    return [f"{one.run_id}: {lost}" for one in runs for lost in one.lost]
