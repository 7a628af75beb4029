"""Progress for anything slow: a bar on a terminal, a file for a page, nothing in a log."""

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
#: Environment variable with the file for a command's progress, set by a process that shows it on a page.
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
    room = shutil.get_terminal_size()  # tqdm draws nothing on a terminal of unknown size
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
    """Writes the progress into the file of `TOLD_IN` at intervals; does nothing where none is named."""
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
    """Announce on a terminal that the model is about to be compiled."""
    if sys.stderr.isatty() and not COMPILED_BEFORE:
        takes = "two or three minutes, with its derivatives" if derivatives else "about half a minute"
        say(f"compiling the model, once on this machine: {takes}")


@contextmanager
def compiling_meanwhile() -> Iterator[Callable[[], int]]:
    """Compile the model's derivatives in a process of its own and wait for it."""
    child = subprocess.Popen([sys.executable, "-P", "-m", "straw.model.warm_up"], stderr=subprocess.DEVNULL)
    try:
        yield child.wait  # if it failed, the first use of derivatives raises the reason
    finally:
        child.terminate()
        child.wait()
