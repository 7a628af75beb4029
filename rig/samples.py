"""Samples: what one topic of a recording says over time, in typed columns instead of objects for each message."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

#: Type codes of columns; other kinds (words) are lists.
_CODES = {"double": "d", "int32": "q", "int64": "q", "bool": "b"}
Sample: TypeAlias = tuple[int, tuple[Any, ...]]  # happened ns, values by field
Columns: TypeAlias = dict[str, NDArray[Any]]


class Samples:
    """Times and values in the order of the file.

    With ``every_ns`` a pressure is thinned: of each channel's samples in each interval the first, the lowest and the
    highest are kept, so that no peak is lost; of a tip the first.
    """

    def __init__(self, fields: Iterable[tuple[str, str]], every_ns: int = 0) -> None:
        names, kinds = zip(*fields, strict=True)
        self.names: tuple[str, ...] = names
        self._time_ns = array("q")
        self._columns: list[Any] = [array(_CODES[kind]) if kind in _CODES else [] for kind in kinds]
        self.sample_bytes = 8 + sum(array(_CODES.get(kind, "q")).itemsize for kind in kinds)
        self._every_ns = every_ns if all(kind in _CODES for kind in kinds) else 0  # events are never thinned
        self._value, self._channel = (names.index(n) if n in names else None for n in ("pressure_pa", "channel"))
        self._kept: dict[Any, tuple[int, list[Sample]]] = {}  # by channel: interval, and what is kept of it so far

    def __len__(self) -> int:
        return len(self._time_ns)

    def add(self, happened_ns: int, values: tuple[Any, ...]) -> None:
        """Add one sample, its values of the fields' kinds."""
        if self._every_ns:
            self._thin(happened_ns, values)
        else:
            self._add(happened_ns, values)

    def end(self) -> None:
        """Add what is kept of the last intervals."""
        for _, kept in self._kept.values():
            self._flush(kept)
        self._kept.clear()

    def time_ns(self) -> NDArray[np.int64]:
        """When they happened (n,)."""
        return np.frombuffer(self._time_ns, dtype=np.int64)

    def rows(self) -> list[Sample]:
        """All samples as rows, in order of time."""
        return sorted(zip(self._time_ns, zip(*self._columns, strict=True), strict=True))

    def taken(self) -> tuple[NDArray[np.int64], Columns]:
        """Times and columns by name, each (n,), without copies; the samples are empty then."""
        time_ns = self.time_ns()
        columns = {
            name: np.frombuffer(column, dtype=column.typecode) if isinstance(column, array) else np.array(column)
            for name, column in zip(self.names, self._columns, strict=True)
        }
        self._time_ns, self._columns = array("q"), []
        return time_ns, columns

    def _add(self, happened_ns: int, values: tuple[Any, ...]) -> None:
        self._time_ns.append(happened_ns)
        for column, value in zip(self._columns, values, strict=True):
            column.append(value)

    def _thin(self, happened_ns: int, values: tuple[Any, ...]) -> None:
        channel = None if self._channel is None else values[self._channel]
        interval, sample = happened_ns // self._every_ns, (happened_ns, values)
        last, kept = self._kept.get(channel, (None, []))
        if interval != last:
            self._flush(kept)
            self._kept[channel] = interval, [sample]
        elif (at := self._value) is not None and math.isfinite(values[at]):
            ordered = sorted((*kept[1:], sample), key=lambda one: float(one[1][at]))
            kept[1:] = [ordered[0], ordered[-1]]

    def _flush(self, kept: list[Sample]) -> None:
        for happened_ns, values in sorted({one[0]: one for one in kept}.values(), key=lambda one: one[0]):
            self._add(happened_ns, values)
