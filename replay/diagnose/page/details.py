"""Details below the story: where the base is off, which constant varies between runs, the model's text."""

from __future__ import annotations

import html

import numpy as np

from straw.replay.diagnose.findings import Findings
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.page.fits import shares
from straw.replay.diagnose.page.write import table


def details(f: Findings, found: Inquiry) -> list[tuple[str, str]]:
    """Headings and HTML."""
    out = [("Where the base model is off, in standard deviations (RMS), by recording and interval", _map(found))]
    if f.located:
        rows = [
            (
                one.run,
                one.channel,
                one.phase,
                f"{one.from_s:.2f} to {one.to_s:.2f} s",
                ", ".join(map(str, one.cells)) or "-",
                one.kind,
                f"{100 * one.share_of_misfit:.0f} %",
            )
            for one in f.located
        ]
        head = ("run", "channel", "phase", "time", "cell", "a matter of", "share of squared misfit")
        out.append(("The intervals that differ most", table(head, rows)))
    if f.wandering:
        wandering = [(w.constant, w.equation, f"{w.spread_sigma:.0f}", w.goes_with) for w in f.wandering[:4]]
        columns = ("constant", "equation", "spread, standard deviations", "goes with")
        words = "<p>If each run had constants of its own: their spread, and the condition it correlates with.</p>"
        out.append(("Which constant of the base would have to vary from run to run", words + table(columns, wandering)))
    out += [(f"The {name}, as a file", f"<pre>{html.escape(text)}</pre>") for name, text in f.written.items()]
    return out


def _map(found: Inquiry) -> str:
    campaign, null = found.campaign, found.null
    rows = campaign.misfits(null.unknowns, [null.u])[0]
    table_: dict[tuple[int, str], float] = {}
    for i, (observed, one) in enumerate(zip(campaign.observations, rows, strict=True)):
        for part in observed.stretches():
            here = (observed.time_s >= part.from_s) & (observed.time_s <= part.to_s)
            if one is not None and here.any():
                scaled = one.plain[:, here] / observed.sigma()[:, here]
                table_[i, part.phase] = float(np.sqrt(np.mean(scaled**2)))
    phases = sorted({phase for _, phase in table_}, key=_place)
    if not phases:
        return ""
    grid = np.full((len(rows), len(phases)), np.nan)
    for (i, phase), value in table_.items():
        grid[i, phases.index(phase)] = value
    picture = shares([o.name for o in campaign.observations], phases, grid)
    return f'<figure style="max-width:{14 + 9 * len(phases)}em">{picture}</figure>'


def _place(phase: str) -> tuple[float, int]:
    """Order of phases in time: before, during, between, after; runs without a snap last."""
    numbers = [int(word) for word in phase.split() if word.isdigit()]
    if not numbers:
        return np.inf, 0
    return numbers[0], ("before", "during", "between", "after").index(phase.split()[0]) + 9 * phase.startswith("after")
