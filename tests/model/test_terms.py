"""The contract of every term: no effect at zero strength, forces are derivatives of energies, friction dissipates."""

from __future__ import annotations

import numpy as np
import pytest

from straw.model.channel import channel_at_rest, channel_of, inside_pressure
from straw.model.constants import Constants
from straw.model.errors import ModelError
from straw.model.frusta import MEMORY_TERMS
from straw.model.kinematics import Chain, chain_of
from straw.model.load import no_load, project
from straw.model.motion import motion_of
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.model.simulate import simulate
from straw.model.straw import pressure_at
from straw.model.straw_file import straw_from_toml
from straw.model.term import Frustum, Term
from straw.model.terms import CAUSES, COLUMNS, TERMS
from straw.model.typical import typical, with_typical

FOLDING = StrawParameters()
DEPLOYMENT = FOLDING.replace(c_zeta_n_s_per_m=0.1, c_phi_n_m_s_per_rad=3e-3, r_ch_m=0.315e-3)
EVERY = pytest.mark.parametrize("name", list(TERMS))
FRUSTUM = [name for name, term in TERMS.items() if term.kind == "frustum"]


def constants_of(term: Term) -> np.ndarray:
    return np.array([typical(c) if c.name in term.strengths else c.default for c in term.constants])


def surrounded_by_water(straw: StrawParameters) -> StrawParameters:
    return straw.with_term("ambient_drag", fluid_kg_per_m3=1000.0)


def some_frusta(count: int) -> list[Frustum]:
    """Moving frusta, at random states of the range of a run."""
    random = np.random.default_rng(7)
    c = FOLDING.constants()
    own = (c.zeta0[0, 1], c.C1[0, 1], c.C2[0, 1], c.c_zeta[0, 1], c.c_phi[0, 1], c.r_i, c.r_o, 0.0)
    states = random.uniform([-2.8e-3, -0.25, -0.5, -5.0], [2.8e-3, 0.25, 0.5, 5.0], (count, 4))
    return [Frustum(*state, *own) for state in states]


@EVERY
def test_a_term_of_zero_strength_changes_nothing(name: str) -> None:
    term = TERMS[name]
    points = {point for table in term.rising for point in table}
    changed = FOLDING.with_term(
        name,
        **{
            c.name: 0.0 if c.name in term.strengths else (c.low + c.high) / 2
            for c in term.constants
            if c.name not in points
        },
    )
    time_s = np.linspace(0, 1.0, 241)
    base, same = (simulate(s, lambda t: -25e3 * (1 - np.exp(-50 * t)), time_s, [1, 4]) for s in (FOLDING, changed))
    np.testing.assert_array_equal(base.zeta_m, same.zeta_m)
    np.testing.assert_array_equal(base.pressure_pa, same.pressure_pa)


@EVERY
def test_a_term_of_plausible_strength_changes_a_validation_run(name: str) -> None:
    """By more than a camera's noise; drag only under water, as in air it moves the tip by about 2 um."""
    time_s = np.linspace(0, 3.0, 721)
    changes = []
    for straw, steady_pa, deployed in ((FOLDING, -25e3, [1, 4]), (DEPLOYMENT, 35e3, [2, 3, 5, 6, 7, 8, 9])):
        runs = [
            simulate(s, lambda t, p=steady_pa: p * (1 - np.exp(-50 * t)), time_s, deployed)
            for s in (straw, surrounded_by_water(with_typical(straw, TERMS[name])))
        ]
        changes.append(np.abs(runs[1].z_m - runs[0].z_m).max())
    assert max(changes) > 30e-6  # a camera resolves 5 to 30 um


@pytest.mark.parametrize("name", [n for n in FRUSTUM if TERMS[n].energy is not None])
def test_a_force_that_stores_energy_is_the_derivative_of_that_energy(name: str) -> None:
    term, k = TERMS[name], constants_of(TERMS[name])
    for f in some_frusta(50):
        force, moment = term.force(f, k)
        dz, df = 1e-7, 1e-5
        up, down = (term.energy(f._replace(zeta=f.zeta + s * dz), k) for s in (1, -1))
        assert force == pytest.approx(-(up - down) / (2 * dz), abs=1e-5 * (1 + abs(force)))
        up, down = (term.energy(f._replace(phi=f.phi + s * df), k) for s in (1, -1))
        assert moment == pytest.approx(-(up - down) / (2 * df), abs=1e-7 * (1 + abs(moment)))


