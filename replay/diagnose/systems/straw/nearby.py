"""A straw at a point of the search and about it, worked out once for all runs: how its constants change with each
unknown."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from straw.model.direction import Direction
from straw.model.parameters import StrawParameters
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.settings import SECANT
from straw.replay.diagnose.systems.straw.constants import applied
from straw.replay.diagnose.systems.straw.instrument import Instrument

Floats = NDArray[np.float64]

#: Points that are remembered: workers are busy with a few at a time.
REMEMBERED = 8


@dataclass(frozen=True, eq=False)
class Beside:
    """Instruments a little below and above in one unknown, their distance in u, and the direction in which the straw's
    constants change, None where they do not."""

    below: Instrument
    above: Instrument
    step: float
    direction: Direction | None


@dataclass(frozen=True, eq=False)
class _Same:
    """A straw as the key of a cache: itself, not one that equals it, which takes longer to compare."""

    straw: StrawParameters

    def __hash__(self) -> int:
        return id(self.straw)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.straw is self.straw


_ONE_AT_A_TIME = threading.Lock()


def at_point(straw: StrawParameters, unknowns: Sequence[Unknown], at: Floats) -> tuple[StrawParameters, Instrument]:
    """`applied` at u = ``at`` (unknowns,), and its errors."""
    with _ONE_AT_A_TIME:  # another worker asks for the same point of another run
        return _at_point(_Same(straw), tuple(unknowns), tuple(at.tolist()))


def nearby(straw: StrawParameters, unknowns: Sequence[Unknown], at: Floats) -> tuple[Beside, ...]:
    """On both sides of u = ``at`` (unknowns,) in each unknown; errors as `at_point`."""
    with _ONE_AT_A_TIME:
        return _nearby(_Same(straw), tuple(unknowns), tuple(at.tolist()))


@lru_cache(maxsize=REMEMBERED)
def _at_point(same: _Same, unknowns: tuple[Unknown, ...], at: tuple[float, ...]) -> tuple[StrawParameters, Instrument]:
    return applied(same.straw, unknowns, np.array(at))


@lru_cache(maxsize=REMEMBERED)
def _nearby(same: _Same, unknowns: tuple[Unknown, ...], at: tuple[float, ...]) -> tuple[Beside, ...]:
    return tuple(_beside(same.straw, unknowns, np.array(at), k) for k in range(len(unknowns)))


def _beside(straw: StrawParameters, unknowns: Sequence[Unknown], at: Floats, k: int) -> Beside:
    """Within the unknown's bounds."""
    low, high = at.copy(), at.copy()
    low[k], high[k] = max(at[k] - SECANT, unknowns[k].low), min(at[k] + SECANT, unknowns[k].high)
    (minus, below), (plus, above) = applied(straw, unknowns, low), applied(straw, unknowns, high)
    step, moves = float(high[k] - low[k]), unknowns[k].target.startswith(("straw.", "term."))
    return Beside(below, above, step, Direction.between(minus, plus, step) if moves else None)
