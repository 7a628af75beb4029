"""Straw files read back as written, and invalid ones are refused by name."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.straw_file import load_straw, straw_from_toml


def test_a_straw_file_reads_back_exactly() -> None:
    E = np.full((9, 2), 0.92e9)
    E[3, 1] = 0.87e9
    straw = StrawParameters(form="full", E_pa=E, r_ch_m=0.315e-3)
    again = straw_from_toml(straw.to_toml())
    assert again.to_toml() == straw.to_toml()
    np.testing.assert_array_equal(again.E_pa, straw.E_pa)
    assert again.constants().loss == straw.constants().loss


def test_files_of_readers_and_figures_are_kept_and_found_from_anywhere(tmp_path: Path) -> None:
    text = 'readers = ["my_reader.py"]\nfigures = ["a.py", "b.py"]\n'
    straw = straw_from_toml(text, folder=tmp_path)
    again = straw_from_toml(straw.replace(r_ch_m=0.4e-3).to_toml(), folder=tmp_path / "elsewhere")
    assert again.readers == (str(tmp_path / "my_reader.py"),)
    assert again.figures == (str(tmp_path / "a.py"), str(tmp_path / "b.py"))
    assert pickle.loads(pickle.dumps(again)).to_toml() == again.to_toml()
    assert "readers" not in StrawParameters().to_toml()


def test_an_empty_straw_file_is_the_papers_specimen() -> None:
    assert straw_from_toml("").to_toml() == StrawParameters().to_toml()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("r_ch_m = -1.0", "r_ch_m = -1.0, expected above zero"),
        ("r_ch_m = nan", "r_ch_m = nan"),
        ("r_ch_m = 1e-90", "r_ch_m = 1e-90, expected above 1e-60"),
        ("E_pa = inf", "E_pa = inf"),
        ("cells = 301", "expected 1 to 300"),
        ("cells = 2.5", "cells = 2.5"),
        ("cells = true", "cells = True"),
        ("form = 'half'", "truncated, full"),
        ("zeta0_m = [1e-3, -2e-3]", "zeta0_m"),
        ("h_m = [1e-3, 1e-3, 1e-3]", "h_m does not spread over 9 cells"),
        ("h_m = ['a', 'b']", "h_m does not spread"),
        ("youngs_modulus = 1e9", "unknown key 'youngs_modulus'"),
        ("r_i_m = 0.02", "r_o_m"),
        ("r_ch_m = ", "not TOML"),
    ],
)
def test_an_invalid_straw_file_is_refused_in_one_line_that_names_the_constant(text: str, words: str) -> None:
    with pytest.raises(ModelError) as caught:
        straw_from_toml(text, "specimen.toml")
    message = str(caught.value)
    assert message.startswith("specimen.toml: ")
    assert words in message
    assert "\n" not in message


def test_a_missing_straw_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"none\.toml: cannot read the straw file: No such file"):
        load_straw(tmp_path / "none.toml")
