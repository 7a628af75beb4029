"""Fixtures of all tests: the checkout, and the folder of given material where there is one."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from functools import cache
from pathlib import Path

import pytest

# Tests run side by side, one on each processor: more threads for small matrices would only take time from each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Tests drive no real rig: `straw rig vent` must not find their instruments, nor may tests find a lab's own ports.
os.environ["STRAW_STATE_DIR"] = tempfile.mkdtemp(prefix="straw-state-")

REPOSITORY = Path(__file__).resolve().parents[1]

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell that starts the tests in the background makes them ignore Ctrl-C, and so would every script they start.
    signal.signal(signal.SIGINT, signal.default_int_handler)


#: Files beside those of `rig` and `tracking` whose tests use no compiled model: work for the others while one compiles.
WITHOUT_MODEL = {
    "test_apparatus.py", "test_discover_blind.py", "test_discover_choose.py", "test_formula.py",
    "test_function_system.py", "test_import_command.py", "test_metrics.py", "test_shell_pictures.py",
    "test_shell_table.py", "test_system.py",
}  # fmt: skip
#: Files of `rig` that simulate a straw; beside the one that compiles the model they would compile it once more.
WITH_MODEL = {"test_plant_and_twin.py", "test_plugged.py", "test_rig_file.py"}
#: They compile what other files need, too (of discovery alone 28 s); side by side, each of these would.
FIRST = ("test_doubt.py", "test_discover_blind.py")
#: Files that take longest, the longest first: the last of a run is then a short one, and no core waits for it.
LONGEST = (
    "test_readme.py", "test_diagnose.py", "test_derivative.py", "test_energy_balance.py",
    "test_examples.py", "test_executor.py",
)  # fmt: skip
COMPILES, WAITS_FOR_NOTHING, LONG, OTHERS = range(4)


def turn(item: pytest.Item) -> int:
    """The file that compiles the model first; meanwhile those that do not need it; then the longest ones, which would
    otherwise run alone at the end."""
    name = item.path.name
    if name == "test_concealed.py":
        return COMPILES
    if name in WITH_MODEL:
        return OTHERS
    if item.path.parent.name in ("rig", "tracking") or name in WITHOUT_MODEL:
        return WAITS_FOR_NOTHING
    return LONG if name in LONGEST else OTHERS


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the tests by `turn`; files of the rig, which mostly wait, are spread among those that compute."""
    alike: dict[tuple[int, bool], dict[Path, int]] = {}
    for item in items:
        files = alike.setdefault((turn(item), item.path.parent.name == "rig"), {})
        files.setdefault(item.path, len(files))
    place = {path: k / len(files) for files in alike.values() for path, k in files.items()}

    def order(item: pytest.Item) -> tuple[float, ...]:
        name = item.path.name
        if (at := turn(item)) == LONG:
            return at, LONGEST.index(name)
        return at, name not in FIRST, place[item.path]

    items.sort(key=order)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """In a run of all tests, wait before the first that needs the model until it is compiled."""
    every = item.session.items
    parallel = "PYTEST_XDIST_WORKER" in os.environ and turn(every[0]) == COMPILES and turn(every[-1]) == OTHERS
    if parallel and turn(item) != WAITS_FOR_NOTHING:
        compile_once()


@cache
def compile_once() -> None:
    """Compile the model, or wait for the worker that does: otherwise each would compile all of it for minutes."""
    if sys.platform == "win32":
        return  # no such lock on this system
    import fcntl

    from straw.model import warm_up
    from straw.model.parameters import StrawParameters
    from straw.model.simulate import Stepper

    with (Path(tempfile.gettempdir()) / f"straw-tests-{os.getppid()}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        warm_up.main()
        Stepper(StrawParameters(), [1, 4]).advance(1e-3, 0.0, -1.0)  # without derivatives
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
