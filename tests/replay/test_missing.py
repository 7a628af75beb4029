"""A missing force as a curve and a formula: planted by an independent apparatus, or as plain numbers."""

from __future__ import annotations

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.model.straw_file import straw_from_toml
from straw.replay.diagnose.formula import Formula
from straw.replay.diagnose.sparse import Tangent, deviations, sparse
from straw.replay.diagnose.systems.straw.constants import applied
from straw.replay.diagnose.systems.straw.dictionary import atoms
from straw.replay.diagnose.systems.straw.instrument import Instrument, last_direction
from straw.replay.diagnose.systems.straw.states import STATES
from straw.replay.diagnose.systems.straw.tables import bent_points, formula_points, points

BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)
BY_NAME = {state.name: state for state in STATES}


def test_a_straw_with_a_curve_can_be_saved_and_simulated():
    at = np.array([0.2, 0.4, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0])
    state = BY_NAME["tip X, along Z"]
    straw = applied(state.straw_with(BASE, at), state.unknowns(at), np.full(8, 10.0))[0]
    again = straw_from_toml(straw.to_toml())
    ends = [simulate(s, lambda t: 0 * t, np.array([0.0, 0.1]), [1, 4]) for s in (again, BASE.replace(F_Z_n=0.02))]
    assert ends[0].z_m[-1] == pytest.approx(ends[1].z_m[-1], abs=1e-7)


def test_a_formula_leaves_out_what_the_base_can_compensate():
    """Runs that determine a curve only up to a straight line through zero, which is the base's own damping."""
    state, v = BY_NAME["speed"], np.geomspace(0.005, 0.4, 8)
    known = np.eye(8) * 1e4
    line = known @ v
    H = known - np.outer(line, line) / (v @ line)
    t = Tangent(12.0 * v**2 - 3.0 * v, np.zeros(8), H, np.ones(8), np.zeros((0, 8)), np.zeros(0), known)
    (chosen, a, follows), *others = sparse(t, v, atoms(state, v))
    assert follows
    assert [atom.text for atom in chosen] == ["|v| v"]
    assert a == pytest.approx([12.0])
    stays = [(atoms, start) for atoms, start, follows in others if len(atoms) == 2 and not follows]
    assert [atom.text for atom in stays[0][0]] == ["v", "|v| v"]  # where the base's damping stays as it is
    assert stays[0][1] == pytest.approx([-3.0, 12.0])
    law = Formula("F(v)", chosen, a, np.array([0.4]), ("N/(m/s)^2",), 1.0)
    assert law.text == "F(v) = (12 ± 0.4) N/(m/s)^2 |v| v"


@pytest.mark.parametrize("state", STATES, ids=lambda state: state.name)
def test_every_state_has_a_curve_that_changes_nothing_while_it_is_zero(state):
    at = np.array([-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 5.0]) if state.zero else np.arange(1.0, 9.0) / 10
    unknowns = state.unknowns(at)
    assert len(unknowns) == 8 - state.zero
    straw = state.straw_with(BASE, at)
    _, instrument = applied(straw, unknowns, np.zeros(len(unknowns)))
    grid = np.linspace(0, 3.0, 5)
    np.testing.assert_array_equal(instrument.true_pressure(grid, grid), grid)
    np.testing.assert_array_equal(instrument.true_time(grid), grid)
    moved, other = applied(straw, unknowns, np.ones(len(unknowns)))
    assert moved.terms.keys() == ({state.term} if state.term else set())
    assert (other == Instrument()) == bool(state.term)
    assert len(atoms(state, at)) >= 4


def test_points_lie_where_the_runs_are_and_cover_their_whole_range():
    rng = np.random.default_rng(2)
    x = np.concatenate([rng.normal(35e3, 100.0, 5000), rng.uniform(-20e3, 35e3, 500)])
    at = points(BY_NAME["gauge over pressure"], [x])
    assert at is not None
    assert np.all(np.diff(at) > 0)
    assert at[0] < -18e3
    assert np.sum(at > 30e3) >= 3
    few = points(BY_NAME["cycles: stiffness"], [np.array([float(n)]) for n in (0, 1, 1, 2)])
    np.testing.assert_array_equal(few, [0.0, 1.0, 2.0])
    assert points(BY_NAME["cycles: stiffness"], [np.zeros(1), np.ones(1)]) is None


