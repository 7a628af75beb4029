"""straw replay: measured against predicted, as a table, a page and JSON."""

from __future__ import annotations

import argparse
import dataclasses
import math

from model.parameters import load_straw
from replay.compare import Comparison, compare
from replay.gather import gather
from replay.output import write_json, write_text
from replay.progress import prepare, progress_bar, say
from replay.report.page import page


def run(args: argparse.Namespace) -> int:
    """Compare every run; 0 whatever the misfit, for how good is good enough is not for this command to say."""
    straw = load_straw(args.straw)
    runs = gather(args.runs, partial=args.partial)
    prepare()
    comparisons = []
    with progress_bar("replay", "run") as progress:
        for i, one in enumerate(runs):
            comparisons.append(compare(one, straw))
            progress(i + 1, len(runs))
    write_text(args.report, page(comparisons))
    if args.json:
        write_json(args.json, as_data(comparisons))
    print(table(comparisons))
    for one in runs:
        for sentence in one.lost:
            say(f"{one.run_id}: {sentence}")
    print(f"\nlook at {args.report}")
    return 0


def as_data(comparisons: list[Comparison]) -> dict[str, object]:
    """Metrics by run and channel, SI, for JSON."""
    return {
        "runs": [
            {
                "run_id": c.run.run_id,
                "specimen": c.run.specimen,
                "file": str(c.run.path),
                "sha256": c.run.sha256,
                "lost": list(c.run.lost),
                "metrics": {name: dataclasses.asdict(signal.metrics) for name, signal in c.signals.items()},
            }
            for c in comparisons
        ],
        "straw": comparisons[0].straw.to_toml() if comparisons else "",
    }


def table(comparisons: list[Comparison]) -> str:
    """RMSE of every run in units people read."""
    width = max([len(c.run.run_id) for c in comparisons] + [3])
    lines = [f"{'run':<{width}}  {'X rms/um':>9} {'Z rms/um':>9} {'Phi rms/mrad':>13} {'worst/sigma':>12}"]
    for c in comparisons:
        x, z, phi = (c.signals[name].metrics for name in ("x_m", "z_m", "phi_rad"))
        chi = max(m.reduced_chi2 for m in (x, z, phi)) ** 0.5
        lines.append(
            f"{c.run.run_id:<{width}}  {x.rmse * 1e6:9.1f} {z.rmse * 1e6:9.1f} {phi.rmse * 1e3:13.2f} "
            f"{f'{chi:.1f}' if math.isfinite(chi) else '-':>12}"
        )
    return "\n".join(lines)
