"""One look for all figures, and saving them whole as PNG and SVG."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from straw.replay.errors import ReplayError

STABLE, UNSTABLE = "#1f5fa8", "#c8372d"
#: Cells that snap, then those that stay.
CELLS, QUIET = {1: "#d1495b", 4: "#2a7f9e"}, "#9aa0a6"
LOOK = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
    "svg.hashsalt": "straw",  # the same figure is the same file
    "svg.fonttype": "none",  # text stays text
}


def figure(width_in: float, height_in: float) -> Figure:
    """An empty figure with the common look; no window system is touched."""
    for name, value in LOOK.items():
        mpl.rcParams[name] = value  # type: ignore[index]  # the names are literals in matplotlib's stubs
    return Figure(figsize=(width_in, height_in), layout="constrained")


def label(axes: Axes, title: str, x: str, y: str) -> None:
    """Title and axis labels."""
    axes.set(title=title, xlabel=x, ylabel=y)


def save(fig: Figure, folder: Path, name: str) -> list[str]:
    """Write NAME.png and NAME.svg; returns the files' names."""
    for kind in ("png", "svg"):
        path = folder / f"{name}.{kind}"
        part = path.with_name(path.name + ".part")
        try:
            fig.savefig(part, format=kind, dpi=200, metadata={"Date": None} if kind == "svg" else {})
            part.replace(path)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise ReplayError(f"{path}: cannot be written: {error.strerror}; choose another place") from None
    return [f"{name}.png", f"{name}.svg"]
