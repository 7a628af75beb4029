"""straw shell, straw design: wrong arguments are refused in one line, before anything slow begins."""

from __future__ import annotations

import json
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
        (["--crease", "-1"], "crease stiffness -1"),
        (["--pressure-kpa", "nan"], "pressure_pa = nan"),
        (["--cell", "10"], "cell 10"),
        (["--points", "3"], "--points 3"),
        (["--tolerance", "0"], "tolerance"),
        (["--elasticity", "none/e.json"], "no folder"),
        (["--straw", "none.toml"], "none.toml"),
    ],
)
def test_wrong_arguments_are_one_line(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["shell", *arguments]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("straw:")]
    assert len(lines) == 1
    assert said in lines[0]


def test_a_design_without_a_requirement_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", str(tmp_path / "none.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "none.toml" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_requirements_that_no_design_meets_are_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "wish.toml").write_text("[wanted]\ndeploy_kpa = 900\n[vary]\nh_mm = [0.4, 0.6]\n")
    options = ["--jobs", "1", "--count", "64", "--check", "0", "--out", str(tmp_path)]
    assert main(["design", str(tmp_path / "wish.toml"), *options]) == 1
    assert "the best has deploy_kpa = 32.08, not 900" in capsys.readouterr().out


def test_an_order_of_snaps_is_checked_by_finite_elements(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """../shared/facts/fe.md: the paper's sealed frustum snaps at 25.2 kPa by finite elements, at 26.1 by equation 7."""
    from straw.model.parameters import StrawParameters
    from straw.model.snap import snaps

    own = next(snaps(StrawParameters(cells=1), [], 40e3)).pressure_pa
    wish, told = tmp_path / "wish.toml", tmp_path / "order.json"
    wish.write_text(f"[order]\ncells = [1]\nfirst_kpa = {own / 1e3}\napart_kpa = 2.0\n")
    assert main(["design", str(wish), "--jobs", "1", "--out", str(tmp_path), "--json", str(told)]) == 0
    found = json.loads(told.read_text())["order"][0]
    assert found["h_m"] == pytest.approx(0.508e-3, rel=1e-3)
    assert found["shell_pa"] - found["pressure_pa"] == pytest.approx((25.2 - 26.1) * 1e3, abs=60)
    assert "finite elements" in capsys.readouterr().out
