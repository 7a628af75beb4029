"""Users' figures of merit are judged like straw's own, by file, straw file and entry point."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from straw.model.errors import ModelError
from straw.model.plugged import files_named_in
from straw.replay.cli import main
from straw.replay.compare.judge import Motion, quantities
from straw.replay.errors import ReplayError
from straw.replay.metrics.merit import FIGURES, add_figures
from straw.replay.metrics.typical import typical_motions
from straw.replay.metrics.validation import Quantity
from straw.rig.errors import RigError

FIGURE = """
import numpy as np
import straw

def value(motion):
    return motion.z_m[motion.time_s > 1.9].mean()

FIGURE = straw.FigureOfMerit(name="last height", unit="m", about="mean Z of the last 0.1 s", value=value)
"""
RETURNS = "return motion.z_m[motion.time_s > 1.9].mean()"
LIMIT_RAD = 0.1


@pytest.fixture(autouse=True)
def nothing_plugged_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FIGURES.variable, "")


@pytest.fixture
def fold() -> Motion:
    return typical_motions()["folding"]


def written(folder: Path, text: str = FIGURE) -> Path:
    path = folder / "my_figure.py"
    path.write_text(text)
    return path


def judged(fold: Motion) -> dict[str, Quantity]:
    return {q.name: q for q in quantities(fold, fold, fold, {}, LIMIT_RAD)}


def test_a_figure_from_a_file_is_judged_beside_straws_own(tmp_path: Path, fold: Motion) -> None:
    before = judged(fold)
    add_figures(written(tmp_path))
    after = judged(fold)
    assert list(after) == [*before, "last height"]
    found = after["last height"]
    assert found.measured == found.predicted == pytest.approx(fold.z_m[fold.time_s > 1.9].mean())
    assert found.verdict == "cannot be resolved"
    # the mean of samples that all move by one sigma moves by it: fully correlated noise is the worst case
    assert found.u_data == pytest.approx(fold.sigma["z_m"][0], rel=1e-6)


def test_the_uncertainty_of_a_figure_at_the_end_of_a_snap_is_the_noise_of_its_samples(
    tmp_path: Path, fold: Motion
) -> None:
    add_figures(written(tmp_path, FIGURE.replace(RETURNS, "return motion.phi_rad[7]")))
    # white noise of one sample, estimated from 16 draws: within three of its own deviations of 18 %
    assert judged(fold)["last height"].u_data == pytest.approx(fold.sigma["phi_rad"][0], rel=0.54)


def test_nan_means_that_the_motion_has_no_such_figure(tmp_path: Path, fold: Motion) -> None:
    add_figures(written(tmp_path, FIGURE.replace(RETURNS, "return np.nan")))
    assert "not in the measurement" in judged(fold)["last height"].words


def test_a_straw_file_names_figures_from_its_own_folder(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('figures = ["my_figure.py"]\n')
    assert files_named_in(tmp_path / "s.toml", "figures") == [tmp_path / "my_figure.py"]
    (tmp_path / "s.toml").write_text("figures = 3\n")
    with pytest.raises(ModelError, match=r'figures = \["my_figure.py"\]'):
        files_named_in(tmp_path / "s.toml", "figures")


def test_a_figure_of_an_installed_package_is_judged(tmp_path: Path) -> None:
    (tmp_path / "height-1.0.dist-info").mkdir()
    written(tmp_path).rename(tmp_path / "height_pkg.py")
    (tmp_path / "height-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: height\nVersion: 1.0\n")
    (tmp_path / "height-1.0.dist-info" / "entry_points.txt").write_text("[straw.figures]\nheight = height_pkg\n")
    code = "from straw.rig import parts; from straw.replay.metrics.merit import FIGURES; print(parts.parts(FIGURES))"
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert "last height" in done.stdout, done.stderr
    assert "height 1.0" in done.stdout


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (RETURNS, "return 1 / 0", "value raises line 6: ZeroDivisionError: division by zero; give NaN"),
        (RETURNS, "return motion.z_m", "value gives an array of shape (480,); expected one number of m"),
        (RETURNS, "return 'high'", "value gives 'high'; expected one number of m"),
        (RETURNS, "return np.inf", "value is inf; give a finite number, or NaN"),
        (RETURNS, "return None", "value gives None"),
        ('name="last height"', 'name="x at the end"', "there is one of this name; give yours another"),
        ('unit="m"', 'unit=""', "unit = ''"),
        ("value=value", "value=3", "value is no function"),
        (FIGURE, "", "gives no figure; end it with FIGURE = straw.FigureOfMerit(...)"),
    ],
)
def test_an_error_in_a_figure_is_one_line_with_its_file(
    tmp_path: Path, fold: Motion, old: str, new: str, words: str
) -> None:
    assert old in FIGURE
    path = written(tmp_path, FIGURE.replace(old, new))

    def used() -> None:
        add_figures(path)
        judged(fold)

    with pytest.raises((RigError, ReplayError)) as refused:
        used()
    said = str(refused.value)
    assert said.startswith(str(path))
    assert words in said
    assert "\n" not in said


def test_check_evaluates_a_figure_on_typical_motions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(written(tmp_path))]) == 0
    assert "figure of merit last height is good" in capsys.readouterr().out
    assert main(["check", str(written(tmp_path, FIGURE.replace(RETURNS, "return np.nan")))]) == 2
    assert "value is NaN of every motion tried (folding and resting)" in capsys.readouterr().err