@pytest.mark.parametrize("name", [n for n in FRUSTUM if TERMS[n].energy is None])
def test_a_force_without_stored_energy_only_dissipates(name: str) -> None:
    term, k = TERMS[name], constants_of(TERMS[name])
    for f in some_frusta(200):
        force, moment = term.force(f, k)
        assert force * f.d_zeta <= 0
        assert moment * f.d_phi <= 0


@pytest.mark.parametrize("name", MEMORY_TERMS)
def test_a_force_with_memory_never_returns_more_energy_than_it_received(name: str) -> None:
    """Along any motion from rest the work done against it stays positive, whatever the step."""
    term, k = TERMS[name], constants_of(TERMS[name])
    random = np.random.default_rng(3)
    base, step_s = some_frusta(1)[0], 1e-3
    zeta_n = phi_n_m = taken_j = 0.0
    for d_zeta, d_phi in np.cumsum(random.normal(0, (0.05, 0.5), (3000, 2)), axis=0):
        f = base._replace(d_zeta=d_zeta, d_phi=d_phi)
        zeta_n, phi_n_m = term.force(f, k, zeta_n, phi_n_m, step_s)
        taken_j += (zeta_n * d_zeta + phi_n_m * d_phi) * step_s
        assert taken_j >= 0
    assert taken_j > 0


def test_the_asymmetry_of_a_frustum_acts_between_its_wells_only() -> None:
    k = np.array([2e-3, 0.9, 0.0, 2.0])
    at = [frustum(zeta_m) for zeta_m in (-2.28e-3, -1e-3, 0.0, 2.2e-3)]
    moments = [TERMS["asymmetry"].force(f, k)[1] for f in at]
    assert moments[0] == moments[3] == 0.0
    assert moments[2] == -2e-3
    assert moments[1] == pytest.approx(-2e-3 * (1 - (1 / (0.9 * 2.28)) ** 2) ** 2)


def test_cohesion_is_largest_at_its_peak_and_each_cycle_weakens_it_less_than_the_previous_one() -> None:
    k = np.array([4.0, 0.2e-3, 0.5, 0.1e-3, 2.0, 1.0])
    pulls = [TERMS["cohesion"].force(frustum(-2.28e-3 + 0.1e-3, cycle), k)[0] for cycle in range(4)]
    assert pulls == pytest.approx([-4.0 / (1 + cycle) ** 0.5 for cycle in range(4)])
    assert TERMS["cohesion"].force(frustum(-2.28e-3), k)[0] == pytest.approx(-4.0 * np.exp(-1 / 8))
    steady = np.array([4.0, 0.2e-3, 0.5, 0.0, 0.0, 1.0])
    assert TERMS["cohesion"].force(frustum(-2.28e-3, 2), steady)[0] == pytest.approx(-4.0 * np.exp(-1.0))


def test_cohesion_that_rises_fast_is_narrow_below_its_peak_and_unchanged_beyond() -> None:
    even, steep = (np.array([4.0, 0.2e-3, 0.0, 0.1e-3, 0.0, rises]) for rises in (1.0, 0.25))
    below, beyond = (frustum(-2.28e-3 + 0.1e-3 + side * 0.05e-3) for side in (-1, 1))
    force = TERMS["cohesion"].force
    assert force(beyond, steep) == force(beyond, even)
    assert force(below, steep)[0] == pytest.approx(-4.0 * np.exp(-0.5))
    assert force(below, even)[0] == pytest.approx(-4.0 * np.exp(-0.5 / 16))


def test_cohesion_that_rises_fast_is_the_derivative_of_its_energy_on_both_sides_of_its_peak() -> None:
    term, k, step_m = TERMS["cohesion"], np.array([4.0, 0.2e-3, 0.0, 0.1e-3, 0.0, 0.25]), 1e-8
    for open_m in (0.0, 0.06e-3, 0.1e-3, 0.25e-3):
        up, down = (term.energy(frustum(-2.28e-3 + open_m + side * step_m), k) for side in (1, -1))
        assert term.force(frustum(-2.28e-3 + open_m), k)[0] == pytest.approx(-(up - down) / (2 * step_m), rel=1e-5)


