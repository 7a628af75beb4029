"""straw paper: the model gives the paper's numbers, and the figures show what their captions say."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from straw.model.kinematics import tip_pose
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.replay.cli import main
from straw.replay.paper.shapes import outline_m
from tests.printed_commands import PAPER, commands


@pytest.fixture(scope="module")
def made(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """By the guide's command, with the numbers in a file as well."""
    folder = tmp_path_factory.mktemp("paper")
    assert PAPER in commands(repository)
    with contextlib.chdir(folder):
        assert main([*PAPER.split()[1:], "--json", "numbers.json"]) == 0
    found = json.loads((folder / "numbers.json").read_text())
    return folder, found | {"figures": [folder / name for name in found["figures"]]}


def test_every_number_of_the_paper_is_reproduced_within_its_rounding(made: tuple[Path, dict[str, Any]]) -> None:
    rows = made[1]["numbers"]
    assert len(rows) > 30
    assert [row["name"] for row in rows if not row["agrees"]] == []


def test_every_number_is_the_papers_and_says_how_the_models_was_obtained(made: tuple[Path, dict[str, Any]]) -> None:
    assert all(row["source"].startswith("3.") and row["how"] for row in made[1]["numbers"])


def test_each_figure_is_a_picture_with_something_on_it_and_a_drawing_with_text(
    made: tuple[Path, dict[str, Any]],
) -> None:
    names = made[1]["figures"]
    assert {path.stem.split("-")[0] for path in names} == {"fig3", "fig4", "fig5", "fig6", "fig7", "figS1"}
    for path in names:
        if path.suffix == ".png":
            picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
            assert picture is not None
            assert np.mean(picture < 250) > 0.02
        else:
            assert "</svg>" in path.read_text(encoding="utf-8")
    assert not list((made[0] / "paper").glob("*.part"))


@pytest.mark.parametrize("bent", [{}, {2: 1, 5: -1}])
def test_the_drawn_straw_ends_where_its_tip_is(bent: dict[int, int]) -> None:
    straw = StrawParameters()
    q = rest_state(straw, [1, 4], 0.0, bent)
    upper, lower = outline_m(straw, q)
    x, z, angle = tip_pose(straw.constants(), q)
    np.testing.assert_allclose((upper[-1] + lower[-1]) / 2, (x, z), atol=1e-12)
    # the face is across the tip axis (sin Phi, cos Phi) and 2 r_i wide
    across = upper[-1] - lower[-1]
    assert across @ (np.sin(angle), np.cos(angle)) == pytest.approx(0, abs=1e-12)
    assert np.hypot(*across) == pytest.approx(2 * straw.r_i_m)


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").touch()
    assert main(["paper", "--out", str(tmp_path / "file")]) == 2
    said = capsys.readouterr().err.strip()
    assert said.count("\n") == 0
    assert "file" in said
