"""Snap pressures: where the rest state of the paper's equations ends, and where the motion leaves it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpmath import mpf

from straw.model.continuation import Branch, _lost, follow
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.model.simulate import simulate
from straw.model.snap import next_snap, snap_of, snap_pair, snaps
from straw.model.stiffness import length_scale, stability, stiffness_matrix
from tests.model.paper import PaperStraw

STRAW = StrawParameters()


def test_the_first_cell_snaps_where_the_paper_saw_it_in_steps_of_half_a_kilopascal() -> None:
    for held in (False, True):
        down, up = snap_pair(STRAW, 1, held=held)
        assert down.pressure_pa == pytest.approx(-13.5e3, abs=250)
        assert up.pressure_pa == pytest.approx(22.5e3, abs=250)
        assert (down.lost, up.lost) == ("deployed", "folded")


@pytest.mark.parametrize(("deployed", "towards_pa"), [([1], -50e3), ([2, 3], 50e3)])
def test_at_a_snap_the_papers_equations_are_in_equilibrium_with_one_direction_of_zero_stiffness(
    deployed: list[int], towards_pa: float
) -> None:
    """The equations are those of tests/model/paper.py, in the full form, differentiated at 50 digits."""
    straw = STRAW.replace(cells=3, form="full")
    end = follow(Branch(straw, rest_state(straw, deployed), towards_pa))
    p = end.load * towards_pa
    c, scale = straw.constants(), length_scale(straw)
    values, modes = np.linalg.eig(stiffness_matrix(c, end.q, p) * scale * scale[:, None])
    soft = np.real(modes[:, values.real.argmin()]) * scale
    paper = PaperStraw(
        3, r_i=c.r_i, r_o=c.r_o, E=0.92e9, h=0.508e-3, zeta0_odd=3.78e-3, zeta0_even=-2.28e-3, r_ch=straw.r_ch_m,
        rho=c.rho, g=c.g, phi_0=c.phi_0, m_tip=c.m_tip, I_tip=c.I_tip, F_X=0, F_Z=0, M_Y=0, c_zeta=0, c_phi=0,
    )  # fmt: skip
    still = [mpf(0)] * len(end.q)

    def force(q: list) -> np.ndarray:
        return np.array([float(x) for x in paper.residual(q, still, still, mpf(p))]) * scale

    q = [mpf(x) for x in end.q]
    assert np.abs(force(q)).max() < 1e-10  # N m, of moments of 1e-2
    step = 1e-6
    up, down = (force([x + mpf(sign * step * d) for x, d in zip(q, soft, strict=True)]) for sign in (1, -1))
    assert np.abs(up - down).max() / (2 * step) < 1e-5  # N m, of stiffnesses of 1


@pytest.mark.parametrize("deployed", [[1], list(range(2, 10))], ids=["down", "up"])
def test_a_pressure_ramped_slowly_snaps_the_moving_straw_just_beyond_that_pressure_and_not_just_before(
    deployed: list[int],
) -> None:
    """50 Pa on either side, held for 6 s; passing the bottleneck of a fold bifurcation takes about a second there."""
    straw = STRAW.replace(c_zeta_n_s_per_m=5.0)
    snap_pa = snap_of(straw, deployed, 1).pressure_pa
    for beyond_pa, snapped in ((-50.0, False), (50.0, True)):
        last_pa = snap_pa + np.sign(snap_pa) * beyond_pa
        run = simulate(straw, lambda t, p=last_pa: p * np.minimum(t / 8, 1), np.linspace(0, 14, 50), deployed)
        assert (np.sign(run.zeta_m[-1, 0, 1]) != np.sign(run.zeta_m[0, 0, 1])) is np.bool_(snapped)


def test_every_cell_snaps_and_the_outer_ones_which_carry_less_snap_later() -> None:
    pairs = [snap_pair(STRAW, cell) for cell in range(1, 9)]
    down, up = np.array([[s.pressure_pa for s in pair] for pair in pairs]).T
    assert np.all(np.diff(down) < 0)
    assert np.all(np.diff(up) > 0)


def test_without_gravity_a_cell_snaps_where_its_frustum_alone_does() -> None:
    """Closed form: F' = 0 at 12 zeta^2 = 4 zeta_0^2 - C2 / C1, with the sealed end's pull (S = 5.24067e-4 m^2)."""
    down, up = snap_pair(STRAW.replace(g_m_per_s2=0.0), 1)
    C1, C2, S, zeta0 = 3.36335e8, 695.26, 5.24067e-4, -2.28e-3
    for snap, side in ((down, 1), (up, -1)):
        z = side * np.sqrt((4 * zeta0**2 - C2 / C1) / 12)
        want = (8 * C1 * z * (z**2 - zeta0**2) + 2 * C2 * (z - zeta0)) / S
        assert snap.pressure_pa == pytest.approx(want, rel=1e-4)  # the constants are given to five digits


def test_cells_snap_in_order_and_one_that_is_asked_for_names_those_before_it() -> None:
    order = list(snaps(STRAW, [1, 4], -25e3))
    assert [s.cell for s in order] == [1, 4]
    assert abs(order[0].pressure_pa) < abs(order[1].pressure_pa)
    assert snap_of(STRAW, [1, 4], 4).before == (1,)
    assert next_snap(STRAW, [1, 4], -10e3) is None


def test_a_bent_cell_snaps_where_its_antisymmetric_state_ends() -> None:
    down, up = (next_snap(STRAW, [], p, {3: 1}) for p in (-25e3, 25e3))
    assert down is not None
    assert up is not None
    assert (down.lost, up.lost) == ("bent", "bent")
    # the inner bifurcations of a frustum with the sealed end; gravity shifts them far less than their distance
    assert down.pressure_pa == pytest.approx(-2.90e3, abs=500)
    assert up.pressure_pa == pytest.approx(15.00e3, abs=1000)


def test_a_state_is_stable_up_to_its_snap_and_softens_towards_it() -> None:
    softest = []
    for part in (0.0, 0.5, 0.9, 0.99):
        p = part * snap_of(STRAW, [1], 1).pressure_pa
        softest.append(stability(STRAW, rest_state(STRAW, [1], p), p)[0].real)
    assert softest[-1] > 0
    assert np.all(np.diff(softest) < 0)


def test_a_cell_that_does_not_snap_or_exist_is_named_in_the_error() -> None:
    with pytest.raises(ModelError, match="cell 12 is not in a straw of 9"):
        snap_of(STRAW, [1], 12)
    with pytest.raises(
        ModelError, match=r"cell 2 of the straw with cells 1 deployed does not snap between 0 and 5 kPa"
    ):
        snap_of(STRAW, [1], 2, limit_pa=5e3)


def test_a_snap_pressure_takes_at_most_a_few_hundred_stiffness_matrices(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 0.1 ms each, well under a second; identification asks for hundreds of snaps."""
    calls = 0

    def counted(*args: object) -> np.ndarray:
        nonlocal calls
        calls += 1
        return stiffness_matrix(*args)

    monkeypatch.setattr("straw.model.continuation.stiffness_matrix", counted)
    snap_pair(STRAW, 1)
    assert calls < 2 * 400


class Softening:
    """One coordinate whose stiffness falls with the load; correction finds another stable point beyond ``lost``."""

    def __init__(self, lost: float, elsewhere: bool) -> None:
        self.lost, self.elsewhere = lost, elsewhere

    def correct(self, guess: np.ndarray, _plane: np.ndarray, _reach: float) -> np.ndarray:
        return np.array([guess[0], min(guess[1], 0.9 * self.lost) if self.elsewhere else guess[1]])

    def jacobian(self, y: np.ndarray) -> np.ndarray:
        return np.array([[-(self.lost - y[1]), 0.0]])


@pytest.mark.parametrize(("elsewhere", "load"), [(False, 0.4), (True, 0.36)])
def test_stability_lost_where_correction_finds_only_stable_points_is_said_to_be_lost_at_the_last(
    elsewhere: bool, load: float
) -> None:
    branch: Any = Softening(0.4, elsewhere)
    assert _lost(branch, np.zeros(2), np.array([0.0, 1.0]), 0.7)[1] == pytest.approx(load, abs=1e-6)