def frustum(zeta_m: float, cycle: int = 0) -> Frustum:
    """An even frustum at rest."""
    return Frustum(zeta_m, 0.05, 0.0, 0.0, -2.28e-3, 1.0, 1.0, 0.0, 0.0, 8e-3, 14e-3, float(cycle))


def test_drag_dissipates_energy_in_any_motion() -> None:
    random = np.random.default_rng(5)
    straw = with_typical(FOLDING, TERMS["ambient_drag"])
    c = straw.constants()
    q = rest_state(straw, [1, 4])
    for _ in range(20):
        v = random.normal(0, 1, len(q)) * np.repeat([0.1, 1.0], 9)
        s, load, force = chain_of(c, motion_of(c, q, v, 0 * q)), no_load(9), np.empty_like(q)
        TERMS["ambient_drag"].force(c, constants_of(TERMS["ambient_drag"]), s, load)
        project(c, s, load, force)
        assert force @ v < 0


LEAKS = 4e-11  # m^3/s of water through the wall for each Pa inside


@pytest.mark.parametrize("leaks", [0.0, LEAKS])
@pytest.mark.parametrize("names", [["fluid_inertia"], ["poiseuille_loss"], ["line_lag"], ["trapped_gas"], list(CAUSES)])
def test_the_pressure_loss_of_the_inlet_follows_its_laws(names: list[str], leaks: float) -> None:
    """With a straw that takes in water at a given rate; the reference is the laws integrated by SciPy."""
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    straw = FOLDING
    for name in names:
        straw = with_typical(straw, TERMS[name]) if TERMS[name].kind == "flow" else straw
    if "trapped_gas" in names:
        straw = straw.with_term("trapped_gas", exponent=1.3)
    if leaks:
        pressures = np.linspace(-90e3, 90e3, 8)
        table = curve("pressure_{}_pa", pressures, "leak_{}_m3_per_s", leaks * pressures)
        straw = straw.with_term("missing_loss", amount=1.0, **table)
    w = channel_of(straw.constants())
    external, rate = 20e3, lambda t: 4e-6 * np.sin(40 * t)
    known, rest_pa = channel_at_rest(straw.constants(), external)

    def drives(t, y, flow):  # pressure that drives the flow through the channel, less what that loses
        reservoir = y[0] if w.lag_s > 0 else external
        return reservoir - w.resistance * flow - w.loss * flow * abs(flow)

    def inside_of(t, y):
        if w.gas_m3 > 0:
            return 101_325.0 * ((w.gas_m3 / y[2]) ** w.exponent - 1)
        if w.inertance > 0 and leaks:
            return (y[1] - rate(t)) / leaks
        return brentq(lambda p: drives(t, y, rate(t) + leaks * p) - w.inertance * d_rate(t) - p, -90e3, 90e3)

    def d_rate(t):
        return 4e-6 * 40 * np.cos(40 * t)

    def law(t, y):
        inside = inside_of(t, y)
        flow = rate(t) + leaks * inside
        if w.inertance > 0:
            flow = y[1] if w.gas_m3 > 0 or leaks else flow
        elif w.gas_m3 > 0:
            flow = _flow_at(w, (y[0] if w.lag_s > 0 else external) - inside)
        d_flow = (drives(t, y, flow) - inside) / w.inertance if w.inertance > 0 else 0.0
        return [_line(w, external, y[0], flow), d_flow, rate(t) + leaks * inside - flow]

    assert rest_pa == pytest.approx(known[0] - w.resistance * known[1] - w.loss * known[1] * abs(known[1]))
    assert known[1] == pytest.approx(leaks * rest_pa)
    end = 0.2
    tight = solve_ivp(law, (0, end), known, method="LSODA", rtol=1e-10, atol=[1e-4, 1e-14, 1e-18])
    now, known = known.copy(), known.copy()
    steps = 40_000
    for i in range(1, steps + 1):
        inside, slope = inside_pressure(w, known, end / steps, external, rate(i * end / steps), now)
        if i == steps // 3:
            here, small = rate(i * end / steps), 1e-10
            sides = [inside_pressure(w, known, end / steps, external, here + s, now.copy())[0] for s in (-small, small)]
            assert slope == pytest.approx((sides[1] - sides[0]) / (2 * small), rel=1e-4)
        known[:] = now
    assert inside == pytest.approx(inside_of(end, tight.y[:, -1]), abs=20.0)


