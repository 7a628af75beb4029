"""The diagnosis as one page a physicist reads from the verdict's sentence down to the evidence."""

from __future__ import annotations

import html
import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.findings import Findings
from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.heldout import Held
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.system import Channel

Floats = NDArray[np.float64]

STYLE = """
:root{--ink:#1b1f24;--soft:#5c666e;--line:#d8dde2;--paper:#fff;--mark:#0072b2}
@media (prefers-color-scheme:dark){:root{--ink:#e6e9ec;--soft:#97a2ab;--line:#333b43;--paper:#14181c;--mark:#56b4e9}
 img{background:#fff;border-radius:4px}}
body{margin:0 auto;max-width:1100px;padding:24px;background:var(--paper);color:var(--ink);
 font:16px/1.5 system-ui,sans-serif}
h1{font-size:25px;line-height:1.3;margin:0 0 6px}h2{font-size:18px;margin:28px 0 6px}
p.where{font-size:17px;margin:0 0 16px}.soft,figcaption{color:var(--soft);font-size:14px}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}
td,th{text-align:right;padding:3px 14px 3px 0;border-bottom:1px solid var(--line)}
td:first-child,th:first-child{text-align:left}th{font-weight:600;color:var(--soft);font-size:14px}
.bar{display:inline-block;height:10px;background:var(--mark)}img{max-width:100%}figure{margin:8px 0 16px}
pre{font-size:13px;border:1px solid var(--line);padding:10px;overflow-x:auto}
@media (max-width:600px){body{padding:14px}table{display:block;overflow-x:auto}}@media print{pre{white-space:pre-wrap}}
"""


def report(findings: Findings, found: Inquiry) -> str:
    """The page's HTML; needs no network."""
    f, parts = findings, []
    rows: list[tuple[str, ...]]
    parts.append(f"<h1>{_text(f.says)}</h1><p class=where>{_text(f.where)}</p>")
    parts.append("<h2>What explains the runs</h2>" + _probabilities(f))
    if f.parameters:
        rows = [
            (f"{cause}: {name}", f"{v['value']:.4g}", f"± {v['sigma']:.2g}", v["unit"])
            for cause, constants in f.parameters.items()
            for name, v in constants.items()
        ]
        parts.append("<h2>What was added</h2>" + _table(("constant", "value", "one sigma", "unit"), rows))
    if f.held:
        parts.append("<h2>Before and after</h2>" + _held(f, found))
        lines = "base model (orange) and improved model (blue)" if f.improved else "and base model (orange)"
        parts.append(_figure(_overlay(f, found), f"Measured (black), {lines}."))
    parts.append("<h2>Where they differ</h2>")
    parts.append(_figure(_map(found), "Misfit of the base model by run and stretch, sigmas (root mean square)."))
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
        parts.append(_table(("run", "channel", "phase", "time", "cell", "a matter of", "share of misfit"), rows))
    parts.append("<h2>Which constant would have to wander</h2>" + _wandering(f))
    if f.smallest:
        rows = [(cause.replace("_", " "), size) for cause, size in sorted(f.smallest.items())]
        parts.append("<h2>The smallest effects that would have been seen</h2>" + _table(("cause", "size"), rows))
    if f.experiment:
        e = f.experiment
        parts.append(
            f"<h2>Next experiment</h2><p>{_text(e.why)}; expected to set them {e.expected_separation_sigma:.0f} sigma "
            f"apart.</p><pre>{_text(e.protocol)}</pre>"
        )
    if f.missing:
        parts.append("<h2>What is missing</h2>" + _missing(f.missing))
    if f.notes:
        parts.append("<h2>Notes</h2><ul>" + "".join(f"<li>{_text(n)}</li>" for n in f.notes) + "</ul>")
    for name, text in f.written.items():
        parts.append(f"<h2>The {_text(name)}</h2><pre>{_text(text)}</pre>")
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{_text(f.says)}</title><style>{STYLE}</style><body>{''.join(parts)}</body></html>\n"
    )


def _text(words: str) -> str:
    return html.escape(words)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    top = "".join(f"<th>{_text(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{_text(c)}</td>" for c in row) + "</tr>" for row in rows)
    return f"<table><tr>{top}</tr>{body}</table>"


