"""straw replay: measured against predicted, as a table, a page, a picture, predictions and JSON."""

from __future__ import annotations

import argparse
import dataclasses
import math
from pathlib import Path
from typing import Any

from straw.model.straw_file import load_straw
from straw.replay.compare.comparison import Comparison, compare
from straw.replay.compare.gather import gather
from straw.replay.compare.roles import roles_of
from straw.replay.errors import ReplayError
from straw.replay.metrics.validation import RESOLVED, UNKNOWN
from straw.replay.output import check_new, write_json, write_text
from straw.replay.progress import prepare, progress_bar, say
from straw.replay.protocol.prediction import trace_of
from straw.replay.protocol.three_ways import protocol_of, three_ways
from straw.replay.report.page import page
from straw.replay.report.proxy import film
from straw.replay.report.three_ways import differences_data, differences_table, three_ways_data
from straw.replay.report.words import order
from straw.rig.run_derived import write_prediction


def run(args: argparse.Namespace) -> int:
    """Compare every run; 0 whatever the misfit, as this command sets no limit for it."""
    straw, uncertain = load_straw(args.straw), uncertain_of(args.uncertain)
    runs = gather(args.runs, partial=args.partial)
    roles = roles_of(args.fitted, runs)
    if args.video and len(runs) > 1:
        raise ReplayError(f"--video: {len(runs)} runs are given; a video belongs to one run, replay that by itself")
    if args.predictions:
        for one in runs:
            check_new(args.predictions / f"{one.run_id}-prediction.mcap")
    prepare()
    comparisons = []
    with progress_bar("replay", "run") as progress:
        for i, one in enumerate(runs):
            comparisons.append(compare(one, straw, uncertain))
            progress(i + 1, len(runs))
    written = [args.report]
    if args.predictions:
        written += [write_predicted(args.predictions, c) for c in comparisons]
    more: dict[str, dict[str, Any]] = {one.sha256: {} for one in runs}
    if args.video:
        with progress_bar("film", "frame") as progress:
            more[runs[0].sha256]["film"] = film(comparisons[0], args.video, args.camera, progress)
    thrice = {}
    if args.protocol is not None:
        for one in runs:
            say(f"{one.run_id}: the same protocol on emulator and model")
            thrice[one.sha256] = three_ways(
                one, straw, protocol_of(one, args.protocol if args.protocol != Path() else None)
            )
            more[one.sha256]["threeWays"] = three_ways_data(thrice[one.sha256])
    write_text(args.report, page(comparisons, roles, more))
    if args.json:
        data = as_data(comparisons, roles)
        for entry in data["runs"] if thrice else ():
            entry["three_ways"] = differences_data(thrice[entry["sha256"]])
        write_json(args.json, data)
    if args.png:
        written += pictures(args.png, comparisons)
    print(table(comparisons, roles))
    for sha256, ways in thrice.items():
        print(differences_table(next(one.run_id for one in runs if one.sha256 == sha256), ways))
    for one in runs:
        for sentence in one.lost:
            say(f"{one.run_id}: {sentence}")
    print(f"\nwritten to {', '.join(map(str, written))}")
    return 0


def write_predicted(folder: Path, c: Comparison) -> Path:
    """The prediction as a recording of its own on the run's clock, which viewers lay over it; returns its path."""
    path = folder / f"{c.run.run_id}-prediction.mcap"
    assert c.run.tip is not None
    write_prediction(
        path,
        "straw",
        {**c.run.metadata, **c.straw.laws, "straw": c.straw.to_toml(), "driven_by": "/pressure/measured"},
        parent_sha256=c.run.sha256,
        zero_time_ns=c.run.zero_time_ns,
        tip=trace_of(c.prediction, c.prediction.time_s),
        pressure_time_s=c.prediction.time_s,
        pressure_pa=c.prediction.pressure_pa,
    )
    return path


