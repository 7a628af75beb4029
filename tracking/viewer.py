"""Views of a record's chunks for the solver: computed once while decoding, again only around rejected frames."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from straw.tracking.lens import Lens
from straw.tracking.record import Record, Rows
from straw.tracking.side_by_side import side_by_side
from straw.tracking.views import AROUND, Views, joined, views_of

Flags = NDArray[np.bool_]
Viewed = tuple[Views, NDArray[np.intp]]  # of a chunk, and in which of its rows
Viewer = Callable[[int, Rows], Viewed]

KEPT = 16  # chunks, of 3 MB each


def viewer(record: Record, lens: Lens, believed: Flags, gathered: dict[int, Viewed]) -> Viewer:
    """Return a function from a chunk to its views; the first chunks are kept in memory until asked for again.

    ``gathered``: views of chunks, all frames believed; only what lies around the others is computed again.
    """
    kept: dict[int, Viewed] = {}

    def viewed(start: int, rows: Rows) -> Viewed:
        found = kept.pop(start, None)
        if found is None:
            before = gathered.pop(start, None)
            touched = _around(np.flatnonzero(~believed) - start, len(rows))
            if before is None:
                found = views_of(record, lens, start, rows, believed)
            elif touched.any():
                found = _again(record, lens, start, rows, believed, before, touched)
            else:
                found = before
            if len(kept) < KEPT:
                kept[start] = found
        return found

    return viewed


def _around(frames: NDArray[np.intp], count: int) -> Flags:
    """Return which of ``count`` frames lie around some that may be among them."""
    touched = np.zeros(count, np.bool_)
    for k in frames[(frames >= -AROUND) & (frames < count + AROUND)]:
        touched[max(k - AROUND, 0) : k + AROUND + 1] = True
    return touched


def _again(
    record: Record,
    lens: Lens,
    start: int,
    rows: Rows,
    believed: Flags,
    before: Viewed,
    touched: Flags,
) -> Viewed:
    """Return views of a chunk, those of the frames that are ``touched`` computed again."""
    views, where = before
    ends = np.flatnonzero(np.diff(touched.astype(np.int8))) + 1
    parts = []
    for first, last in itertools.pairwise((0, *ends.tolist(), len(rows))):
        if touched[first]:
            new, at = views_of(record, lens, start + first, rows[first:last], believed)
            parts.append((new, first + at))
        else:
            same = np.flatnonzero((where >= first) & (where < last))
            parts.append((views.pick(same), where[same]))
    return joined([part for part, _ in parts]), np.concatenate([at for _, at in parts])


def pick(record: Record, viewed: Viewer, frames: NDArray[np.int64]) -> Views:
    """Return the views of some frames of the record."""

    def picked(chunk: tuple[int, Rows]) -> Views:
        start, rows = chunk
        views, where = viewed(start, rows)
        return views.pick(np.flatnonzero(np.isin(start + where, frames)))

    wanted = (chunk for chunk in record.chunks() if np.any((frames >= chunk[0]) & (frames < chunk[0] + len(chunk[1]))))
    parts = list(side_by_side(picked, wanted))
    return joined(parts)
