"""Progress for anything slow: a bar where a person watches, a file where a page does, nothing where a log is kept."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn

from tqdm import tqdm

from straw.model.compiled import COMPILED_BEFORE

Progress = Callable[[int, int], None]
#: Names a file in which a command says how far it is: whoever starts it for a page sets this.
TOLD_IN = "STRAW_PROGRESS"
TELL_S = 0.3


@contextmanager
def progress_bar(title: str, unit: str = "it") -> Iterator[Progress]:
    """A bar to be called with (done, total); it closes with the block, also on an error."""
    with _bar(title, unit) as bar:
        tell = _teller()

        def update(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)
            tell(title, done, total)

        yield update


@contextmanager
def stage_bar(title: str) -> Iterator[Callable[[str, int, int], None]]:
    """A bar to be called with (what is being done, stages done, stages in all)."""
    with _bar(title, "stage", "{n_fmt} of {total_fmt} stages, {elapsed}: {desc}") as bar:
        tell = _teller()

        def update(what: str, done: int, total: int) -> None:
            tell(what, done, total)
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


def _teller() -> Callable[[str, int, int], None]:
    """Writes how far it is into the file of `TOLD_IN`, now and then; does nothing where none is named."""
    named, last_s = os.environ.get(TOLD_IN), -TELL_S

    def tell(what: str, done: int, total: int) -> None:
        nonlocal last_s
        if not named or time.monotonic() - last_s < TELL_S:
            return
        last_s, part = time.monotonic(), Path(f"{named}.part")
        with suppress(OSError):
            part.write_text(json.dumps({"what": what, "done": done, "total": total}), encoding="utf-8")
            part.replace(named)

    return tell


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