def _probabilities(f: Findings) -> str:
    rows = ""
    for name, p in list(f.judgement.probability.items())[:8]:
        left = f.judgement.excess.get(name)
        wide = f"max(1px,{p:.3f} * min(260px, 24vw))"
        rows += (
            f"<tr><td>{_text(name.replace('_', ' ').replace('+', ' and '))}</td><td>{p:.3f}</td>"
            f"<td style='text-align:left'><span class=bar style='width:{wide}'></span></td>"
            f"<td>{'' if left is None else f'{left:.0f}'}</td></tr>"
        )
    head = "<tr><th>hypothesis</th><th>probability</th><th></th><th>left unexplained, sigmas squared</th></tr>"
    return f"<table>{head}{rows}</table>"


def _held(f: Findings, found: Inquiry) -> str:
    assert f.held is not None
    held, rows = f.held, []
    columns = {"base model": held.before, **({"improved": held.after} if f.improved else {}), "noise": held.floor}
    for channel in found.campaign.system.channels:
        values = (channel.shown_per_si * row[channel.name] for row in columns.values())
        rows.append((channel.label, *(f"{v:.3f}" for v in values)))
    after = f" before, {held.chi2_after:.2f} after" if f.improved else ""
    return (
        f"<p>{'Both models' if f.improved else 'The base model'} fitted to {_text(', '.join(held.train))} (chi-square "
        f"per value {held.chi2_before:.2f}{after}) and tried on {_text(', '.join(held.heldout))}, RMS there:</p>"
        + _table(("", *columns), rows)
        + (_explained(held, found.campaign.system.channels) if f.improved else "")
    )


def _explained(held: Held, channels: Sequence[Channel]) -> str:
    """What share of the mean squared misfit above noise each cause takes away there, and what remains."""
    rows = [
        (one["cause"].replace("_", " ").replace("+", " and "), *(f"{100 * x:.0f} %" for x in one["share"].values()))
        for one in held.explained()
    ]
    left = (f"{c.shown_per_si * held.remainder[c.name]:.3g} {c.shown_unit}" for c in channels)
    rows.append(("remains above noise (RMS)", *left))
    return "<p>Share of the mean squared misfit above noise explained there:</p>" + _table(
        ("", *(c.symbol for c in channels)), rows
    )


def _wandering(f: Findings) -> str:
    rows = [(w.constant, w.equation, f"{w.spread_sigma:.0f}", w.goes_with) for w in f.wandering[:4]]
    text = "<p class=soft>If each run had constants of its own: how far they would spread, and with what.</p>"
    return text + _table(("constant", "equation", "spread, sigmas", "goes with"), rows)


def _missing(m: Any) -> str:
    """The missing force: in words, as a formula, drawn."""
    words = f"<p>{_text(m.says)}.</p>"
    if m.formula:
        words += (
            f"<p><code>{_text(m.formula.text)}</code><br><span class=soft>keeps {100 * m.formula.keeps:.0f} % of what "
            "the curve gains; beside the base's constants, which were free.</span></p>"
        )
    rest = ", ".join(f"{name} {100 * share:.0f} %" for name, share in m.others)
    caption = f"The curve at its points with one sigma{', and the formula' if m.formula else ''}."
    if rest:
        caption += f" Taken away by curves over other states: {rest}."
    return words + _figure(_curve(m), caption)


def _curve(m: Any) -> str:
    from matplotlib.figure import Figure

    state = m.curve.state
    figure = Figure(figsize=(7.5, 4))
    axes = figure.subplots()
    axes.axhline(0, color="#97a2ab", linewidth=0.8)
    axes.fill_between(m.at, m.values - m.sigmas, m.values + m.sigmas, color="#0072b2", alpha=0.2, linewidth=0)
    axes.errorbar(m.at, m.values, m.sigmas, fmt="o-", color="#0072b2", capsize=3, label="curve, one sigma")
    if m.formula:
        x = np.linspace(m.at[0], m.at[-1], 400)
        axes.plot(x, m.formula.of(x), color="#d55e00", label="formula")
        axes.legend(frameon=False)
    axes.set_xlabel(f"{state.symbol} / {state.state_unit}")
    axes.set_ylabel(f"{state.value_symbol} / {state.value_unit}")
    return _svg(figure)


