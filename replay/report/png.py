"""The comparison as a picture for a paper: measured with its band, prediction, residual in sigmas, pressure, snaps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from straw.replay.compare.comparison import Comparison
from straw.replay.errors import ReplayError
from straw.replay.paper.style import figure
from straw.replay.report.data import SHOWN

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MEASURED, PREDICTED, INSIDE, SOFT = "#1b1f24", "#d55e00", "#0072b2", "#8a949c"


def overlay(c: Comparison) -> Figure:
    """One run: measured and predicted tip, their residuals, pressure and snaps, over time."""
    fig = figure(7.0, 8.2)
    heights = [2.2, 1.0] * len(SHOWN) + [1.8]
    panels = fig.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    for k, (name, (title, unit, factor)) in enumerate(SHOWN.items()):
        s, main, below = c.signals[name], panels[2 * k], panels[2 * k + 1]
        known = bool(np.all(np.isfinite(s.sigma)))
        gap = np.diff(s.time_s, prepend=s.time_s[0]) > 2.5 * np.median(np.diff(s.time_s))  # no line across gaps
        seen, said = (np.where(gap, np.nan, values * factor) for values in (s.measured, s.predicted))
        if known:
            band = 2 * s.sigma * factor
            main.fill_between(s.time_s, seen - band, seen + band, color=MEASURED, alpha=0.2, lw=0)
        main.plot(s.time_s, seen, color=MEASURED, lw=2.2, label="measured, ±2 sigma" if known else "measured")
        main.plot(s.time_s, said, color=PREDICTED, lw=0.9, label="model")
        main.set_ylabel(f"{title} / {unit}")
        scale = s.sigma if known else np.full_like(s.sigma, 1 / factor)
        below.plot(s.time_s, np.where(gap, np.nan, (s.predicted - s.measured) / scale), color=PREDICTED, lw=0.7)
        below.axhline(0, color=SOFT, lw=0.5)
        below.set_ylabel("residual / sigma" if known else f"residual / {unit}")
        if known:
            # points, so that noise is recognised as noise
            most = max(4.0, 1.1 * float(np.abs(below.get_lines()[0].get_ydata()).max()))
            below.set_ylim(-most, most)
    last, run, p = panels[-1], c.run, c.prediction
    assert run.pressure is not None
    last.plot(run.pressure.time_s, run.pressure.pressure_pa / 1e3, color=MEASURED, lw=2.2, label="measured")
    if run.command:
        last.plot(run.pressure.time_s, run.command(run.pressure.time_s) / 1e3, "--", color=SOFT, lw=1, label="command")
    last.plot(p.time_s, p.pressure_pa / 1e3, ":", color=INSIDE, lw=1.2, label="model, inside")
    last.set(ylabel="pressure / kPa", xlabel="time since the run's zero / s", xlim=(p.time_s[0], p.time_s[-1]))
    for axes in panels:
        for pair in c.pairs:
            for snap, color, style in ((pair.measured, MEASURED, "-"), (pair.predicted, PREDICTED, "--")):
                if snap:
                    axes.axvline(snap.start_s, color=color, lw=0.6, ls=style, alpha=0.6)
    panels[0].legend(loc="best", ncols=2)
    last.legend(loc="best", ncols=3)
    fig.align_ylabels(panels)
    return fig


def write_png(path: Path, c: Comparison) -> None:
    """Draw one run and save it as the path's suffix says (png, svg, pdf); ReplayError where that cannot be."""
    fig = overlay(c)
    part = path.with_name(path.name + ".part")
    try:
        fig.savefig(part, format=path.suffix.lstrip(".").lower() or "png", dpi=200)
        part.replace(path)
    except OSError as error:
        raise ReplayError(f"{path}: cannot be written: {error.strerror}; choose another place") from None
    except ValueError:
        raise ReplayError(f"{path}: unknown kind of picture; end the name in .png, .svg or .pdf") from None
    finally:
        part.unlink(missing_ok=True)
