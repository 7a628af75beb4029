"""The examples run as they are, beside copies of the files they name."""

from __future__ import annotations

import os
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


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_runs_and_writes_its_picture(repository: Path, tmp_path: Path, name: str) -> None:
    examples = repository / "replay" / "examples"
    for path in examples.glob("*.py"):
        shutil.copyfile(path, tmp_path / path.name)
    environment = dict(os.environ)
    if name == "law_of_ones_own.py":
        environment["NUMBA_DISABLE_JIT"] = "1"  # interpreted: the model with another law compiles for a minute
    done = subprocess.run([sys.executable, name], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    picture, word = EXAMPLES[name]
    assert (tmp_path / picture).exists()
    assert word in done.stdout


def test_every_example_is_run_or_named_by_one_that_is(repository: Path) -> None:
    scripts = {path.name for path in (repository / "replay" / "examples").glob("*.py")}
    assert scripts == {*EXAMPLES, "hardening.py", "my_controller.py", "my_reader.py"}
