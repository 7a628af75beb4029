"""Fixtures of all tests: the checkout, and the folder of given material where there is one."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from functools import cache
from pathlib import Path

import pytest

# Tests drive no real rig: `straw rig vent` must not find their instruments, nor may tests find a lab's own ports.
os.environ["STRAW_STATE_DIR"] = tempfile.mkdtemp(prefix="straw-state-")

REPOSITORY = Path(__file__).resolve().parents[1]

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell that starts the tests in the background makes them ignore Ctrl-C, and so would every script they start.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def turn(item: pytest.Item) -> int:
    """The longest file first, which compiles the model; in parallel those that do not need it; then the demo, which
    would otherwise run alone at the end."""
    turns = {"test_concealed.py": 0, "test_plant_and_twin.py": 2, "test_plugged.py": 2}
    turns |= {"test_readme.py": 3, "test_derivative.py": 4}
    rooms = {"rig": 1, "tracking": 1, "model": 2}
    return turns.get(item.path.name, rooms.get(item.path.parent.name, 4))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the tests by `turn`."""
    items.sort(key=turn)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """In a run of all tests, wait before the first that needs derivatives until they are compiled."""
    every = item.session.items
    if turn(item) in (0, 4) and turn(every[0]) == 0 and turn(every[-1]) == 4 and "PYTEST_XDIST_WORKER" in os.environ:
        compile_once()


@cache
def compile_once() -> None:
    """Compile the model, or wait for the worker that does: otherwise each would compile all of it for minutes."""
    if sys.platform == "win32":
        return  # no such lock on this system
    import fcntl

    from straw.model import warm_up

    with (Path(tempfile.gettempdir()) / f"straw-tests-{os.getppid()}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        warm_up.main()
    Path(lock.name).unlink(missing_ok=True)


@pytest.fixture(scope="session")
def repository() -> Path:
    """The checkout these tests belong to."""
    return REPOSITORY


@pytest.fixture(scope="session")
def shared() -> Path:
    """The given material beside the checkout; tests that need it are skipped for a user who has none."""
    folder = REPOSITORY.parent / "shared"
    if not folder.is_dir():
        pytest.skip(f"needs the project's given material at {folder}, which is not part of a clone")
    return folder
