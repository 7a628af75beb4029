"""Steps integrate the whole pressure signal without an increase in their number."""

import numpy as np
import pytest

from straw.model.drive import FELT_S, SHORT_S, SHORTER, Table, seen, summed, summed_to
from straw.model.integrate import at_rest, integrate
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.model.scheme import COEFFICIENTS, TIMES
from straw.model.simulate import FIRST_STEP_S, MAX_STEP_S, MOST_STEPS_PER_S, TOLERANCE_M, sampled, simulate
from straw.model.terms.elasticity import elastic_force, softest

STEP_S = 2.5e-4


def noisy(rng, points=2000, sd_pa=100.0):
    return Table(-0.1, STEP_S, np.cumsum(rng.normal(0.0, sd_pa, points)))


def mean_pa(table, start_s, end_s):
    """Mean of the table between two times, on a grid so fine that kinks do not matter."""
    time_s = np.linspace(start_s, end_s, 20001)
    grid_s = table.start_s + table.step_s * np.arange(len(table.pressure_pa))
    pressure_pa = np.interp(time_s, grid_s, table.pressure_pa)
    return np.trapezoid(pressure_pa, time_s) / (end_s - start_s)


def missed_pa(table, start_s, step_s):
    """Error of a step's weighted stages in the table's impulse, over the longer of the step and FELT_S, Pa."""
    grid_s = table.start_s + table.step_s * np.arange(len(table.pressure_pa))
    stages_pa = np.interp(start_s + TIMES * step_s, grid_s, table.pressure_pa)
    impulse = (COEFFICIENTS[-1] @ stages_pa - mean_pa(table, start_s, start_s + step_s)) * step_s
    return abs(impulse) / max(step_s, FELT_S)


def test_the_sums_of_a_table_are_its_integral_also_beyond_its_ends():
    table = noisy(np.random.default_rng(1))
    sums = summed(table)
    assert summed_to(table, sums, -0.1) == 0.0
    for end_s in (-0.2, 0.03217, 0.2, 0.6):
        lasts_s = end_s + 0.1
        assert summed_to(table, sums, end_s) == pytest.approx(mean_pa(table, -0.1, end_s) * lasts_s, abs=1e-3 * lasts_s)


def test_a_step_is_limited_so_that_its_stages_sample_the_mean_pressure():
    rng = np.random.default_rng(2)
    shortened = 0
    for _ in range(50):
        table, start_s = noisy(rng), rng.uniform(0.0, 0.3)
        step_s = seen(table, summed(table), start_s, 0.02, 30.0)
        assert step_s <= SHORT_S or missed_pa(table, start_s, step_s) <= 30.0 * 1.01
        if step_s < 0.02:
            shortened += 1
            assert missed_pa(table, start_s, step_s / SHORTER) > 30.0 * 0.99
    assert shortened > 25


def test_a_steady_ramp_shortens_no_step():
    table = Table(0.0, STEP_S, np.linspace(0.0, 20e3, 2000))
    assert seen(table, summed(table), 0.1234, 0.02, 1e-3) == 0.02


def test_a_pulse_shorter_than_a_step_has_its_effect_wherever_it_falls():
    straw, time_s = StrawParameters(), np.linspace(0.0, 1.2, 1201)

    def swing_m(at_s, tolerance_m):
        predicted = simulate(
            straw,
            lambda t: np.where((t > at_s) & (t < at_s + 2e-3), 10e3, 0.0),
            time_s,
            (1, 4),
            tolerance_m=tolerance_m,
        )
        return np.ptp(predicted.x_m)

    truth = swing_m(0.5, TOLERANCE_M / 100)
    assert truth > 5 * TOLERANCE_M
    for at_s in np.arange(0.5, 0.53, 3e-3):  # a straw at rest takes steps of 20 ms
        assert abs(swing_m(at_s, TOLERANCE_M) - truth) < TOLERANCE_M


def test_noise_too_fast_for_the_straw_does_not_exhaust_the_allowed_steps():
    noise_pa = np.random.default_rng(3).normal(0.0, 300.0, 8001)
    time_s = np.linspace(0.0, 2.0, 481)
    predicted = simulate(StrawParameters(), lambda t: np.interp(t, np.arange(8001) * STEP_S, noise_pa), time_s, (1, 4))
    assert predicted.steps < 2.0 / SHORT_S
    assert 1 / SHORT_S < MOST_STEPS_PER_S


@pytest.mark.parametrize("swing_pa", [20.0, 200.0])
def test_flow_reversal_in_a_narrow_channel_makes_no_step_fail(swing_pa):
    # the loss grows with the flow squared: its slope at the start of a step is no estimate of its slope at the end
    straw, time_s = StrawParameters(r_ch_m=0.2e-3), np.linspace(0.0, 2.0, 3)
    table = sampled(lambda t: swing_pa * np.sin(2 * np.pi * 7 * t), time_s)
    q = rest_state(straw, (1, 4))
    state, counts = at_rest(straw.constants(), q, 0.0, 0.0, FIRST_STEP_S), np.zeros(4, np.int64)
    room = np.empty((3, len(q)))
    integrate(
        straw.constants(), state, table, time_s, 2.0, 1e-7, MAX_STEP_S, 1e4, room, room.copy(), np.empty(3), counts
    )
    taken, rejected = counts[:2]
    assert rejected <= 0.02 * taken


def test_the_softest_frustum_is_the_one_whose_force_rises_least_from_rest():
    straw = StrawParameters()
    c = straw.constants()

    def rise(zeta0, C1, C2):
        step = 1e-9
        up, down = (elastic_force(zeta0 + x, 0.0, zeta0, C1, C2, c.r_i)[0] for x in (step, -step))
        return (down - up) / (2 * step)

    even = [rise(c.zeta0[i, 1], c.C1[i, 1], c.C2[i, 1]) for i in range(c.cells)]
    assert softest(c) == pytest.approx(min(even), rel=1e-6)
    both = [rise(c.zeta0[i, 0], c.C1[i, 0], c.C2[i, 0]) for i in range(c.cells)] + even
    assert softest(straw.replace(form="full").constants()) == pytest.approx(min(both), rel=1e-6)