def _line(w, external: float, reservoir: float, flow: float) -> float:
    return (external - reservoir) / w.lag_s - w.line_pa_per_m3 * flow if w.lag_s > 0 else 0.0


def _flow_at(w, drop: float) -> float:
    """Q with R Q + K Q|Q| = drop."""
    size = (-w.resistance + np.sqrt(w.resistance**2 + 4 * w.loss * abs(drop))) / (2 * w.loss)
    return float(np.sign(drop) * size)


def curve(at: str, where, value: str, values) -> dict[str, float]:
    """Constants of a table."""
    return {p.format(n): float(x) for p, row in ((at, where), (value, values)) for n, x in enumerate(row, 1)}


def test_a_table_is_linear_between_its_points_and_its_energy_the_area_below() -> None:
    where, values = np.array([-1.1, -1.0, -0.8, -0.3, 0.1, 0.2, 0.9, 1.2]), np.array([1, -2, 0, 3, 3, -1, 2, 0.5])
    turned, moments = np.linspace(-0.2, 0.25, 8), np.array([2, 1, 0, -1, 0, 3, 1, 1]) * 1e-3
    straw = FOLDING.with_term("missing_force", amount=1.0, **curve("height_{}", where, "force_{}_n", values))
    straw = straw.with_term("missing_force", **curve("angle_{}_rad", turned, "moment_{}_n_m", moments))
    term, k = TERMS["missing_force"], straw.constants().terms[0, 1, slice(*COLUMNS["missing_force"])]
    for f in some_frusta(40):
        force, moment = term.force(f, k)
        assert force == pytest.approx(np.interp(f.zeta / abs(f.zeta0), where, values))
        assert moment == pytest.approx(np.interp(f.phi, turned, moments))
        ends = [term.energy(f._replace(zeta=z, phi=0.0), k) for z in (-2e-3, f.zeta)]
        along = np.linspace(-2e-3, f.zeta, 20_001)
        work = np.trapezoid(np.interp(along / abs(f.zeta0), where, values), along)
        assert ends[0] - ends[1] == pytest.approx(work, abs=1e-7)
        odd = term.force(f._replace(zeta0=3.78e-3), k)
        assert odd == (0.0, 0.0)


def test_tables_over_speed_flow_and_the_tip_give_their_forces() -> None:
    speeds, forces = np.geomspace(0.01, 0.5, 8), np.array([1, 2, 2, 3, 5, 8, 13, 21]) * 0.1
    straw = FOLDING.with_term("missing_damping", amount=2.0, **curve("speed_{}_m_per_s", speeds, "force_{}_n", forces))
    k = straw.constants().terms[0, 1, slice(*COLUMNS["missing_damping"])]
    for f in some_frusta(40):
        f = f._replace(d_zeta=f.d_zeta / 2)
        want = 2 * np.interp(abs(f.d_zeta), [0, *speeds], [0, *forces]) * np.sign(f.d_zeta)
        assert TERMS["missing_damping"].force(f, k)[0] == pytest.approx(-want)
    flows, losses = np.linspace(-4e-6, 3e-6, 8), np.array([-9, -5, -2, -1, 0, 1, 4, 7]) * 1e3
    lossy = FOLDING.with_term("missing_loss", amount=1.0, **curve("flow_{}_m3_per_s", flows, "loss_{}_pa", losses))
    for flow in (-3e-6, -0.4e-6, 2.2e-6):
        v = np.zeros(18)
        v[0] = flow / FOLDING.constants().S
        change = pressure_at(FOLDING.constants(), v, 1e4) - pressure_at(lossy.constants(), v, 1e4)
        assert change == pytest.approx(np.interp(flow, flows, losses))
    along = FOLDING.with_term("missing_tip_force", amount=1.0, **{f"along_z_{n}_n": 0.02 for n in range(1, 9)})
    ends = [simulate(s, lambda t: 0 * t, np.array([0, 0.01]), [1, 4]) for s in (along, FOLDING.replace(F_Z_n=0.02))]
    assert ends[0].z_m[-1] == pytest.approx(ends[1].z_m[-1], abs=1e-7)


