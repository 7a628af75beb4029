"""Pictures of fits: residuals against time, before and after, with the noise; a law over its state with its band."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.page.pictures import AFTER, BAND, BEFORE, LEGEND, LINE, OTHERS, axes_of, svg, zero
from straw.replay.diagnose.page.shown import LawCurve
from straw.replay.diagnose.recording import Channel, Recording

Floats = NDArray[np.float64]

#: Samples drawn of a line.
DRAWN = 1500
#: A band of noise is so many standard deviations to either side.
BAND_SIGMAS = 2.0


def left_over(
    observed: Recording,
    channels: Sequence[Channel],
    before: Floats,
    after: Floats | None,
    fitted: NDArray[np.bool_] | None = None,
) -> str:
    """Simulated minus measured in every channel, below each other, as the channels are shown.

    ``fitted`` (n,): samples that the fit saw, shaded.
    """
    figure, rows = axes_of(5.8, 1.75 * len(channels) + 0.4, nrows=len(channels), sharex=True, squeeze=False)
    every = slice(None, None, max(1, len(observed.time_s) // DRAWN))
    t = observed.time_s[every]
    for k, (axes, channel) in enumerate(zip(rows[:, 0], channels, strict=True)):
        noise = BAND_SIGMAS * channel.shown_per_si * observed.floor()[k, every]
        zero(axes)
        if fitted is not None:
            across = axes.get_xaxis_transform()
            axes.fill_between(t, 0, 1, where=fitted[every], transform=across, color=LINE, alpha=0.5, linewidth=0)
        axes.fill_between(t, -noise, noise, color=BAND, alpha=0.45, linewidth=0, label="noise, 95 %")
        lines = [(before, BEFORE, "base model")] + ([(after, AFTER, "improved model")] if after is not None else [])
        for line, colour, label in lines:
            off = channel.shown_per_si * (line[k, every] - observed.seen[k, every])
            axes.plot(t, off, color=colour, linewidth=1.3, label=label)
        axes.set_ylabel(channel.label)
    rows[0, 0].legend(ncols=3, loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2, **LEGEND)
    rows[-1, 0].set_xlabel("time / s")
    return svg(figure, f"{observed.name}: simulated minus measured")


def law_curve(curve: LawCurve, formula: tuple[Floats, Floats] | None = None) -> str:
    """A law over its state with a band of two standard deviations; beside it a formula for it, where there is one."""
    figure, axes = axes_of(5.4, 3.3)
    x, y, e = curve.at, curve.values, BAND_SIGMAS * curve.sigmas
    zero(axes)
    if curve.parts:
        axes.errorbar(x, y, e, fmt="o", color=AFTER, capsize=3)
        axes.set_xticks(x)
    else:
        turns = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1  # a loop is filled branch by branch
        for there, back in itertools.pairwise([0, *turns, len(x) - 1]):
            branch = slice(there, back + 1)
            axes.fill_between(x[branch], (y - e)[branch], (y + e)[branch], color=AFTER, alpha=0.25, linewidth=0)
        axes.plot(x, y, color=AFTER, linewidth=1.8, label="the law" if formula is None else "the curve")
    if formula is not None:
        axes.plot(*formula, color=BEFORE, linewidth=1.3, linestyle="--", label="the formula")
    for (label, at, values), colour in zip(curve.others, OTHERS[2:], strict=False):
        axes.plot(at, values, color=colour, linewidth=1.1, label=label)
    if formula is not None or curve.others:
        axes.legend(**LEGEND)
    axes.set_xlabel(curve.over)
    axes.set_ylabel(curve.shows)
    return svg(figure, f"{curve.shows} over {curve.over}")


def shares(names: Sequence[str], stretches: Sequence[str], sigmas: Floats) -> str:
    """Where the base is off: recordings down, intervals across, RMS in sigmas; NaN where a recording lacks one."""
    figure, axes = axes_of(1.6 + 0.95 * len(stretches), 1.0 + 0.34 * len(names))
    axes.imshow(np.log10(np.maximum(sigmas, 1)), cmap="cividis", aspect="auto", vmin=0, vmax=2)
    for (i, k), value in np.ndenumerate(sigmas):
        if np.isfinite(value):
            colour = "white" if value < 10 else "black"
            axes.text(k, i, f"{value:.1f}", ha="center", va="center", fontsize=8, color=colour)
    axes.set_xticks(range(len(stretches)), stretches, rotation=20, ha="right", fontsize=8)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.spines[:].set_visible(False)
    return svg(figure, "misfit of the base model by recording and interval")