@pytest.mark.parametrize("kink", [0.31, 0.85, 0.97])
def test_points_move_to_a_kink_and_still_cover_the_whole_range(kink):
    state, placed = BY_NAME["tip X, along X"], np.linspace(0.2, 1.0, 8)
    law, fine, at, errors = (lambda x: np.maximum(0.0, x - kink)), np.linspace(0.2, 1.0, 2000), placed, []
    for _ in range(4):
        errors.append(float(np.sqrt(np.mean((np.interp(fine, at, law(at)) - law(fine)) ** 2))))
        at = bent_points(state, placed, at, law(at))
    assert errors[-1] < errors[0] / 5
    assert (at[0], at[-1]) == (0.2, 1.0)
    # half of the points keep their original spread, so that no gap is much wider than two of the original ones
    assert np.max(np.diff(at)) < 2.1 * 0.8 / 7


@pytest.mark.parametrize(
    ("name", "law", "edges"),
    [
        ("tip X, along X", lambda x: -np.maximum(0.0, x - 0.87), [0.87]),
        ("tip X, along X", lambda x: np.maximum(0.0, x - 0.9) - 2 * np.maximum(0.0, 0.4 - x), [0.9, 0.4]),
        ("tip speed", lambda v: v - 2 * v**3, []),
        ("leak", lambda p: np.sign(p) * np.sqrt(np.abs(p)), []),
        ("clock over time", lambda t: np.clip((t - 0.53) / 0.016 + 0.5, 0, 1), [0.53]),
    ],
)
def test_a_table_for_a_formula_is_nearer_to_it_than_any_points_that_do_not_know_it(name, law, edges):
    state = BY_NAME[name]
    placed = np.geomspace(1 / 60, 1.0, 8) if state.odd else np.linspace(0.2, 1.0, 8)
    if state.zero:
        placed = np.array([-0.8, -0.4, -0.2, 0.0, 0.2, 0.4, 0.8, 1.0])
    at = formula_points(state, placed, law, edges)
    fine = np.linspace(0.0 if state.odd else placed[0], 1.0, 3000)

    def off(x):
        x = np.append(0.0, x) if state.odd else x
        return float(np.sqrt(np.mean((np.interp(fine, x, law(x)) - law(fine)) ** 2)))

    assert len(at) == 8
    assert np.all(np.diff(at) > 0)
    assert (at[0], at[-1]) == (placed[0], 1.0)
    assert not state.zero or 0.0 in at
    assert off(at) < off(placed) * (0.01 if edges else 0.8)
    if edges:
        np.testing.assert_array_equal(formula_points(state, at, law, edges), at)


def test_the_direction_in_which_a_pressure_moved_last_is_kept_while_it_rests():
    time_s = np.linspace(0, 6, 601)
    reading = np.interp(time_s, [0, 1, 2, 3, 4, 6], [0, 20e3, 20e3, 5e3, 5e3, 35e3])
    direction = last_direction(reading)
    at = np.interp([0.5, 1.5, 2.5, 3.5, 5.5], time_s, direction)
    np.testing.assert_allclose(at, [1.0, 1.0, -1.0, -1.0, 1.0], atol=1e-9)
    stuck = Instrument.of({"gauge_memory_pa@-1": 500.0, "gauge_memory_pa@1": -500.0})
    true = stuck.true_pressure(reading, time_s)
    np.testing.assert_allclose(np.interp([0.5, 3.5], time_s, true - reading), [500.0, -500.0], atol=1e-9)


def test_points_of_a_straight_curve_or_one_over_cycles_do_not_move():
    at = np.linspace(0.2, 1.0, 8)
    np.testing.assert_array_equal(bent_points(BY_NAME["tip X, along X"], at, at, 0 * at), at)
    cycles = np.arange(8.0)
    np.testing.assert_array_equal(bent_points(BY_NAME["cycles: channel"], cycles, cycles, cycles**2), cycles)


def test_a_curve_of_the_clock_is_cancelled_by_its_opposite():
    late = Instrument.of({"clock_curve_s@0": 0.0, "clock_curve_s@2": 0.04, "gauge_curve_pa@1000": 50.0})
    assert late.stamped(np.array([1.0])) == pytest.approx(1.02)
    np.testing.assert_allclose(late.true_time(late.stamped(np.array([0.5, 1.5]))), [0.5, 1.5], atol=1e-3)
    assert late.true_pressure(np.array([1000.0]), np.zeros(1)) == pytest.approx(950.0)


