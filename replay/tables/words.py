"""The interpretation by straw import, in words and as data."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np

from straw.rig.tables import Plan
from straw.rig.tables.signals import Signal
from straw.rig.tables.understand import Part

#: By topic's quantity: factor and unit for people.
_SHOWN = {"pressure": (1e-3, "kPa"), "length": (1e3, "mm"), "angle": (180 / np.pi, "deg"), "flow": (1e9, "µl/s")}


def shown(signal: Signal) -> tuple[float, str]:
    """Factor and display unit of a signal."""
    from straw.rig.tables.roles import ROLES

    return _SHOWN.get(ROLES[signal.role].quantity, (1.0, ""))


def lines(plan: Plan) -> list[str]:
    """One line a table, one a column, and what was left out."""
    out: list[str] = []
    for part in plan.parts:
        rows = f"{len(part.times.ns)} rows"
        out.append(
            f"{part.table.name}: {part.table.format}, {rows}" + (f", {part.table.about}" if part.table.about else "")
        )
        out.append(_row("time", _time_column(part), part.times.unit, _span(plan, part), part.time_how))
        out += [_row(s.role, s.column, s.unit, _range(s), s.how, s.channel) for s in part.signals]
        if part.said.offset_s:
            out.append(f"  its clock + {part.said.offset_s:g} s is the run's")
        if part.unused:
            names = ", ".join(map(repr, part.unused[:8])) + (", ..." if len(part.unused) > 8 else "")
            out.append(f"  not used: {names}")
        out += [f"  {note}" for note in part.notes]
    said = plan.mapping.metadata
    when = datetime.fromtimestamp(plan.zero_ns // 10**9, UTC).strftime("%Y-%m-%d %H:%M:%S")
    out.append(
        f"run: 0 s is {when}.{plan.zero_ns % 10**9:09d} UTC; specimen {said.get('specimen') or 'not stated'}; "
        f"deployed {said.get('initial_deployed', 'not stated') or 'none'}; cycle {said.get('cycle', 'not stated')}"
    )
    return out


def _time_column(part: Part) -> str:
    use = part.said.uses.get("time", ())
    if use:
        return use[0].column
    if part.said.points and not part.said.rate_hz:
        return part.table.points[part.said.points[1]].time
    return f"{part.said.rate_hz:g} a second"


def _row(role: str, column: str, unit: str, span: str, how: str, channel: int = 1) -> str:
    name = role if channel == 1 else f"{role} {channel}"
    return f"  {name:<14} {column[:28]!r:<30} {unit:<6} {span:<34} {'GUESSED' if how == 'guessed' else how}".rstrip()


def _span(plan: Plan, part: Part) -> str:
    at = (plan.ns(part) - plan.zero_ns) * 1e-9
    steps = np.diff(at)
    rate = f", {1 / np.median(steps):.4g} Hz" if len(steps) and np.median(steps) > 0 else ""
    return f"{at[0]:.4g} to {at[-1]:.6g} s{rate}"


def _range(signal: Signal) -> str:
    if signal.text:
        return f"{sum(a != b for a, b in zip(('', *signal.text), signal.text, strict=False))} changes"
    good = signal.values[np.isfinite(signal.values)]
    if not len(good):
        return "no numbers at all"
    factor, unit = shown(signal)
    missing = len(signal.values) - len(good)
    return f"{good.min() * factor:.4g} to {good.max() * factor:.4g} {unit}".rstrip() + (
        f", {missing} missing" if missing else ""
    )


def data(plan: Plan) -> dict[str, Any]:
    """The same for machines, SI."""
    return {
        "zero_time_ns": str(plan.zero_ns),
        "metadata": dict(plan.mapping.metadata),
        "tables": [
            {
                "file": str(part.table.path),
                "format": part.table.format,
                "rows": len(part.times.ns),
                "time": {"column": _time_column(part), "unit": part.times.unit, "how": part.time_how},
                "columns": [
                    {"role": s.role, "column": s.column, "unit": s.unit, "channel": s.channel, "how": s.how}
                    for s in part.signals
                ],
                "left_alone": list(part.unused),
                "notes": list(part.notes),
            }
            for part in plan.parts
        ],
        "guesses": [{"what": doubt.what, "state": doubt.say} for doubt in plan.doubts],
    }
