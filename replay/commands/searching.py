"""What a search of straw diagnose runs with: workers, a bar of its stages, and Ctrl-C, which ends it early."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from straw.replay.diagnose.inquiry import Told
from straw.replay.progress import stage_bar
from straw.replay.workers import threads
from straw.rig.interrupts import Interrupts


@contextmanager
def searching(args: argparse.Namespace) -> Iterator[tuple[Executor, Told, Callable[[], bool]]]:
    """The executor, where progress is reported, and whether the user wants the search to stop."""
    with threads(args.jobs, args.dask) as pool, stage_bar("diagnose") as told, Interrupts() as interrupts:
        yield pool, told, lambda: interrupts.pending is not None
