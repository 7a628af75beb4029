"""Rest states are equilibria, on the branch that was asked for."""

from __future__ import annotations

import numpy as np
import pytest

from model.errors import ModelError
from model.parameters import StrawParameters
from model.rest import rest_state
from model.straw import residual

STRAW = StrawParameters()


def test_without_gravity_folded_and_deployed_cells_rest_at_the_checked_equilibria() -> None:
    q = rest_state(STRAW.replace(g_m_per_s2=0.0), [2, 7])
    want = np.full(9, -2.2800e-3)
    want[[1, 6]] = 2.0248e-3
    np.testing.assert_allclose(q[:9], want, atol=0.5e-7)  # the notes give four decimals of a millimetre
    np.testing.assert_allclose(q[9:], 0, atol=1e-12)


@pytest.mark.parametrize("form", ["truncated", "full"])
@pytest.mark.parametrize("deployed", [[], [1, 4], list(range(1, 10))])
def test_a_rest_state_leaves_no_force(form: str, deployed: list[int]) -> None:
    straw = STRAW.replace(form=form)
    q = rest_state(straw, deployed, 5e3)
    left = residual(straw.constants(), q, 0 * q, 0 * q, 5e3)
    # against forces of the order of C3 p = 0.7 N and m g r = 1e-3 N m
    assert np.abs(left[: len(q) // 2]).max() < 1e-7
    assert np.abs(left[len(q) // 2 :]).max() < 1e-9
    even = q[len(q) // 2 - 9 : len(q) // 2]
    np.testing.assert_array_equal(even > 0, np.isin(np.arange(1, 10), deployed))


def test_a_long_deployed_straw_stays_on_its_branch() -> None:
    q = rest_state(STRAW, range(1, 10))
    assert np.all(np.abs(q[9:]) < 0.05)


def test_a_configuration_that_cannot_rest_names_itself_and_the_load() -> None:
    with pytest.raises(ModelError, match=r"cells 1 deployed.*-30 kPa"):
        rest_state(STRAW, [1], -30e3)


def test_a_cell_the_straw_does_not_have_is_named() -> None:
    with pytest.raises(ModelError, match="cell 12 is not in a straw of 9 cells"):
        rest_state(STRAW, [1, 12])
