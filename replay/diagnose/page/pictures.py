"""Matplotlib figures as inline SVG with the page's font and the theme's colours."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colours of the figures, and their names in the page's style sheet.
INK, SOFT, LINE, BEFORE, AFTER, BAND = "#010101", "#020202", "#030303", "#040404", "#050505", "#060606"
THEMED = {INK: "ink", SOFT: "soft", LINE: "line", BEFORE: "before", AFTER: "after", BAND: "noise"}
#: Colours of lines other than base and improved model.
OTHERS = (BEFORE, AFTER, INK, SOFT)
#: Legends without a frame, in the page's smaller size of letters, points.
LEGEND: dict[str, Any] = {"frameon": False, "labelcolor": INK, "fontsize": 9}
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "straw", "font.size": 10, "axes.edgecolor": SOFT, "axes.labelcolor": SOFT, "xtick.color": SOFT,
    "ytick.color": SOFT, "text.color": INK, "axes.facecolor": "none", "figure.facecolor": "none",
    "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False, "axes.titlelocation": "left",
    "axes.titlesize": 10, "font.family": "sans-serif",
}  # fmt: skip


def axes_of(width: float = 5.4, height: float = 3.0, **grid: Any) -> tuple[Figure, Any]:
    """A figure of the page's size and its axes, as `Figure.subplots` gives them."""
    import matplotlib as mpl  # slow to import
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        return figure, figure.subplots(**grid)


def zero(axes: Axes) -> None:
    """A thin line where nothing differs."""
    axes.axhline(0, color=LINE, linewidth=0.8)


def svg(figure: Figure, alt: str) -> str:
    """The figure as an SVG element as wide as its place."""
    import matplotlib as mpl

    out = io.StringIO()
    with mpl.rc_context(STYLE):
        figure.savefig(out, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    text = out.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'(<svg [^>]*?) ?width="[^"]*"', r"\1", text, count=1)
    text = re.sub(r'(<svg [^>]*?) ?height="[^"]*"', r"\1", text, count=1)
    for colour, name in THEMED.items():
        text = text.replace(colour, f"var(--{name})")
    text = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font-size: \1", text)
    return text.replace("<svg ", f'<svg role="img" aria-label="{_attribute(alt)}" ', 1)


def _attribute(text: str) -> str:
    import html

    return html.escape(text)
