"""The picture of a plan: what would be written, one panel for each quantity, and the guesses in words."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from straw.replay.output import write_picture
from straw.replay.tables.words import shown
from straw.rig.tables import Plan
from straw.rig.tables.signals import Signal
from straw.rig.tables.understand import Part

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PANELS = (
    ("pressure", ("command", "pressure")),
    ("tip X", ("x",)),
    ("tip Z", ("z",)),
    ("tip Phi", ("phi",)),
    ("flow", ("flow",)),
)
_COLOURS = {
    "command": "#8a8a8a",
    "pressure": "#1f5fa8",
    "x": "#1f5fa8",
    "z": "#2c8a57",
    "phi": "#b0472f",
    "flow": "#6a4c93",
}
DRAWN = 4000  # points of a curve that can be distinguished on the picture


def draw(plan: Plan, path: Path) -> None:
    """Write the picture; ReplayError where it cannot be."""
    write_picture(figure(plan), path, 110, "--picture")


def figure(plan: Plan) -> Figure:
    """The picture."""
    from matplotlib.figure import Figure  # slow to import

    panels = [(title, found) for title, roles in _PANELS if (found := _of(plan, roles))]
    events = [(part, signal) for part in plan.parts for signal in part.signals if signal.role == "event"]
    made = Figure(figsize=(10, 1.1 + 1.9 * max(1, len(panels)) + 0.22 * len(plan.doubts)), layout="constrained")
    axes = made.subplots(max(1, len(panels)), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (title, found) in zip(axes, panels, strict=False):
        _, unit = shown(found[0][1])
        for part, signal in found:
            _line(plan, ax, part, signal)
        ax.set_ylabel(f"{title} / {unit}")
        ax.grid(alpha=0.25)
        ax.legend(loc="upper right", fontsize=8, frameon=False)
    for part, signal in events:
        at = (plan.ns(part) - plan.zero_ns) * 1e-9
        before = ""
        for k, text in enumerate(signal.text):
            if text and text != before:
                for ax in axes:
                    ax.axvline(at[k], color="#8a8a8a", lw=0.6, ls=":")
            before = text
    axes[-1].set_xlabel("time from the run's 0 / s")
    guessed = "\n".join(f"guessed: {doubt.what}" for doubt in plan.doubts)
    made.suptitle(" + ".join(part.table.name for part in plan.parts) + (f"\n{guessed}" if guessed else ""), fontsize=9)
    return made


def _of(plan: Plan, roles: tuple[str, ...]) -> list[tuple[Part, Signal]]:
    return [(part, signal) for role in roles for part in plan.parts for signal in part.signals if signal.role == role]


def _line(plan: Plan, ax: object, part: Part, signal: Signal) -> None:
    factor, _ = shown(signal)
    at = (plan.ns(part) - plan.zero_ns) * 1e-9
    values = signal.values * factor
    if len(at) > 2 * DRAWN:  # the lowest and highest value of each interval draw the same curve
        edges = np.linspace(0, len(at), DRAWN, endpoint=False).astype(np.int64)
        low, high = np.fmin.reduceat(values, edges), np.fmax.reduceat(values, edges)
        at, values = np.repeat(at[edges], 2), np.stack([low, high], axis=1).ravel()
    unit = f" [{signal.unit}]" if signal.unit and f"[{signal.unit}]" not in signal.column else ""
    said = signal.column + unit + (" (guessed)" if signal.how == "guessed" else "")
    label = said if signal.role not in ("command",) else f"command: {said}"
    style = "steps-post" if signal.role == "command" else "default"
    few = "." if len(at) < 60 else ""
    colour = _COLOURS[signal.role] if signal.channel == 1 else None
    ax.plot(at, values, lw=1.1, color=colour, drawstyle=style, marker=few, label=label)  # type: ignore[attr-defined]
