"""A story as one HTML file that needs no network, with the replay page's player between verdict and evidence."""

from __future__ import annotations

import html
from collections.abc import Sequence

from straw.replay.diagnose.page.mathml import mathml
from straw.replay.diagnose.page.story import Error, LawTold, Next, Rival, Story
from straw.replay.diagnose.page.words import quantity, sig
from straw.replay.report.page import assemble

#: The replay page's scripts without its table and its plane of configurations, and their replacement.
SCRIPTS = ("base", "straw", "charts", "film", "player", "story", "main")


def written(story: Story) -> str:
    """The page's HTML."""
    kind = "story both" if story.improved else "story"
    above = _figure(story.picture.svg, story.picture.caption, "portrait") if story.picture.svg else ""
    return assemble(
        story.says,
        story.where,
        story.runs,
        kind,
        SCRIPTS,
        above=above + _player_says(story),
        below=_below(story),
        styles=("page", "story"),
    )


def _player_says(story: Story) -> str:
    if not story.runs:
        return ""
    who = "base and improved model differ most" if story.improved else "the base model is off most"
    fitted = f" {story.fitted_say}" if story.improved else ""
    return f"<h2>The recordings, played</h2><p>{text(f'They begin where {who}.{fitted}')}</p>"


def _below(s: Story) -> str:
    parts = []
    if s.laws:
        parts.append(f"<h2>{text(s.laws_head)}</h2>" + (f"<p>{text(s.laws_say)}</p>" if s.laws_say else ""))
        parts += [_law(one) for one in s.laws]
    if s.errors:
        parts.append(f"<h2>{'Before and after' if s.improved else 'How far the base model is off'}</h2>")
        parts.append(f"<p>{text(s.errors_say)}</p>{_errors(s.errors)}")
        parts.append("<div class=fits>" + "".join(_figure(one, caption) for one, caption in s.fits) + "</div>")
    if s.rivals:
        parts.append(f"<h2>What else would explain it</h2><p>{text(s.rivals_say)}</p>" + _rivals(s.rivals, s.channels))
    parts.append("<h2>What could not have been seen</h2>" + (f"<p>{text(s.unseen_says)}</p>" if s.unseen_says else ""))
    if s.unseen:
        parts.append("<div class=sizes>" + table(("cause", "its", "seen from"), s.unseen) + "</div>")
    if s.doubts:
        parts.append("<ul>" + "".join(f"<li>{text(one)}</li>" for one in s.doubts) + "</ul>")
    if s.next or s.next_says:
        parts.append("<h2>The next experiment</h2>" + (_next(s.next) if s.next else f"<p>{text(s.next_says)}</p>"))
    for name, content in s.details:
        parts.append(f"<details><summary>{text(name)}</summary>{content}</details>")
    return "<section id=evidence>" + "".join(parts) + "</section>"


def text(words: str) -> str:
    """As HTML."""
    return html.escape(str(words))


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Plain rows; wide ones scroll."""
    top = "".join(f"<th>{text(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{text(c)}</td>" for c in row) + "</tr>" for row in rows)
    return f"<div class=scroll><table><tr>{top}</tr>{body}</table></div>"


def _figure(picture: str, caption: str, kind: str = "") -> str:
    return f'<figure class="{kind}">{picture}<figcaption>{text(caption)}</figcaption></figure>'


def _law(one: LawTold) -> str:
    head, out = f"<h3>{text(one.name)}</h3>", ""
    if one.formula:
        head += f'<p class="law" title="{text(one.formula)}">{mathml(one.formula)}</p>'
    if one.words:
        out += f"<p class=facts>{text(one.words)}</p>"
    if one.constants:
        rows = "".join(
            f"<tr><td>{mathml(c.symbol)} <small>{text(c.about)}</small></td>"
            + "".join(f"<td>{text(one)}</td>" for one in quantity(c.value, c.low, c.high, c.unit))
            + "</tr>"
            for c in one.constants
        )
        top = "<tr><th>constant</th><th>value</th><th>95 % interval</th></tr>"
        out += f"<div class=scroll><table class=constants>{top}{rows}</table></div>"
    return f"<div class=found><div class=head>{head}</div><div>{out}</div>{one.picture}</div>"


def _errors(errors: Sequence[Error]) -> str:
    """Bars from zero: base, improved, noise; each channel to its own largest."""
    out = ""
    for e in errors:
        rows = [("base", e.before, "before")]
        rows += [("improved", e.after, "after")] if e.after is not None else []
        rows.append(("noise", e.noise, "noise"))
        most = max(value for _, value, _ in rows) or 1.0
        bars = "".join(
            f"<tr><td>{name}</td><td class=bar><span class={kind} style='width:{max(0.4, 100 * v / most):.1f}%'></span>"
            f"</td><td>{sig(v)} {text(e.unit)}</td></tr>"
            for name, v, kind in rows
        )
        note = f"<p class=facts>{text(e.explained)}</p>" if e.explained else ""
        out += f"<div><h3>{text(e.label)}</h3><table>{bars}</table>{note}</div>"
    return f"<div class=errors>{out}</div>"


def _rivals(rivals: Sequence[Rival], channels: Sequence[str]) -> str:
    head = "".join(f"<th>{text(c)}</th>" for c in channels)
    rows = "".join(
        f"<tr{' class=chosen' if r.chosen else ''}><td>{text(r.name)}</td><td>{_percent(r.probability)}</td>"
        f"<td class=bar><span class=after style='width:{100 * r.probability:.1f}%'></span></td>"
        + "".join(f"<td>{text(one)}</td>" for one in (r.leaves or [""] * len(channels)))
        + "</tr>"
        for r in rivals
    )
    top = f"<tr><th></th><th>probability</th><th></th>{head}</tr>"
    return f"<div class=scroll><table class=rivals>{top}{rows}</table></div>"


def _percent(p: float) -> str:
    return "< 0.1 %" if p < 1e-3 else f"{100 * p:.1f} %"


def _next(n: Next) -> str:
    out = f"<p>{text(n.why)}</p>"
    if n.drawing.svg:
        out += _figure(n.drawing.svg, n.drawing.caption)
    if n.drawing.commands:
        out += "<pre class=commands>" + text("\n".join(n.drawing.commands)) + "</pre>"
    return out + f"<details><summary>The protocol</summary><pre>{text(n.protocol)}</pre></details>"
