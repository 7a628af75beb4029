"""Designs have the required properties in the reduced model, and an invalid requirement is refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from straw.model.design import gives, in_order, refined, sweep, with_varied
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.wish import Wish, read_wish

RANGES = {"zeta01_mm": (3.0, 5.0), "zeta02_mm": (-3.5, -1.5), "h_mm": (0.3, 0.8)}


def test_the_papers_frustum_is_found_from_its_snap_pressures_and_lengths() -> None:
    straw = StrawParameters()
    wanted = {k: v for k, v in gives(straw).items() if k != "stable_states"}
    wish = Wish(wanted, RANGES)
    designs = [d for chunk in sweep(wish, straw, 128) for d in chunk]
    best = refined(wish, straw, designs, keep=1)[0]
    assert best.varied["zeta01_mm"] == pytest.approx(3.78, abs=1e-4)
    assert best.varied["zeta02_mm"] == pytest.approx(-2.28, abs=1e-4)
    assert best.varied["h_mm"] == pytest.approx(0.508, abs=1e-4)
    assert gives(with_varied(straw, best.varied))["stable_states"] == 4


def test_cells_snap_one_after_another_in_the_required_order() -> None:
    wish = Wish(order=(2, 3, 1), first_kpa=20.0, apart_kpa=2.0)
    straw, seen = in_order(wish, StrawParameters(cells=3))
    assert [cell for cell, _ in seen] == [2, 3, 1]
    assert [p for _, p in seen] == pytest.approx([20e3, 22e3, 24e3], abs=20)
    assert straw.h_m[1, 1] < straw.h_m[2, 1] < straw.h_m[0, 1]


def test_an_order_that_leaves_out_a_cell_is_named() -> None:
    with pytest.raises(ModelError, match=r"order.cells = 1, 12; a straw of 2 cells needs each of 1 to 2 once"):
        in_order(Wish(order=(1, 12), first_kpa=20.0, apart_kpa=2.0), StrawParameters(cells=2))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[wanted]\ndeploy = 3\n[vary]\nh_mm = [1, 2]\n", "wanted.deploy"),
        ("[wanted]\ndeploy_kpa = 3\n[vary]\nh_mm = [2, 1]\n", "vary.h_mm"),
        ("[wanted]\ndeploy_kpa = 3\n", "expected"),
        ("[order]\ncells = [1, 1]\nfirst_kpa = 1\napart_kpa = 1\n", "each once"),
        ("[order]\ncells = [1]\nfirst_kpa = 1\napart_kpa = -1\n", "one sign"),
        ("wanted = 3\n", "table"),
        ("[wanted\n", "not TOML"),
    ],
)
def test_an_invalid_requirement_is_named_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "wish.toml"
    path.write_text(text)
    with pytest.raises(ModelError, match=said) as error:
        read_wish(path)
    assert "\n" not in str(error.value)
