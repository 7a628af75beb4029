"""Tables of other loggers from Python: `straw import` and `straw export` as functions."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from straw.replay.api.given import Named
from straw.replay.api.recordings import Recording, read_recording
from straw.replay.api.shown import Rows, Shown
from straw.replay.errors import ReplayError
from straw.replay.output import check_new
from straw.replay.tables.flags import place
from straw.replay.tables.options import COLUMNS
from straw.replay.tables.picture import figure
from straw.replay.tables.words import lines
from straw.rig.tables import export_table as table_of
from straw.rig.tables import read_table, understand, write
from straw.rig.tables.mapping import Mapping as TablesMap
from straw.rig.tables.mapping import TableMap, load_mapping, to_toml
from straw.rig.tables.understand import Plan

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Import(Shown):
    """The interpretation of tables. ``guesses``: what was not stated; ``recording``: what was written, None without an
    output; ``mapping`` (TOML): the interpretation, stated. `to_dataframe` gives a row for each column used."""

    plan: Plan
    recording: Recording | None

    @property
    def guesses(self) -> tuple[str, ...]:
        """Each guess, with the flag of `straw import` that states it."""
        return tuple(f"{doubt.what}; to state it: {doubt.say}" for doubt in self.plan.doubts)

    @property
    def mapping(self) -> str:
        """Write the interpretation as a mapping file, for ``mapping`` and `straw import --map`."""
        return to_toml(self.plan.mapping)

    def __str__(self) -> str:
        return "\n".join([*lines(self.plan), *(f"guessed: {guess}" for guess in self.guesses)])

    def _says(self) -> str:
        tables = ", ".join(part.table.name for part in self.plan.parts)
        done = f"written to {self.recording.path}" if self.recording else "looked at, not written"
        count = len(self.guesses)
        return f"{tables}: {done}; {count or 'no'} {'guess' if count == 1 else 'guesses'}"

    def _columns(self) -> Rows:
        rows = [(part.table.name, signal) for part in self.plan.parts for signal in part.signals]
        return {
            "table": np.array([name for name, _ in rows], dtype=str),
            "role": np.array([signal.role for _, signal in rows], dtype=str),
            "column": np.array([signal.column for _, signal in rows], dtype=str),
            "unit": np.array([signal.unit for _, signal in rows], dtype=str),
            "found": np.array([signal.how for _, signal in rows], dtype=str),
        }

    def _tables(self) -> list[tuple[str, Rows]]:
        guessed = {"guess": np.array(self.guesses, dtype=str)}
        return [("", self._columns()), *([("Guesses, to be confirmed", guessed)] if self.guesses else [])]

    def _figure(self) -> Figure:
        return figure(self.plan)


def import_tables(
    tables: Named | Sequence[Named],
    output: Named | None = None,
    *,
    columns: Mapping[str, str | Sequence[str]] | None = None,
    mapping: TablesMap | Named | None = None,
    reader: Named | None = None,
    rate_hz: float | None = None,
    start: str = "",
    time_zone: str = "",
    initial_deployed: Iterable[int] | None = None,
    specimen: str = "",
    cycle: int | None = None,
    metadata: Mapping[str, str] | None = None,
    accept_guesses: bool = False,
    as_stated: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Import:
    """Make one recording of tables of other loggers, as `straw import` does; without ``output``, only interpret them.

    ``columns``: by role ("time", "pressure", "command", "flow", "x", "z", "phi", ...) a column's heading or number
    from 1, with its unit where the heading has none ("P1 in mbar"), with its table where several have it
    ("tip.csv:Time in s"), "none" to leave it out. ``mapping``: a mapping file, or its contents, for all else.
    ``reader``: a file with a `Reader`. ``rate_hz``: samples a second of a table without a time. ``start``,
    ``time_zone``: when time 0 was. What is not stated is guessed; with a guess nothing is written, and a ReplayError
    says how to state it, unless ``accept_guesses``. ``as_stated``: accept units although magnitudes look wrong. Raises
    RigError or ReplayError, one line.
    """
    paths = [Path(one) for one in ([tables] if isinstance(tables, str | Path) else tables)]
    if not paths:
        raise ReplayError("import_tables: no table is given; give one, or a list of them")
    if output is not None:
        check_new(Path(output))
    said = mapping if isinstance(mapping, TablesMap) else load_mapping(Path(mapping)) if mapping else TablesMap()
    maps = [_entry(path, paths, said) for path in paths]
    if reader is not None:
        maps = [dataclasses.replace(one, reading=dataclasses.replace(one.reading, format=str(reader))) for one in maps]
    if rate_hz is not None:
        if not rate_hz > 0:
            raise ReplayError(f"import_tables: rate_hz is {rate_hz:g}; give samples a second, above 0")
        maps = [dataclasses.replace(one, rate_hz=rate_hz) for one in maps]
    read = [read_table(path, one.reading) for path, one in zip(paths, maps, strict=True)]
    for role, names in (columns or {}).items():
        if role not in COLUMNS:
            raise ReplayError(f"import_tables: columns: no role {role!r}; known: {', '.join(COLUMNS)}")
        for name in [names] if isinstance(names, str) else names:
            maps = place(role, name, read, maps)
    about = dict(said.metadata) | dict(metadata or {})
    about |= {"specimen": specimen} if specimen else {}
    about |= {"cycle": str(cycle)} if cycle is not None else {}
    if initial_deployed is not None:
        about["initial_deployed"] = ",".join(str(cell) for cell in initial_deployed)
    believed = as_stated or said.as_stated
    plan = understand(read, TablesMap(tuple(maps), start or said.start, time_zone or said.time_zone, about, believed))
    if output is None:
        return Import(plan, None)
    if plan.doubts and not accept_guesses:
        first = plan.doubts[0]
        raise ReplayError(
            f"{read[0].name}: {len(plan.doubts)} guesses, for example that {first.what} (to state it: {first.say}); "
            "call import_tables without an output to see them, state them, or give accept_guesses=True"
        )
    write(plan, Path(output), progress)
    return Import(plan, read_recording(output))


def _entry(path: Path, paths: Sequence[Path], said: TablesMap) -> TableMap:
    for one in said.tables:
        if one.file in (str(path), path.name) or (not one.file and len(paths) == len(said.tables) == 1):
            return dataclasses.replace(one, file=str(path))
    return TableMap(str(path))


def export_table(
    recording: Recording | Named, *, csv: Named | None = None, parquet: Named | None = None, topics: Sequence[str] = ()
) -> int:
    """Write a recording as a table, as `straw export` does, and return its number of rows. `straw import` restores it
    exactly; `import_tables` is for other tables. Raises RigError or ReplayError."""
    if csv is None and parquet is None:
        raise ReplayError("export_table: no output; give csv=, parquet=, or both")
    for path in (csv, parquet):
        if path is not None:
            check_new(Path(path))
    source = recording.path if isinstance(recording, Recording) else recording
    kept: dict[str, Any] = {"csv": Path(csv) if csv else None, "parquet": Path(parquet) if parquet else None}
    return table_of(source, topics=topics, **kept)[0]
