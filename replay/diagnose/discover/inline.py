"""An executor that does at once what it is given: a trial is one job of a pool, and hands out no jobs of its own."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any


class Inline(Executor):
    """Works in the thread that asks; an exception is handed on as by any executor."""

    def submit(self, work: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Do the work."""
        done: Future[Any] = Future()
        try:
            done.set_result(work(*args, **kwargs))
        except Exception as problem:
            done.set_exception(problem)
        return done


def never() -> bool:
    """Nobody asks a job to stop."""
    return False
