"""straw diagnose: what the model leaves out, or which instrument lies, from a campaign of recordings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from straw.model.parameters import load_straw
from straw.replay.diagnose import figures
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import Findings, conclude
from straw.replay.diagnose.library import causes
from straw.replay.diagnose.observation import observe
from straw.replay.diagnose.report import report
from straw.replay.errors import ReplayError
from straw.replay.gather import gather
from straw.replay.output import check_new, write_json, write_text
from straw.replay.progress import prepare, progress_bar, say
from straw.rig.interrupts import Interrupts
from straw.rig.run import Run

#: How many hypotheses the table shows.
SHOWN = 6


def run(args: argparse.Namespace) -> int:
    """Diagnose; 0 when nothing is missing, 1 when something is, is not told apart, or is unknown."""
    straw = load_straw(args.straw)
    library = [name for name in causes(straw.cells) if name not in args.without]
    for name in args.without:
        if name not in causes(straw.cells):
            raise ReplayError(f"--without {name}: no such cause; known: {', '.join(causes(straw.cells))}")
    for path in (args.output, args.experiment):
        if path:
            check_new(path)
    runs = gather(args.runs, partial=args.partial)
    check_campaign(runs, straw.cells)
    observations = [observe(one) for one in runs]
    prepare()
    with (
        ThreadPoolExecutor() as pool,
        progress_bar("diagnose", "step") as update,
        Interrupts() as interrupts,
    ):

        def told(_what: str, done: int, total: int) -> None:
            update(done, total)

        found = inquire(
            observations,
            straw,
            library=library,
            executor=pool,
            thorough=args.thorough,
            told=told,
            stop=lambda: interrupts.pending is not None,
        )
        findings = conclude(found, _about(runs), told)
        page = report(findings, found) if args.report else ""
    print(text(findings))
    written = []
    if args.output:
        write_text(args.output, findings.straw.to_toml())
        written.append(args.output)
    if args.experiment:
        if findings.experiment is None:
            say("no experiment is proposed: nothing is left to tell apart")
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
        print(f"\nlook at {', '.join(map(str, written))}")
    return 0 if findings.verdict == "complete" else 1


def check_campaign(runs: Sequence[Run], cells: int) -> None:
    """Raise ReplayError where runs cannot be of one specimen, or not of this straw."""
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


def text(f: Findings) -> str:
    """Findings for a terminal: the verdict first."""
    lines = [f.says, f.where, ""]
    for name, p in list(f.judgement.probability.items())[:SHOWN]:
        lines.append(f"  {p:6.3f}  {name.replace('_', ' ')}")
    for cause, constants in f.parameters.items():
        lines += [f"{cause}: {constant}" for constant in figures.told(constants)]
    if f.missing:
        lines.append(f"{f.missing.says}.")
        if f.missing.formula:
            keeps = 100 * f.missing.formula.keeps
            lines.append(f"  as a formula: {f.missing.formula.text}; keeps {keeps:.0f} % of what the curve gains")
    if f.held:
        lines.append(f"fitted without {', '.join(f.held.heldout)}, there (RMS):")
        for channel, unit, scale in (("x_m", "mm", 1e3), ("z_m", "mm", 1e3), ("phi_rad", "mrad", 1e3)):
            before, after, floor = (scale * row[channel] for row in (f.held.before, f.held.after, f.held.floor))
            lines.append(f"  {channel.split('_')[0]:<4} {before:8.3f} -> {after:8.3f} {unit}, noise {floor:.3f} {unit}")
    if f.smallest:
        lines.append("the smallest effects that would have been seen:")
        lines += [f"  {cause.replace('_', ' ')}: {size}" for cause, size in sorted(f.smallest.items())]
    if f.experiment:
        e = f.experiment
        lines.append(f"next experiment: {e.why} ({e.expected_separation_sigma:.0f} sigma apart)")
    return "\n".join([*lines, *(f"note: {note}" for note in f.notes)])


def _about(runs: Sequence[Run]) -> list[str]:
    return [f"{one.run_id}: {lost}" for one in runs for lost in one.lost]
