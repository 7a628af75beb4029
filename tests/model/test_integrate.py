"""The tableau has its stated order."""

from __future__ import annotations

import numpy as np
import pytest

from straw.model.scheme import COEFFICIENTS as A
from straw.model.scheme import ERROR, GAMMA
from straw.model.scheme import TIMES as C

B = A[-1]  # stiffly accurate: the last stage is the result
LOWER = B - ERROR


def conditions(b: np.ndarray) -> dict[int, list[tuple[float, float]]]:
    """Butcher's order conditions, left side and right side, by order."""
    return {
        1: [(b.sum(), 1)],
        2: [(b @ C, 1 / 2)],
        3: [(b @ C**2, 1 / 3), (b @ A @ C, 1 / 6)],
        4: [(b @ C**3, 1 / 4), (b @ (C * (A @ C)), 1 / 8), (b @ A @ C**2, 1 / 12), (b @ A @ A @ C, 1 / 24)],
    }


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_the_method_is_of_order_four(order: int) -> None:
    for left, right in conditions(B)[order]:
        assert left == pytest.approx(right, abs=1e-14)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_embedded_formula_is_of_order_three(order: int) -> None:
    for left, right in conditions(LOWER)[order]:
        assert left == pytest.approx(right, abs=1e-13)
    assert any(abs(left - right) > 1e-3 for left, right in conditions(LOWER)[4])


def test_it_is_l_stable() -> None:
    """R(z) = 1 + z b (1 - z A)^-1 1 tends to zero: L-stable."""
    ones = np.ones(len(B))
    at = [1 + z * B @ np.linalg.solve(np.eye(len(B)) - z * A, ones) for z in (-1e3, -1e6)]
    assert abs(at[1]) < abs(at[0]) < 1e-2
    assert np.all(np.diag(A) == GAMMA)