def bent_under_a_tip_force(straw: StrawParameters) -> tuple[Constants, np.ndarray, Chain, np.ndarray]:
    """A straw's constants, its coordinates where it rests bent, its bodies there, and the missing tip force on each
    coordinate."""
    c, k = straw.constants(), np.asarray(straw.constants().terms[0, 0, slice(*COLUMNS["missing_tip_force"])])
    q = rest_state(FOLDING, [1, 4, 6], 2e3) + np.repeat([0.0, 0.02], 9)
    s, load, force = chain_of(c, motion_of(c, q, 0 * q, 0 * q)), no_load(9), np.empty_like(q)
    TERMS["missing_tip_force"].force(c, k, s, load)
    project(c, s, load, force)
    return c, q, s, force


def test_a_force_over_how_far_aside_the_tip_is_and_a_moment_over_its_angle_do_the_work_of_their_tables() -> None:
    """Virtual work on a bent straw at rest: of the force by Z, of the moment by Phi."""
    aside, turning = np.array([3, 1, 2, 0, -1, -3, -2, -4]) * 1e-2, np.array([4, 3, 3, 1, 0, -2, -2, -5]) * 1e-3
    where, angles = np.linspace(-0.4, 0.4, 8), np.linspace(0.8, 2.4, 8)
    straw = FOLDING.with_term(
        "missing_tip_force",
        amount=2.0,
        **curve("z_{}", where, "aside_{}_n", aside),
        **curve("phi_{}_rad", angles, "turning_{}_n_m", turning),
    )
    c, q, s, force = bent_under_a_tip_force(straw)
    length = float(np.sum(straw.zeta0_m[:, 0] - straw.zeta0_m[:, 1]))
    z, phi = s.position[9, 1], s.tip_angle[0]
    assert abs(z) > 1e-3
    for n, step in enumerate(np.eye(len(q)) * 1e-7):
        ends = [chain_of(c, motion_of(c, q + sign * step, 0 * q, 0 * q)) for sign in (1, -1)]
        by = [
            (ends[0].position[9, 1] - ends[1].position[9, 1]) / 2e-7,
            (ends[0].tip_angle[0] - ends[1].tip_angle[0]) / 2e-7,
        ]
        work = 2 * np.interp(z / length, where, aside) * by[0] + 2 * np.interp(phi, angles, turning) * by[1]
        assert force[n] == pytest.approx(work, rel=1e-5, abs=1e-8)


def test_a_force_towards_a_point_does_the_work_of_its_table_over_the_distance_from_there() -> None:
    pull, away = np.array([5, 4, 3, 1, 0, -1, -2, -2]) * 1e-2, np.linspace(0.1, 1.2, 8)
    there = {"post_x": 0.9, "post_z": -0.4}
    straw = FOLDING.with_term("missing_tip_force", amount=1.0, **curve("far_{}", away, "pull_{}_n", pull), **there)
    c, q, _, force = bent_under_a_tip_force(straw)
    length = float(np.sum(straw.zeta0_m[:, 0] - straw.zeta0_m[:, 1]))

    def distance(at: np.ndarray) -> float:
        tip = chain_of(c, motion_of(c, at, 0 * q, 0 * q)).position[9]
        return float(np.hypot(*(tip - length * np.array([0.9, -0.4]))))

    for n, step in enumerate(np.eye(len(q)) * 1e-7):
        nearer = -(distance(q + step) - distance(q - step)) / 2e-7
        assert force[n] == pytest.approx(np.interp(distance(q) / length, away, pull) * nearer, rel=1e-5, abs=1e-8)


def test_a_stiffness_over_the_pressure_inside_is_that_of_the_modulus_and_grows_with_the_pressure() -> None:
    pressures = np.linspace(-35e3, 35e3, 8)
    stiffer = curve("pressed_{}_pa", pressures, "stiffer_{}", 2e-6 * pressures)
    straw = FOLDING.with_term("missing_force", amount=1.0, **stiffer)
    for pressure in (-8e3, 0.0, 12e3):
        worn = FOLDING.replace(E_pa=FOLDING.E_pa * np.array([1.0, 1 + 2e-6 * pressure]))
        assert rest_state(straw, [1, 4], pressure) == pytest.approx(rest_state(worn, [1, 4], pressure), abs=1e-9)
    assert np.abs(rest_state(straw, [1, 4], 12e3) - rest_state(FOLDING, [1, 4], 12e3)).max() > 1e-6


