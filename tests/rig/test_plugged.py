"""Users' controllers and emulators are loaded from a file, without a change to the package."""

from __future__ import annotations

from pathlib import Path

import pytest

from straw.replay.cli import main
from straw.rig.drivers import make_controller
from straw.rig.errors import RigError
from straw.rig.run_read import read_run

DRIVER = """
import straw
from straw.rig.controllers.ob1_mk4 import CONTROLLER as Ob1
from straw.rig.emulators.ob1_mk4 import EMULATOR

class Mine(Ob1):
    name = "mine"

CONTROLLER = Mine
"""
PROTOCOL = 'name = "p"\npressure_unit = "kPa"\ninitial_deployed = [1, 4]\n[[main]]\nhold = -1\nfor_s = 0.05\n'


def test_a_driver_from_a_file_runs_behind_its_guardian_and_is_recorded(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(DRIVER)
    (tmp_path / "p.toml").write_text(PROTOCOL)
    run = ["rig", "run", str(tmp_path / "p.toml"), "--emulate", "--controller", str(tmp_path / "mine.py")]
    assert main([*run, "-o", str(tmp_path / "r.mcap")]) == 0
    assert "mine" in str(read_run(tmp_path / "r.mcap").metadata)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "CONTROLLER = None; expected a class"),
        ("CONTROLLER = 3", "expected a class"),
        ("raise ValueError('no')", "line 1: ValueError: no"),
        ("import straw\nclass C(straw.Controller):\n    name = 'c'\nCONTROLLER = C", "C lacks _close, _open"),
        (DRIVER.replace("(Ob1)", "(Ob1, 3)"), "TypeError"),
    ],
)
def test_an_error_in_a_driver_is_one_line_with_its_file(
    tmp_path: Path, text: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(RigError) as refused:
        make_controller(str(path), "x")
    assert str(refused.value).startswith(str(path))
    assert words in str(refused.value)
    assert main(["check", str(path)]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_check_reports_that_a_driver_is_valid(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.py").write_text(DRIVER)
    assert main(["check", str(tmp_path / "mine.py")]) == 0
    assert "controller mine is good" in capsys.readouterr().out
