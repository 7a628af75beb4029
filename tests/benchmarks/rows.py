"""Rows: a long benchmark's results, each one line of JSON written when done, so that it can be interrupted."""

from __future__ import annotations

import json
import traceback
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import as_completed
from functools import partial
from pathlib import Path
from typing import Any

from straw.replay.workers import workers

Row = dict[str, Any]


def kept(path: Path) -> list[Row]:
    """The rows of a file; none where there is no file."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def worked_out(
    todo: Mapping[str, tuple[Any, ...]], work: Callable[..., Row], path: Path, jobs: int, dask: str | None = None
) -> Iterator[Row]:
    """The row of ``work(*todo[name])`` for each name, appended to the file when done. A failure is printed and tried
    again the next time, so that the results of the others are kept."""

    def tried(name: str, call: Callable[[], Row]) -> Row | None:
        try:
            row = call()
        except Exception:
            print(f"{name}: {traceback.format_exc()}", flush=True)
            return None
        out.write(json.dumps(row) + "\n")
        out.flush()
        return row

    with workers(jobs, dask) as pool, path.open("a", encoding="utf-8") as out:
        if pool is None:
            rows = (tried(name, partial(work, *given)) for name, given in todo.items())
        else:
            asked = {pool.submit(work, *given): name for name, given in todo.items()}
            rows = (tried(asked[job], job.result) for job in as_completed(asked))
        yield from (row for row in rows if row is not None)
