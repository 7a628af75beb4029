"""Rest states are equilibria on the requested branch."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from straw.model.continuation import Branch, follow
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.model.stiffness import stability
from straw.model.straw import residual

STRAW = StrawParameters()


def test_without_gravity_folded_and_deployed_cells_rest_at_the_known_equilibria() -> None:
    q = rest_state(STRAW.replace(g_m_per_s2=0.0), [2, 7])
    want = np.full(9, -2.2800e-3)
    want[[1, 6]] = 2.0248e-3
    np.testing.assert_allclose(q[:9], want, atol=0.5e-7)  # the notes give four decimals of a millimetre
    np.testing.assert_allclose(q[9:], 0, atol=1e-12)


@pytest.mark.parametrize("form", ["truncated", "full"])
@pytest.mark.parametrize("deployed", [[], [1, 4], list(range(1, 10))])
def test_a_rest_state_is_free_of_force(form: str, deployed: list[int]) -> None:
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


def test_the_error_of_a_configuration_without_rest_state_names_it_and_the_load() -> None:
    with pytest.raises(ModelError, match=r"cells 1 deployed.*-30 kPa"):
        rest_state(STRAW, [1], -30e3)


def test_a_cell_the_straw_does_not_have_is_named() -> None:
    with pytest.raises(ModelError, match="cell 12 is not in a straw of 9 cells"):
        rest_state(STRAW, [1, 12])


@pytest.mark.parametrize("form", ["truncated", "full"])
def test_each_cell_may_also_rest_bent_to_either_side(form: str) -> None:
    straw = STRAW.replace(form=form)
    q = rest_state(straw, [2], 1e3, {1: 1, 5: -1})
    left = residual(straw.constants(), q, 0 * q, 0 * q, 1e3)
    assert np.abs(left).max() < 1e-7
    phi = q[-9:]
    assert phi[0] > 0.15
    assert phi[4] < -0.15
    assert np.abs(np.delete(phi, [0, 4])).max() < 0.05
    assert stability(straw, q, 1e3)[0].real > 0


def test_a_straw_too_long_to_carry_its_weight_is_an_error_that_names_the_buckling_cell() -> None:
    with pytest.raises(ModelError, match=r"cells 1-30 deployed: no rest state at 0 kPa: cell 1 gives way"):
        rest_state(STRAW.replace(cells=30), range(1, 31))


@pytest.mark.parametrize(
    ("deployed", "bent", "words"),
    [([1], {1: 1}, "both deployed and bent"), ([], {3: 2}, "cell 3 bent 2"), ([], {10: 1}, "cell 10 is not in")],
)
def test_an_invalid_configuration_is_refused(deployed: list[int], bent: dict[int, int], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        rest_state(STRAW, deployed, 0.0, bent)


def test_a_cell_without_the_requested_state_is_named() -> None:
    h_m = np.tile([0.508e-3, 0.508e-3], (9, 1))
    h_m[3, 1] = 5e-3
    with pytest.raises(ModelError, match="cell 4 has no deployed state"):
        rest_state(STRAW.replace(h_m=h_m), [1, 4])


class _Bending:
    """A branch of one coordinate that leaves its tangent by a fifth of every step, and by rounding at least."""

    def __init__(self) -> None:
        self.free, self.cells, self.load_length = np.arange(1), 1, 1.0

    def place(self, y: np.ndarray) -> tuple[np.ndarray, float, float]:
        return y[:-1], float(y[-1]), 0.0

    def jacobian(self, y: np.ndarray) -> np.ndarray:
        return np.array([[-1.0, 0.0]])

    def correct(self, guess: np.ndarray, direction: np.ndarray, reach: float) -> np.ndarray:
        return guess + np.array([max(0.2 * reach, 1e-12), 0.0])


def test_a_branch_that_bends_at_every_step_is_given_up_where_it_came_to() -> None:
    end = follow(cast(Branch, _Bending()))
    assert 0 < end.load < 1
    assert end.share is not None
