"""The requests of a script to its guardian, in order, and whether one of them must not wait."""

from __future__ import annotations

import queue
from collections import deque
from typing import Any, TypeAlias

Request: TypeAlias = "tuple[int, tuple[str, tuple[Any, ...]]] | str"  # as text: why it is no longer served


class Requests:
    """The script's requests, in order; ``urgent`` tells whether a vent or the end is among them."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[Request] = queue.SimpleQueue()
        self._urgent: deque[None] = deque()  # its append is atomic, also within a signal handler

    def put(self, request: Request) -> None:
        """Queue one."""
        if _is_urgent(request):
            self._urgent.append(None)
        self._queue.put(request)

    def get(self, timeout_s: float | None) -> Request:
        """The next one; queue.Empty where none comes in time."""
        request = self._queue.get(timeout=timeout_s)
        if _is_urgent(request):
            self._urgent.popleft()
        return request

    @property
    def urgent(self) -> bool:
        """Whether a request is queued that must not wait for an instrument's answer."""
        return bool(self._urgent)


def _is_urgent(request: Request) -> bool:
    return isinstance(request, str) or request[1][0] in ("vent", "close")
