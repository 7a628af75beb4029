"""From tables and a mapping to a plan: which column becomes what, what was guessed, what is left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from straw.rig.errors import RigError
from straw.rig.tables.mapping import Mapping, TableMap, Use
from straw.rig.tables.moments import moments, zone_of
from straw.rig.tables.roles import ROLES, SIGNALS, TIP, guess
from straw.rig.tables.signals import Signal, check_tip, from_points, signal_of
from straw.rig.tables.table import Doubt, Table
from straw.rig.tables.times import Times, times


@dataclass(frozen=True, eq=False)
class Part:
    """The result of one table: its times (since 1970 once in a plan), its signals, and what was decided."""

    table: Table
    said: TableMap
    times: Times
    signals: tuple[Signal, ...]
    time_how: str
    doubts: tuple[Doubt, ...]
    notes: tuple[str, ...]
    unused: tuple[str, ...]

    def signal(self, role: str) -> Signal | None:
        """The first signal of a role."""
        return next((one for one in self.signals if one.role == role), None)


@dataclass(frozen=True, eq=False)
class Plan:
    """A run as it would be written. ``doubts`` is all that was guessed; an import with any must be confirmed."""

    parts: tuple[Part, ...]
    zero_ns: int
    mapping: Mapping
    doubts: tuple[Doubt, ...]

    def ns(self, part: Part) -> NDArray[np.int64]:
        """When the rows of a part happened, ns since 1970."""
        offset = round((part.said.offset_s or 0.0) * 1e9)
        return part.times.ns + offset + (0 if part.times.absolute else self.zero_ns)


def understand(tables: Sequence[Table], mapping: Mapping) -> Plan:
    """The plan for tables, one entry of ``mapping.tables`` for each; RigError in one line for what cannot be."""
    zone = zone_of(mapping.time_zone) if mapping.time_zone else None
    maps = {one.file: one for one in mapping.tables}
    parts = tuple(_part(table, maps.get(str(table.path), TableMap(str(table.path))), mapping) for table in tables)
    if not any(part.signals for part in parts):
        empty = [n for n, c in tables[0].columns.items() if c.whole is None and not np.any(np.isfinite(c.values))]
        nothing = f" ({', '.join(map(repr, empty[:3]))} without a number)" if empty else ""
        raise RigError(
            f"{tables[0].name}: no column to import is named; give --pressure, --command or --x --z --phi, of its "
            f"columns {tables[0].names()}{nothing}"
        )
    doubts = [doubt for part in parts for doubt in part.doubts]
    absolute = [part for part in parts if part.times.absolute]
    if mapping.start:
        told = moments([mapping.start.strip()], zone, None, "--start")
        if not told.absolute:
            raise RigError(f"--start {mapping.start!r}: expected date and time, as 2026-05-03 14:02:11")
        zero_ns = told.ns[0]
        if told.no_zone:
            doubts.append(Doubt("--start is taken as UTC", "--time-zone UTC (or Europe/Berlin, +02:00)"))
    elif absolute:
        zero_ns = min(int(part.times.ns[0]) + round((part.said.offset_s or 0.0) * 1e9) for part in absolute)
    else:
        zero_ns = _changed_ns(parts)
        when = datetime.fromtimestamp(zero_ns * 1e-9, UTC).strftime("%Y-%m-%d %H:%M:%S")
        doubts.append(Doubt(f"time 0 was {when} UTC, by when the file was last changed", f'--start "{when}Z"'))
    relative = [part for part in parts if not part.times.absolute]
    loose = [part for part in relative if part.said.offset_s is None]
    if len(relative) > 1 or (relative and absolute):
        for part in loose[0 if absolute else 1 :]:
            doubts.append(Doubt(f"0 of {part.table.name}'s clock is the run's 0", f"--offset {part.table.name}:0"))
    return Plan(parts, zero_ns, replace(mapping, tables=tuple(part.said for part in parts)), tuple(doubts))


def _changed_ns(parts: Sequence[Part]) -> int:
    """When the first file began, if it was closed as its last row was written, in whole seconds."""
    first = parts[0]
    try:
        changed_s = first.table.path.stat().st_mtime
    except OSError:
        changed_s = 0.0
    return max(1, int(changed_s - float(first.times.ns[-1]) * 1e-9)) * 10**9


def _part(table: Table, said: TableMap, mapping: Mapping) -> Part:
    uses, how = _uses(table, said)
    if not said.points and not uses.get("time") and not said.rate_hz:
        if "frame" in uses:
            raise RigError(f"{table.name}: it counts frames, not time; give --rate, the frames a second (as 240)")
        raise RigError(f"{table.name}: no column looks like time; give --time COLUMN of {table.names()}, or --rate HZ")
    time_use = uses.get("time", (None,))[0] if uses.get("time") else None
    if time_use is None and not said.rate_hz:
        if said.points and (point := table.points.get(said.points[1])) and point.time:
            time_use = Use(point.time)
        else:
            raise RigError(f"{table.name}: it has no time; give --time COLUMN, or --rate, the frames a second (as 240)")
    zone = zone_of(mapping.time_zone) if mapping.time_zone else None
    clock = times(table, time_use, said, zone)
    if time_use is None and "frame" in uses:
        frames = table.column(uses["frame"][0].column).values
        if not np.all(np.isfinite(frames)):
            raise RigError(
                f"{table.name}: {table.where(int(np.argmin(np.isfinite(frames))))} has no frame; cut the row"
            )
        clock = replace(clock, ns=np.round(frames * (1e9 / (said.rate_hz or 1.0))).astype(np.int64))
    doubts = [*table.doubts, *clock.doubts]
    notes = [*table.notes, *clock.notes]
    if time_use and how["time"] == "guessed":
        doubts.insert(0, Doubt(f"{time_use.column!r} is the time", f'--time "{time_use.column}"'))
    signals: list[Signal] = []
    for role, of_role in uses.items():
        if role == "time":
            continue
        for use in of_role:
            signal, doubt = signal_of(table, role, use, said, clock, how[role], mapping.as_stated)
            signals.append(signal)
            if how[role] == "guessed":
                doubts.append(
                    Doubt(f"{signal.column!r} is {ROLES[role].about}", f'--{role.replace("_", "-")} "{use.column}"')
                )
            if doubt:
                doubts.append(doubt)
    if said.points:
        signals += from_points(table, said, clock)
        notes.append(f"tip {said.points[1]!r}, its axis from {said.points[0]!r} to it")
    check_tip(table, signals)
    used = {signal.column for signal in signals} | ({table.column(time_use.column).name} if time_use else set())
    unused = tuple(name for name in table.columns if name not in used)
    resolved = {
        role: tuple(replace(use, column=table.column(use.column).name) for use in of) for role, of in uses.items()
    }
    said = replace(said, file=str(table.path), uses={**resolved, **{r: () for r, u in said.uses.items() if not u}})
    time_how = how.get("time", "by --rate")
    return Part(table, said, clock, tuple(signals), time_how, tuple(doubts), tuple(notes), unused)


def _uses(table: Table, said: TableMap) -> tuple[dict[str, tuple[Use, ...]], dict[str, str]]:
    """Columns by role: stated, else the format's, else guessed; and how each was found."""
    uses = {role: of for role, of in said.uses.items() if of}
    how = dict.fromkeys(uses, "stated")
    left_out = {role for role, of in said.uses.items() if not of}
    stated_signal = any(role in SIGNALS for role in uses) or said.points is not None
    for name, role in table.roles.items():
        if role in uses or role in left_out or (said.points and role in (*TIP, "likelihood")):
            continue
        if stated_signal and role in SIGNALS and not ({role} | set(uses)) <= set(TIP) | {"time"}:
            continue  # naming one signal of a role excludes the others
        uses[role], how[role] = (Use(name),), table.format
    taken = {table.column(use.column).name for of in uses.values() for use in of}
    wanted = [role for role in ROLES if role not in uses and role not in left_out]
    if said.rate_hz and "time" in wanted:
        wanted.remove("time")
    if stated_signal:
        wanted = [role for role in wanted if role == "time"]
    elif any(role in SIGNALS for role in table.roles.values()):
        wanted = [role for role in wanted if role in ("time", *TIP)]
    for role, name in guess(table, tuple(wanted), taken).items():
        uses[role], how[role] = (Use(name),), "guessed"
    if said.rate_hz and "time" not in said.uses:
        uses.pop("time", None)
    if set(TIP) & set(uses) and not set(TIP) <= set(uses) and all(how[r] == "guessed" for r in TIP if r in uses):
        for role in (*TIP, "sigma_x", "sigma_z", "sigma_phi", "valid", "likelihood"):  # x alone is no tip
            if how.get(role) == "guessed" and set(uses) - set(TIP) & {"pressure", "command"}:
                uses.pop(role, None)
    order = [role for role in ROLES if role in uses]
    return {role: uses[role] for role in order}, how