def test_a_curve_of_the_camera_moves_what_it_sees_and_so_do_its_derivatives():
    lens = Instrument.of(
        {"camera_x_m@0.01": 0.0, "camera_x_m@0.03": 2e-4, "camera_x_m@0.06": 8e-4, "camera_z_m@0.01": 0.0}
        | {"camera_z_m@0.06": -5e-4, "camera_roll_rad": 0.02, "length_scale": 0.01, "tip_offset_m": 1e-3}
    )
    pose, at_s = np.array([[0.02, 0.04, 0.07], [1e-3, -4e-3, -9e-3], [1.5, 1.6, 1.8]]), np.array([0.5, 1.0, 3.0])
    plain = Instrument(camera_roll_rad=0.02, length_scale=0.01, tip_offset_m=1e-3).seen(pose, at_s)
    excess = lens.seen(pose, at_s) - plain
    assert excess[0] == pytest.approx(np.interp(plain[0], [0.01, 0.03, 0.06], [0.0, 2e-4, 8e-4]))
    assert excess[1] == pytest.approx(np.interp(plain[0], [0.01, 0.06], [0.0, -5e-4]))
    _same_as_differences(lens, pose, at_s)


def test_a_camera_or_a_board_that_moves_in_its_mount_shifts_and_turns_what_is_seen_by_the_time():
    moves = Instrument.of(
        {"camera_x_wander_m@0": 0.0, "camera_x_wander_m@2": 4e-4, "camera_z_wander_m@0": 1e-4}
        | {"camera_roll_wander_rad@1": 0.0, "camera_roll_wander_rad@3": 0.02, "camera_roll_rad": 0.01}
        | {"tip_offset_m": 1e-3, "tip_offset_wander_m@1": 0.0, "tip_offset_wander_m@3": 5e-4}
    )
    pose, at_s = np.array([[0.02, 0.04, 0.07], [1e-3, -4e-3, -9e-3], [1.5, 1.6, 1.8]]), np.array([0.5, 1.0, 3.0])
    for k, (roll, off) in enumerate(((0.01, 1e-3), (0.01, 1e-3), (0.03, 1.5e-3))):
        turned = Instrument(camera_roll_rad=roll, tip_offset_m=off).seen(pose[:, k : k + 1], np.zeros(1))[:, 0]
        shift = [2e-4 * min(at_s[k], 2.0), 1e-4, 0.0]
        assert moves.seen(pose, at_s)[:, k] == pytest.approx(turned + shift)
    _same_as_differences(moves, pose, at_s)


def test_a_clamp_that_gives_way_turns_what_is_seen_by_how_far_out_the_tip_is():
    curve = {"camera_roll_curve_rad@0.02": 0.0, "camera_roll_curve_rad@0.08": 0.03}
    clamp = Instrument.of({**curve, "camera_roll_rad": 0.01})
    pose, at_s = np.array([[0.02, 0.05, 0.06], [1e-3, -4e-3, 5e-3], [1.5, 1.6, 1.7]]), np.zeros(3)
    for k, roll in enumerate((0.01, 0.025, 0.03)):
        turned = Instrument(camera_roll_rad=roll).seen(pose[:, k : k + 1], at_s[:1])
        assert clamp.seen(pose, at_s)[:, k] == pytest.approx(turned[:, 0])
    _same_as_differences(clamp, pose + 1e-3, at_s)


def _same_as_differences(camera: Instrument, pose: np.ndarray, at_s: np.ndarray) -> None:
    step, ways = 1e-7, np.random.default_rng(1).normal(size=(3, 3, 4)) * np.array([1.0, 1.0, 50.0])[:, None, None]
    ends = [[camera.seen(pose + sign * step * way, at_s) for sign in (1, -1)] for way in ways.transpose(2, 0, 1)]
    differences = np.stack([(high - low) / (2 * step) for high, low in ends], axis=2)
    np.testing.assert_allclose(camera.seen_tangent(pose, ways, at_s), differences, rtol=1e-4, atol=1e-6)


def test_deviations_are_those_of_the_inverse_and_finite_where_two_constants_are_nearly_degenerate():
    a = np.random.default_rng(2).normal(0, 1, (40, 5)) * [1e6, 1.0, 1e-3, 30.0, 1e4]
    assert deviations(a.T @ a) == pytest.approx(np.sqrt(np.diag(np.linalg.inv(a.T @ a))), rel=1e-6)
    b = np.column_stack([a, a[:, 0] + a[:, 1]])
    known = deviations(b.T @ b)
    assert np.all(np.isfinite(known))
    assert known[2:5] == pytest.approx(deviations(a.T @ a)[2:], rel=1e-3)
    assert known[0] > 1e3 * deviations(a.T @ a)[0]
