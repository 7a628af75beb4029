"""Tables of other loggers: read, understood, written as recordings, and recordings written as tables.

>>> table = read_table("esi.txt")                                          # doctest: +SKIP
>>> mapping = Mapping((TableMap("esi.txt", uses={"pressure": (Use("P1", "mbar"),)}),))  # doctest: +SKIP
>>> import_tables(["esi.txt"], "run.mcap", mapping)                        # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from straw.rig.errors import RigError
from straw.rig.mcap_scan import read_bytes
from straw.rig.tables.choose_format import format_of
from straw.rig.tables.mapping import Mapping, TableMap, Use, load_mapping
from straw.rig.tables.own import rows_of
from straw.rig.tables.own_back import recording_of
from straw.rig.tables.own_files import is_own, read_own, write_csv, write_parquet
from straw.rig.tables.table import Reading, Table
from straw.rig.tables.understand import Plan, understand
from straw.rig.tables.write import Progress, write

__all__ = [
    "Mapping",
    "Plan",
    "Reading",
    "Table",
    "TableMap",
    "Use",
    "export_table",
    "import_own",
    "import_tables",
    "load_mapping",
    "read_table",
    "understand",
    "write",
]


def read_table(path: str | Path, reading: Reading | None = None) -> Table:
    """A table in any known format, by what is in it; RigError in one line for what cannot be read."""
    path = Path(path)
    data = table_bytes(path)
    reading = reading or Reading()
    return format_of(path, data, reading.format).read(path, data, reading)


def table_bytes(path: Path) -> bytes:
    """All bytes of a file; RigError when it cannot be read, or there are none."""
    try:
        data = read_bytes(path)
    except RigError as error:
        raise RigError(str(error).replace("recording", "table", 1)) from None
    if not data.strip():
        raise RigError(f"{path.name}: is empty; export the table again")
    return data


def import_tables(
    paths: Sequence[str | Path],
    output: str | Path,
    mapping: Mapping | None = None,
    *,
    accept_guesses: bool = False,
    progress: Progress | None = None,
) -> Plan:
    """Write tables as one recording; the plan that was followed.

    What ``mapping`` does not state is guessed; with a guess nothing is written, and a RigError says how to state it,
    unless ``accept_guesses``. Entries of ``mapping.tables`` hold for the table of the same ``file``.
    """
    mapping = mapping or Mapping()
    maps = {one.file: one for one in mapping.tables}
    tables = [read_table(path, maps[str(path)].reading if str(path) in maps else None) for path in paths]
    plan = understand(tables, mapping)
    if plan.doubts and not accept_guesses:
        raise RigError(
            f"{tables[0].name}: {len(plan.doubts)} guesses, for example that {plan.doubts[0].what}; "
            "state them in the mapping"
        )
    write(plan, Path(output), progress)
    return plan


def import_own(path: str | Path, output: str | Path, metadata: dict[str, str] | None = None) -> tuple[int, bool]:
    """Write a table that ``export_table`` made as the recording it was: (messages, whether its side file was there)."""
    path = Path(path)
    rows, side = read_own(path, table_bytes(path))
    return recording_of(rows, side, Path(output), path.name, metadata or {}), side is not None


def export_table(
    recording: str | Path, *, csv: Path | None = None, parquet: Path | None = None, topics: Sequence[str] = ()
) -> tuple[int, int]:
    """Write a recording as a table: (rows, messages that only the side file holds)."""
    rows = rows_of(Path(recording), topics)
    if csv:
        write_csv(rows, csv)
    if parquet:
        write_parquet(rows, parquet)
    return len(rows.rows), len(rows.side.others)


def is_own_table(path: Path) -> bool:
    """Whether ``export_table`` made this file."""
    return is_own(path, table_bytes(path))
