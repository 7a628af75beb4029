"""The tables beside equation 7: barriers between the states of the paper's frustum, and where energies agree."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("skfem")

from straw.replay.paper.shell import Cut, agreement
from straw.replay.shell.table import _barriers_of


def test_barriers_are_saddles_above_the_states_they_separate() -> None:
    """../shared/facts/fe.md by NGSolve, and equation 7 in brackets: (zeta mm, phi, stable, mJ)."""
    shell = [(2.087, 0, True, 11.76), (0.232, 0, False, 21.19), (-2.28, 0, True, 0.0)]
    shell += [(-0.130, 0.215, True, 10.01), (1.035, 0.104, False, 17.31), (-0.864, 0.143, False, 12.14)]
    assert _barriers_of(shell) == pytest.approx(
        {"folded to bent": 12.14, "bent to folded": 2.13, "deployed to bent": 5.55, "bent to deployed": 7.30}
    )


def test_a_frustum_of_fewer_states_has_no_such_barriers() -> None:
    assert _barriers_of([(-1.0, 0, True, 0.0)]) == {}


def test_agreement_is_stated_as_the_range_around_the_rest_state_in_which_it_holds() -> None:
    """Planted: equal up to zeta = 1 mm and phi = 0.2 rad, beyond them 3 mJ apart where the barrier is 20 mJ."""
    zeta, phi = np.linspace(-3e-3, 3e-3, 61), np.linspace(0, 0.34, 35)
    barrier, flat = 0.02 * np.cos(300 * zeta) ** 2, np.full(35, 0.01)
    one = Cut(zeta, barrier, barrier + np.where(zeta > 1.05e-3, 3e-3, 0), barrier)
    other = Cut(phi, flat, flat + np.where(phi > 0.205, 3e-3, 0), flat)
    told = agreement((one, other))
    assert "zeta from -3.00 to 1.00 mm (phi = 0): within 1.0 mJ, 5% of the barrier" in told
    assert "phi from 0.00 to 0.20 rad (zeta = -0.27 mm): within 1.0 mJ, 5% of the barrier" in told
