"""A discovery as one page: the verdict, recordings with base and improved model, the law, what was not told apart."""

from __future__ import annotations

import base64
import html
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.discover.findings import SystemFindings
from straw.replay.diagnose.discover.words import Told, law_text
from straw.replay.diagnose.report import STYLE
from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.shapes import TABLE

Floats = NDArray[np.float64]

#: Colours of what is measured, the base, and the improved model; recordings drawn; samples drawn of each.
INK, BASE, BETTER = "#1b1f24", "#d55e00", "#0072b2"
DRAWN, SAMPLES = 3, 4000
#: What is worth a look closer: so many of the samples around where base and improved model part most.
CLOSE = 0.12


def page(f: SystemFindings) -> str:
    """The page's HTML; needs no network."""
    d = f.discovery
    title = d.base.system.model.title
    parts = [f"<p class=soft>{_text(title)}</p><h1>{_text(f.says)}</h1>"]
    if f.laws:
        parts.append("<h2>What was found</h2>" + "".join(_law(one, k) for k, one in enumerate(f.laws, 1)))
        parts += [f"<p>{_text(one[:1].upper() + one[1:])}.</p>" for one in f.asides]
    parts.append("<h2>Before and after, where nothing was fitted</h2>" + _errors(f))
    colours = "Measured (black), base model (orange)" + (", improved model (blue)" if f.laws else "")
    parts.append(_figure(_overlay(f), f"{colours}. Grey: what was fitted. Below: where the models part most, closer."))
    if f.laws and len(f.probability) > 1:
        rows = [(name, f"{p:.2f}") for name, p in f.probability.items()]
        head = ("first law", "comes first, of drawings of the blocks")
        parts.append("<h2>How sure is the choice</h2>" + _table(head, rows))
    tried = [one for step in f.discovery.steps for one in step.fitted if one not in f.discovery.accepted][:8]
    if tried:
        unit = d.base.predicts
        rows = [(one.laws[-1].says, f"{100 * np.sqrt(one.predicts / unit):.1f} %") for one in tried]
        parts.append("<h2>What else was fitted</h2>" + _table(("law", "error of prediction, of the base's"), rows))
    if f.located:
        places = [
            (x["run"], x["channel"], f"{x['from_s']:.3g} to {x['to_s']:.3g} s", f"{100 * x['share_of_misfit']:.0f} %")
            for x in f.located[:8]
        ]
        parts.append("<h2>Where the base is off</h2>" + _table(("recording", "channel", "time", "share"), places))
    parts.append("<h2>Constants</h2>" + _constants(f))
    if f.laws:
        code = "\n".join(law_text(d.best, k) for k in range(len(f.laws)))
        parts.append(f"<h2>As Python</h2><pre>{_text(code)}</pre>")
    sha = d.base.system.model.sha256[:16]
    parts.append(f"<p class=soft>System {_text(d.base.system.model.path.name)}, SHA-256 {sha}…</p>")
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{_text(title)}</title><style>{STYLE}</style><body>{''.join(parts)}</body></html>\n"
    )


def _law(one: Told, number: int) -> str:
    rows = [(n, f"{v:.4g}", f"± {s:.2g}", u if u != "1" else "") for n, (v, s, u) in one.constants.items()]
    words = f"<p><b>{number}. {_text(one.law.said[:1].upper() + one.law.said[1:])}</b><br>"
    words += f"<code>{_text(one.formula)}</code></p>"
    if one.law.shape != TABLE:
        words += _table(("constant", "value", "one sigma", "unit"), rows)
    if one.law.over == "nothing":
        return words
    return words + _figure(_curve(one), f"The law over {_text(one.law.over)}, with one sigma.")


def _curve(one: Told) -> str:
    figure, axes = _axes(6.6, 3.0)
    x, y, e = one.curve
    axes.axhline(0, color="#97a2ab", linewidth=0.8)
    axes.fill_between(x, y - e, y + e, color=BETTER, alpha=0.2, linewidth=0)
    axes.plot(x, y, color=BETTER)
    axes.set_xlabel(f"{one.law.state.name} / {one.law.state.unit}")
    axes.set_ylabel(f"{one.law.place.says} / {one.law.place.unit}".removesuffix(" / 1"), fontsize=8)
    return _svg(figure)