def test_a_stiffness_over_time_is_that_of_the_modulus_at_the_time_in_the_laboratory() -> None:
    """The second run begins 100 s after the zero of time, when the walls have 0.9 of their stiffness for good."""
    ages = np.array([0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 90.0])
    aged = FOLDING.with_term("missing_force", amount=1.0, **curve("at_{}_s", ages, "aged_{}", -0.1 * ages / 90))
    aged = aged.replace(zero_time_s=1.8e9)
    later, worn = aged.in_run(0, 1_800_000_100_000_000_000), FOLDING.replace(E_pa=FOLDING.E_pa * np.array([1.0, 0.9]))
    assert later.start_s == pytest.approx(100.0)
    time_s = np.linspace(0, 0.5, 121)
    drive = lambda t: -25e3 * (1 - np.exp(-50 * t))  # noqa: E731
    one, other = (simulate(straw, drive, time_s, [1, 4]) for straw in (later, worn))
    np.testing.assert_allclose(one.zeta_m, other.zeta_m, atol=1e-7)
    assert np.abs(one.zeta_m - simulate(aged, drive, time_s, [1, 4]).zeta_m).max() > 1e-5


def test_a_stiffness_over_time_changes_within_a_run() -> None:
    """Under a held pressure the straw follows the rest state of the moment's modulus, by damping over stiffness late:
    620 N s/m over some 10 kN/m, below 0.1 s."""
    ages = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
    aged = FOLDING.with_term("missing_force", amount=1.0, **curve("at_{}_s", ages, "aged_{}", -0.02 * ages))
    seen = simulate(aged, lambda t: np.full_like(np.asarray(t, dtype=float), -8e3), np.array([0.0, 3.0, 6.0]), [1, 4])
    rests = [
        rest_state(FOLDING.replace(E_pa=FOLDING.E_pa * np.array([1.0, share])), [1, 4], -8e3)[:9]
        for share in (1.0, 0.94, 0.88)
    ]
    in_three_s = np.abs(rests[2] - rests[1]).max()
    for k, rest in enumerate(rests):
        assert seen.zeta_m[k, :, 1] == pytest.approx(rest, abs=0.1 / 3 * in_three_s)


def test_a_straw_file_contains_its_terms() -> None:
    text = "[terms.cohesion]\nforce_n = 5.0\n[terms.frustum_spread]\nE_relative = [0, 0, 0, -0.1, 0, 0, 0, 0, 0]\n"
    straw = straw_from_toml(text)
    again = straw_from_toml(straw.to_toml())
    assert again.terms == straw.terms
    np.testing.assert_array_equal(again.constants().terms, straw.constants().terms)
    assert straw.constants().terms[3, :, slice(*COLUMNS["frustum_spread"])].min() == -0.1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[terms.glue]\nforce_n = 1.0", "unknown term 'glue'; known: ambient_drag"),
        ("[terms.cohesion]\nforce = 1.0", "unknown constant terms.cohesion.force; known: force_n"),
        ("[terms.cohesion]\nforce_n = [1.0, 2.0]", "terms.cohesion.force_n.*expected a number, 9 numbers or 9 pairs"),
        ("[terms.cohesion]\nforce_n = 'much'", "expected a number, 9 numbers or 9 pairs"),
        ("[terms.cohesion]\nrange_m = 0.0", "terms.cohesion.range_m = 0.0, expected above zero"),
        ("[terms.fluid_inertia]\ninertance_kg_per_m4 = -1.0", "expected zero or above"),
        ("[terms.line_lag]\ntau_s = [1, 1, 1, 1, 1, 1, 1, 1, 1]", "terms.line_lag.tau_s.*expected a number"),
        ("[terms.missing_force]\nheight_2 = 5.0", "terms.missing_force: height_1 to height_8 = .*, expected rising"),
        ("[terms]\ncohesion = 3", "terms.cohesion = 3, expected constants by name"),
        ("terms = 3", "terms = 3, expected tables"),
    ],
)
def test_an_invalid_term_is_named(text: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        straw_from_toml(text)