def pictures(path: Path, comparisons: list[Comparison]) -> list[Path]:
    """One picture a run; with several runs each has its run's id in the name."""
    from straw.replay.report.png import write_png  # matplotlib is slow to import

    paths = [path if len(comparisons) == 1 else path.with_stem(f"{path.stem}-{c.run.run_id}") for c in comparisons]
    for where, c in zip(paths, comparisons, strict=True):
        write_png(where, c)
    return paths


def uncertain_of(texts: list[str]) -> dict[str, float]:
    """Standard uncertainties of constants from NAME=SIGMA; ReplayError for anything else."""
    found = {}
    for text in texts:
        name, _, sigma = text.partition("=")
        try:
            found[name] = float(sigma)
        except ValueError:
            found[name] = math.nan
        if not found[name] > 0:
            raise ReplayError(f"--uncertain {text}: expected a constant and its sigma in SI, as r_ch_m=2e-6")
    return found


def as_data(comparisons: list[Comparison], roles: dict[str, str] | None = None) -> dict[str, Any]:
    """Metrics by run and channel, snaps and judged figures, SI, for JSON."""
    return {
        "runs": [
            {
                "run_id": c.run.run_id,
                "role": (roles or {}).get(c.run.sha256, ""),
                "specimen": c.run.specimen,
                "file": str(c.run.path),
                "sha256": c.run.sha256,
                "lost": list(c.run.lost),
                "metrics": {name: dataclasses.asdict(signal.metrics) for name, signal in c.signals.items()},
                "verdicts": {name: signal.verdict for name, signal in c.signals.items()},
                "snaps": [
                    {
                        "measured": dataclasses.asdict(p.measured) if p.measured else None,
                        "predicted": dataclasses.asdict(p.predicted) if p.predicted else None,
                        "late_s": p.late_s,
                    }
                    for p in c.pairs
                ],
                "order": order(c),
                "quantities": [
                    {**dataclasses.asdict(q), "error": q.error, "u_val": q.u_val, "verdict": q.verdict}
                    for q in c.quantities
                ],
                "uncertain_inputs": list(c.inputs),
            }
            for c in comparisons
        ],
        "straw": comparisons[0].straw.to_toml() if comparisons else "",
    }


def table(comparisons: list[Comparison], roles: dict[str, str]) -> str:
    """One line a run: RMS residuals in display units, and how far they exceed the noise."""
    width = max(len("run"), *(len(c.run.run_id) for c in comparisons))
    lines = [
        f"{'run':<{width}}  {'X / um':>9} {'Z / um':>9} {'Phi / mrad':>11} {'worst / sigma':>14} {'Phi lag / ms':>16}"
        f"   {'figures off':<12} snaps: model late by / ms"
    ]
    for c in comparisons:
        x, z, phi = (c.signals[name].metrics for name in ("x_m", "z_m", "phi_rad"))
        chi = max(m.reduced_chi2 for m in (x, z, phi)) ** 0.5
        lag = "beyond" if phi.lag_at_bound else f"{phi.lag_s * 1e3:.1f} +- {phi.lag_sigma_s * 1e3:.1f}"
        told = [q for q in c.quantities if q.verdict != UNKNOWN]
        off = f"{sum(q.verdict == RESOLVED for q in told)} of {len(told)}"
        late = ", ".join(
            f"{p.late_s * 1e3:.1f}" if p.measured and p.predicted else "missed" if p.measured else "extra"
            for p in c.pairs
        )
        lines.append(
            f"{c.run.run_id:<{width}}  {x.rmse * 1e6:9.1f} {z.rmse * 1e6:9.1f} {phi.rmse * 1e3:11.2f} "
            f"{f'{chi:.1f}' if math.isfinite(chi) else '-':>14} {lag:>16}   {off:<12} {late or 'none':<24} "
            f"{roles.get(c.run.sha256, '')}".rstrip()
        )
    return "\n".join(lines)