def _errors(f: SystemFindings) -> str:
    d, rows = f.discovery, []
    for k, channel in enumerate(d.base.system.channels):
        steps = [f"{h[k]:.4g}" for h in d.held]
        rows.append((channel.label, *steps, f"{d.noise[k]:.2g}", f"{f.remainder[k]:.3g}"))
    added = [f"with law {k}" for k in range(1, len(d.held))]
    head = ("RMS", "base", *added, "noise", "left above noise")
    note = ""
    if f.explained:
        shares = [
            f"law {k}: {', '.join(f'{c} {100 * s:.0f} %' for c, s in one['share'].items())}"
            for k, one in enumerate(f.explained, 1)
        ]
        note = f"<p class=soft>Explained of the base's mean squared error above noise: {_text('; '.join(shares))}.</p>"
    return _table(head, rows) + note


def _overlay(f: SystemFindings) -> str:
    d = f.discovery
    shown = sorted(f.recordings, key=lambda o: (not o.held.any(), o.name))[:DRAWN]
    channels = d.base.system.channels
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.6 * len(shown) * len(channels)), layout="constrained")
    grid = figure.subplots(2 * len(shown) * len(channels), 1, squeeze=False)[:, 0]
    row = 0
    for one in shown:
        before = d.base.system.simulated(one, d.base.fit.unknowns, d.base.fit.u)
        after = d.best.system.simulated(one, d.best.fit.unknowns, d.best.fit.u) if f.laws else None
        for k, channel in enumerate(channels):
            for axes, where in zip(grid[row : row + 2], _windows(one, k, before, after), strict=True):
                _drawn(axes, one, k, where, before, after)
                axes.set_ylabel(channel.label, fontsize=9)
            grid[row].set_title(one.name, fontsize=10, loc="left")
            row += 2
    grid[-1].set_xlabel("time / s", fontsize=9)
    return _svg(figure)


def _windows(one: Recorded, k: int, before: Floats, after: Floats | None) -> tuple[slice, slice]:
    """All of a recording, and the part in which the models part most (or the base is most off)."""
    n = len(one.time_s)
    apart = np.abs(np.nan_to_num(before[k] - (one.seen[k] if after is None else after[k])))
    width = max(8, int(CLOSE * n))
    if n <= 2 * width:
        return slice(0, n), slice(0, n)
    total = np.convolve(apart * (one.held if one.held.any() else True), np.ones(width), mode="valid")
    first = int(np.argmax(total))
    return slice(0, n), slice(first, first + width)


def _drawn(axes: Any, one: Recorded, k: int, where: slice, before: Floats, after: Floats | None) -> None:
    every = max(1, (where.stop - where.start) // SAMPLES)
    cut = slice(where.start, where.stop, every)
    t = one.time_s[cut]
    if one.fitted.any() and one.held.any():
        low, high = np.nanmin(one.seen[k]), np.nanmax(one.seen[k])
        axes.fill_between(t, low, high, where=one.fitted[cut], color="#d8dde2", alpha=0.5, linewidth=0, step="mid")
    few = len(t) < 200
    axes.plot(t, one.seen[k, cut], color=INK, linewidth=1.2, marker="." if few else "", alpha=0.75)
    axes.plot(t, before[k, cut], color=BASE, linewidth=1.0)
    if after is not None:
        axes.plot(t, after[k, cut], color=BETTER, linewidth=1.0)
    axes.tick_params(labelsize=8)


def _constants(f: SystemFindings) -> str:
    d, rows = f.discovery, []
    better = {k.target: k.value(float(u)) for k, u in zip(d.best.fit.unknowns, d.best.fit.u, strict=True)}
    for k, u in zip(d.base.fit.unknowns, d.base.fit.u, strict=True):
        name, unit = d.base.system.named(k)[1:]
        rows.append((name, f"{k.value(float(u)):.4g}", f"{better[k.target]:.4g}", unit))
    return _table(("constant", "base alone", "beside the laws", "unit"), rows) if rows else "<p>None are free.</p>"


def _axes(width: float, height: float) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots()


def _svg(figure: Any) -> str:
    out = io.BytesIO()
    figure.savefig(out, format="svg", bbox_inches="tight")
    return base64.b64encode(out.getvalue()).decode()


def _figure(picture: str, caption: str) -> str:
    image = f'<img src="data:image/svg+xml;base64,{picture}" alt="{_text(caption)}">'
    return f"<figure>{image}<figcaption>{_text(caption)}</figcaption></figure>"


def _table(head: tuple[str, ...], rows: list[Any]) -> str:
    top = "".join(f"<th>{_text(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{_text(str(c))}</td>" for c in row) + "</tr>" for row in rows)
    return f"<div style='overflow-x:auto'><table><tr>{top}</tr>{body}</table></div>"


def _text(words: str) -> str:
    return html.escape(words)
