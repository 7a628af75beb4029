"""Progress on stderr for anything slow: a bar where a person watches, nothing where a log is kept."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NoReturn

from tqdm import tqdm

from straw.model.compiled import COMPILED_BEFORE

Progress = Callable[[int, int], None]


@contextmanager
def progress_bar(title: str, unit: str = "it") -> Iterator[Progress]:
    """A bar to be called with (done, total); it closes with the block, also on an error."""
    with _bar(title, unit) as bar:

        def update(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield update


@contextmanager
def stage_bar(title: str) -> Iterator[Callable[[str, int, int], None]]:
    """A bar to be called with (what is being done, stages done, stages in all)."""
    with _bar(title, "stage", "{n_fmt} of {total_fmt} stages, {elapsed}: {desc}") as bar:

        def update(what: str, done: int, total: int) -> None:
            bar.total = total
            bar.set_description_str(what, refresh=False)
            bar.update(done - bar.n)
            bar.refresh()

        yield update


@contextmanager
def _bar(title: str, unit: str, form: str | None = None) -> Iterator[tqdm[NoReturn]]:
    room = shutil.get_terminal_size()  # tqdm draws nothing on a terminal that does not tell its size
    with tqdm(
        desc=title,
        unit=f" {unit}",
        disable=not sys.stderr.isatty(),
        smoothing=0.1,
        ncols=room.columns if form else min(room.columns, 100),
        nrows=room.lines,
        bar_format=form,
    ) as bar:
        yield bar


def say(text: str) -> None:
    """One line of narration on stderr; stdout is for results."""
    print(text, file=sys.stderr, flush=True)


def prepare(*, derivatives: bool = False) -> None:
    """Tell a person who waits that the model is about to be compiled; nothing where a log is kept."""
    if sys.stderr.isatty() and not COMPILED_BEFORE:
        takes = "two or three minutes, with its derivatives" if derivatives else "about half a minute"
        say(f"compiling the model, once on this machine: {takes}")


@contextmanager
def compiling_meanwhile() -> Iterator[Callable[[], int]]:
    """Compile the model's derivatives in a process of its own; what is given waits for it."""
    child = subprocess.Popen([sys.executable, "-P", "-m", "straw.model.warm_up"], stderr=subprocess.DEVNULL)
    try:
        yield child.wait  # where it failed, what asks for derivatives says why
    finally:
        child.terminate()
        child.wait()
