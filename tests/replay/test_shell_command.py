"""straw shell, straw design: what is asked wrongly is said in one line, before anything slow begins."""

from __future__ import annotations

from pathlib import Path

import pytest

from straw.replay.cli import main

pytest.importorskip("skfem")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--profile", "none.csv"], "none.csv"),
        (["--phi", "sideways"], "sideways"),
        (["--rims", "glued"], "glued"),
        (["--nu", "0.5"], "nu = 0.5"),
        (["--cell", "10"], "cell 10"),
        (["--points", "3"], "--points 3"),
        (["--tolerance", "0"], "tolerance"),
        (["--elasticity", "none/e.json"], "no folder"),
        (["--straw", "none.toml"], "none.toml"),
    ],
)
def test_what_is_asked_wrongly_is_said_in_one_line(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["shell", *arguments]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("straw:")]
    assert len(lines) == 1
    assert said in lines[0]


def test_a_design_without_a_wish_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", str(tmp_path / "none.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "none.toml" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
