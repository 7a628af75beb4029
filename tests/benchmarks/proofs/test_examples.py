"""The examples run as they are, beside copies of the files they name."""

from __future__ import annotations

import contextlib
import io
import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

#: The file that each script writes, and one word that it prints.
EXAMPLES = {
    "overlay_of_a_run.py": ("fold.png", "um RMS"),
    "protocol_predicted.py": ("deploy.png", "one percent of E_pa"),
    "law_of_ones_own.py": ("law.png", "truth 3e+06"),
    "controller_of_ones_own.py": ("hold.png", "readings by my-controller"),
    "diagnosis_step_by_step.py": ("diagnosis.png", "RMS held out 1.835 -> 0.0"),
    "recording_of_another_logger.py": ("import.png", "0 guesses left; both ways agree within"),
}
#: Started as from a shell, as they bring in a law, a driver or a reader, which stay for the rest of a process. The
#: others run in this one, which saves their start-ups.
STARTED = ("law_of_ones_own.py", "controller_of_ones_own.py", "recording_of_another_logger.py")


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs_and_writes_its_picture(repository: Path, tmp_path: Path, name: str) -> None:
    examples = repository / "replay" / "examples"
    for path in examples.glob("*.py"):
        shutil.copyfile(path, tmp_path / path.name)
    said = started(name, tmp_path) if name in STARTED else called(name, tmp_path)
    picture, word = EXAMPLES[name]
    assert (tmp_path / picture).exists()
    assert word in said


def started(name: str, folder: Path) -> str:
    """What a script prints as a process of its own."""
    environment = dict(os.environ)
    if name == "law_of_ones_own.py":
        environment["NUMBA_DISABLE_JIT"] = "1"  # interpreted: the model with another law compiles for a minute
    done = subprocess.run([sys.executable, name], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def called(name: str, folder: Path) -> str:
    """The same of a script that runs in this process."""
    out = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out):
        runpy.run_path(name, run_name="__main__")
    return out.getvalue()


def test_every_example_is_run_or_named_by_one_that_is(repository: Path) -> None:
    scripts = {path.name for path in (repository / "replay" / "examples").glob("*.py")}
    assert scripts == {*EXAMPLES, "hardening.py", "my_controller.py", "my_reader.py"}