def _figure(picture: str, caption: str) -> str:
    picture = f'<img src="data:image/svg+xml;base64,{picture}" alt="{_text(caption)}">'
    return f"<figure>{picture}<figcaption>{_text(caption)}</figcaption></figure>"


def _svg(figure: Any) -> str:
    import base64

    out = io.BytesIO()
    figure.savefig(out, format="svg", bbox_inches="tight")
    return base64.b64encode(out.getvalue()).decode()


def _map(found: Inquiry) -> str:
    """Runs down, stretches across: how many sigmas the base model is off."""
    from matplotlib.figure import Figure

    campaign, null = found.campaign, found.null
    rows = campaign.misfits(null.unknowns, [null.u])[0]
    phases: list[str] = []
    table: dict[tuple[int, str], float] = {}
    for i, (observed, one) in enumerate(zip(campaign.observations, rows, strict=True)):
        for part in observed.stretches():
            phase = part.phase
            here = (observed.time_s >= part.from_s) & (observed.time_s <= part.to_s)
            if one is None or not here.any():
                continue
            phases += [phase] if phase not in phases else []
            table[i, phase] = float(np.sqrt(np.mean((one.plain[:, here] / observed.sigma()[:, here]) ** 2)))
    phases.sort(key=_place)
    grid = np.full((len(rows), len(phases)), np.nan)
    for (i, phase), value in table.items():
        grid[i, phases.index(phase)] = value
    figure = Figure(figsize=(1.5 + 1.15 * len(phases), 0.8 + 0.36 * len(rows)))
    axes = figure.subplots()
    axes.imshow(np.log10(np.maximum(grid, 1)), cmap="cividis", aspect="auto", vmin=0, vmax=2)
    for (i, phase), value in table.items():
        axes.text(phases.index(phase), i, f"{value:.1f}", ha="center", va="center", fontsize=8,
                  color="white" if value < 10 else "black")  # fmt: skip
    axes.set_xticks(range(len(phases)), phases, rotation=20, ha="right", fontsize=8)
    axes.set_yticks(range(len(rows)), [o.name for o in campaign.observations], fontsize=8)
    return _svg(figure)


def _place(phase: str) -> tuple[float, int]:
    """Order of phases in time: before, during, between, after; runs without a snap last."""
    numbers = [int(word) for word in phase.split() if word.isdigit()]
    if not numbers:
        return np.inf, 0
    return numbers[0], ("before", "during", "between", "after").index(phase.split()[0]) + 9 * phase.startswith("after")


def _overlay(f: Findings, found: Inquiry) -> str:
    """The runs held out: tip measured, before and after."""
    from matplotlib.figure import Figure

    assert f.held is not None
    shown = [o for o in found.campaign.observations if o.name in f.held.heldout]
    fits: list[tuple[Campaign, Fit, str]] = [(found.campaign, found.null, "#d55e00")]
    if f.best:
        fits.append((found.campaign, f.best.fit, "#0072b2"))
    if f.discovered:
        fits.append((f.missing.curve.campaign, f.missing.curve.fit, "#0072b2"))
    figure = Figure(figsize=(10, 2.6 * len(shown)))
    channels = found.campaign.system.channels
    grid = figure.subplots(len(shown), len(channels), squeeze=False)
    for row, observed in zip(grid, shown, strict=True):
        for axes, values, channel in zip(row, observed.seen, channels, strict=True):
            axes.plot(observed.time_s, channel.shown_per_si * values, color="#1b1f24", linewidth=1.6, alpha=0.7)
            axes.set_title(f"{observed.name}: {channel.label}", fontsize=9)
            axes.tick_params(labelsize=8)
        for campaign, fit, colour in fits:
            lines = campaign.system.simulated(observed, fit.unknowns, fit.u)
            for axes, line, channel in zip(row, lines, channels, strict=True):
                axes.plot(observed.time_s, channel.shown_per_si * line, color=colour, linewidth=0.9)
    figure.tight_layout()
    return _svg(figure)
