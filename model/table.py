"""A law as a table: eight points and straight lines between them, for a force without a known formula."""

from __future__ import annotations

from collections.abc import Sequence

from straw.model.compiled import allocates_nothing
from straw.model.term import Constant, Floats

#: A table is 2 POINTS constants of a term side by side: where its points lie, then the values there.
POINTS = 8
#: First constant of a term made of tables; without it they need not be looked at.
AMOUNT = Constant("amount", "1", 0.0, 0.1, 10.0, "factor on all of this term's tables; 0: none acts")


def points(at: str, over: Sequence[float], value: str, unit: str, low: float, high: float) -> tuple[Constant, ...]:
    """Constants of a table: where its points lie, ``over`` by default, and the values there.

    ``at`` and ``value`` are names such as ``speed_{}_m_per_s`` whose braces take the point's number.
    """
    wide = 10 * max(abs(x) for x in over)
    least = -wide if over[0] < 0 else 0.0
    where = [Constant(at.format(n), "SI", x, least, wide, f"point {n} lies there") for n, x in enumerate(over, 1)]
    values = [Constant(value.format(n), unit, 0.0, low, high, f"value at point {n}") for n in range(1, POINTS + 1)]
    return (*where, *values)


def names(pattern: str) -> tuple[str, ...]:
    """The eight names of a pattern such as ``force_{}_n``."""
    return tuple(pattern.format(n) for n in range(1, POINTS + 1))


@allocates_nothing
def empty(k: Floats, at: int) -> bool:
    """Whether the table at k[at] is zero throughout."""
    for n in range(at + POINTS, at + 2 * POINTS):  # noqa: SIM110  (numba knows no generators)
        if k[n] != 0:
            return False
    return True


@allocates_nothing
def table(x: float, k: Floats, at: int) -> float:
    """Value at x of the table at k[at]; beyond its ends the last one stays."""
    last = at + POINTS - 1
    if x <= k[at]:
        return float(k[at + POINTS])
    for n in range(at, last):
        if x < k[n + 1]:
            value, then = k[n + POINTS], k[n + 1 + POINTS]
            return float(value + (then - value) * (x - k[n]) / (k[n + 1] - k[n]))
    return float(k[last + POINTS])


@allocates_nothing
def table_moved(x: float, k: Floats, at: int, by: Floats) -> float:
    """Derivative of the table's value at x where its points and values move as ``by`` at the same places."""
    last = at + POINTS - 1
    if x <= k[at]:
        return float(by[at + POINTS])
    for n in range(at, last):
        if x < k[n + 1]:
            wide = k[n + 1] - k[n]
            share, slope = (x - k[n]) / wide, (k[n + 1 + POINTS] - k[n + POINTS]) / wide
            before, after = by[n + POINTS] - slope * by[n], by[n + 1 + POINTS] - slope * by[n + 1]
            return float(before * (1 - share) + after * share)
    return float(by[last + POINTS])


@allocates_nothing
def table_area(x: float, k: Floats, at: int) -> float:
    """Integral of the table from its first point to x."""
    last, total = at + POINTS - 1, 0.0
    if x <= k[at]:
        return float(k[at + POINTS] * (x - k[at]))
    for n in range(at, last):
        if x < k[n + 1]:
            return float(total + (k[n + POINTS] + table(x, k, at)) / 2 * (x - k[n]))
        total += (k[n + POINTS] + k[n + 1 + POINTS]) / 2 * (k[n + 1] - k[n])
    return float(total + k[last + POINTS] * (x - k[last]))


@allocates_nothing
def odd_table(x: float, k: Floats, at: int) -> float:
    """Value at x of a table over |x| that goes through zero and changes sign with x; its last slope goes on."""
    size, last = abs(x), at + POINTS - 1
    if size <= k[at]:
        return float(k[at + POINTS] * x / k[at])
    n = at
    while n < last - 1 and size >= k[n + 1]:
        n += 1
    value, then = k[n + POINTS], k[n + 1 + POINTS]
    value += (then - value) * (size - k[n]) / (k[n + 1] - k[n])
    return float(value if x > 0 else -value)
