"""Two threads for chunks of work: NumPy and compiled code leave the interpreter free while they compute."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

S = TypeVar("S")
T = TypeVar("T")

_THREADS = 2  # more would mostly wait for the interpreter


def side_by_side(work: Callable[[S], T], items: Iterable[S]) -> Iterator[T]:
    """Yield ``work(item)`` for each item, in their order; at most three are under way or waiting to be taken."""
    with ThreadPoolExecutor(_THREADS, "chunk") as pool:
        waiting: deque[Future[T]] = deque()
        for item in items:
            waiting.append(pool.submit(work, item))
            if len(waiting) > _THREADS:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
