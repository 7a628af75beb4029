"""A comparison in sentences."""

from __future__ import annotations

import numpy as np

from straw.replay.compare.comparison import CHANNELS, Comparison


def sentence(comparisons: list[Comparison]) -> str:
    """The result in one or two sentences."""
    worst = max(comparisons, key=_misfit)
    x, z, phi = (worst.signals[name].metrics.rmse for name in CHANNELS)
    which = "the model" if len(comparisons) == 1 else f"the worst run, {worst.run.run_id},"
    off = f"{x * 1e6:.0f} µm in X, {z * 1e6:.0f} µm in Z and {phi * 1e3:.2f} mrad in Φ"
    pairs = [pair for c in comparisons for pair in c.pairs]
    late = [abs(pair.late_s) for pair in pairs if np.isfinite(pair.late_s)]
    snaps = ""
    if pairs:
        snaps = f" {len(late)} of {len(pairs)} snaps are in both"
        snaps += f", the model's at most {max(late) * 1e3:.1f} ms from the measured." if late else "."
    return f"RMS from model to measurement: {which} is off by {off}.{snaps}"


def _misfit(c: Comparison) -> float:
    """Largest misfit of a run's signals in sigmas, squared; those without a sigma count for nothing."""
    return max(float(np.nan_to_num(s.metrics.reduced_chi2)) for s in c.signals.values())


def order(c: Comparison) -> str:
    """Whether cells snap in the same order."""
    both = [(p.measured.cell, p.predicted.cell) for p in c.pairs if p.measured and p.predicted]
    if len(both) < len(c.pairs):
        return f"{len(c.measured.snaps)} snaps were measured, {len(c.predicted.snaps)} predicted."
    if not both:
        return "No cell snaps, in measurement or prediction."
    seen, said = zip(*both, strict=True)
    if 0 in seen:
        return "At least one measured snap hinges where the model has none: the order of cells cannot be determined."
    return f"Cells snap in the order {', '.join(map(str, seen))}; predicted: {', '.join(map(str, said))}."
