"""Unknowns of a user's system as arrays for the kernel: which constant or parameter each one is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.settings import STEP_U
from straw.replay.diagnose.systems.function.codes import STRENGTH
from straw.replay.diagnose.systems.function.laws import Law

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Encoding:
    """Laws as rows, constants ``c`` and parameters ``p`` with all unknowns left out, and the place of each unknown:
    ``of_law`` (k,) whether it is among the parameters, ``slot`` (k,) where."""

    unknowns: tuple[Unknown, ...]
    rows: Indices
    lags: int
    c: Floats
    p: Floats
    of_law: tuple[bool, ...]
    slot: tuple[int, ...]

    def at(self, u: Floats) -> tuple[Floats, Floats]:
        """Constants and parameters with the unknowns at u."""
        c, p = self.c.copy(), self.p.copy()
        for one, x, law, k in zip(self.unknowns, u, self.of_law, self.slot, strict=True):
            (p if law else c)[k] = one.value(float(x))
        return c, p

    def around(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Steps of each unknown within its bounds (k,), zero where it cannot move, and constants (k, constants) and
        parameters (k, parameters) after each."""
        c, p = self.at(u)
        cs, ps, by = np.tile(c, (len(u), 1)), np.tile(p, (len(u), 1)), np.zeros(len(u))
        for j, (one, law, k) in enumerate(zip(self.unknowns, self.of_law, self.slot, strict=True)):
            there = min(u[j] + STEP_U, one.high)
            if there == u[j]:
                there = max(u[j] - STEP_U, one.low)
            by[j] = there - u[j]
            (ps if law else cs)[j, k] = one.value(float(there))
        return by, cs, ps


def encoding(
    laws: Sequence[Law], constants: Sequence[str], c: Floats, fixed: Mapping[str, float], unknowns: Sequence[Unknown]
) -> Encoding:
    """Of laws and ``constants`` by name with values ``c``; ``fixed`` are values by target that are no unknowns."""
    numbered = dict(enumerate(laws))
    rows, p, lags = encoded(numbered, fixed)
    of_law = tuple(one.target.startswith("law.") for one in unknowns)
    own = iter(slots(numbered, [one.target for one, law in zip(unknowns, of_law, strict=True) if law]))
    slot = tuple(
        next(own) if law else list(constants).index(one.target.partition(".")[2])
        for one, law in zip(unknowns, of_law, strict=True)
    )
    return Encoding(tuple(unknowns), rows, lags, c, p, of_law, slot)


def encoded(laws: Mapping[int, Law], values: Mapping[str, float]) -> tuple[Indices, Floats, int]:
    """Rows and parameters of laws by number for the kernel, and their number of lagging states."""
    rows, parts, at, lags = [], [np.zeros(1)], 1, 0
    order = list(laws)
    for number, law in laws.items():
        p = law.parameters(number, values)
        which = order.index(law.place.which) if law.place.kind == STRENGTH else law.place.which
        lag = law.state.remembers
        first = at + int(lag)  # after the time or the width of what it remembers
        rows.append(
            [
                law.place.kind,
                which,
                law.state.kind,
                law.state.which,
                law.shape,
                first,
                len(p) - lag,
                lags if lag else -1,
            ]
        )
        lags += law.memories
        parts.append(p)
        at += len(p)
    return np.array(rows, dtype=np.int64).reshape(len(rows), 8), np.concatenate(parts), lags


def slots(laws: Mapping[int, Law], targets: Sequence[str]) -> list[int]:
    """The place of each law's constant, ``law.NUMBER.CONSTANT``, among the parameters of `encoded`."""
    first, at = {}, 1
    for number, law in laws.items():
        first[number] = at
        at += len(law.parameters(number, {}))
    out = []
    for target in targets:
        _, number_, constant = target.split(".")
        out.append(first[int(number_)] + laws[int(number_)].slot(constant))
    return out
