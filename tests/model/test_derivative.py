"""Derivatives of a run by every constant of the straw and of every term, and by pressure, start and time.

Checked against central differences between runs that take the same steps, over a snap.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from straw.model.derivative import Derivatives, differentiate
from straw.model.direction import NUMBERS, Direction
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction, sampled, simulate
from straw.model.table import POINTS
from straw.model.term import Constant
from straw.model.terms import TERMS
from straw.model.typical import typical
from tests.model.held import Held

LIVELY = StrawParameters(cells=2, c_zeta_n_s_per_m=2.0, c_phi_n_m_s_per_rad=3e-3, r_ch_m=0.6e-3, F_X_n=0.2)
TIME_S = np.linspace(0.0, 0.12, 25)
#: So fine that the error of Newton's iteration in the run itself does not show in its derivatives.
TOLERANCE_M = 3e-11
CHANNELS = ("x_m", "z_m", "phi_rad", "pressure_pa", "volume_m3", "zeta_m", "frustum_phi_rad")
#: Required accuracy, as a share of the largest derivative of a channel of this unit.
WITHIN = 1e-5
#: Accuracy that the differences must have to be a valid reference; and one at which no better one is looked for.
KNOWN, SURE = 3e-4, WITHIN / 30
#: A very small volume of gas is compressed within one step: its pressure is linear in its volume only below 1e-11 m^3,
#: where steps are refused; at 1e-10 m^3 differences give the pressure to 6e-3, all else to 2e-5.
KNOWN_OF_GAS = 1e-2
#: The largest difference moves the frusta by this much; each further one by a third of the previous.
MOVED_M, STEPS = 1e-6, 10
#: No difference changes a constant by more than this share of its value, or of a typical value.
REACH = 0.1
#: Points and weights: central, and one-sided where the range ends. Both err to fifth order.
CENTRAL = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}
AHEAD = {0: -25 / 12, 1: 4.0, 2: -3.0, 3: 4 / 3, 4: -1 / 4}


def pressure(time_s: np.ndarray) -> np.ndarray:
    """Snaps the second cell within the run."""
    return 1e3 + 70e3 * (1 - np.exp(-60 * np.asarray(time_s)))


def differentiated(straw: StrawParameters, directions: list[Direction]) -> Derivatives:
    return differentiate(straw, pressure, TIME_S, (), directions, tolerance_m=TOLERANCE_M, cells=True)


def assert_true(
    got: Derivatives,
    column: int,
    play: Callable[[float], Prediction],
    what: str,
    room: float = np.inf,
    reach: float = np.inf,
) -> None:
    """Assert that the column is the derivative of ``play``'s runs by its argument; ``room`` below zero is allowed, and
    steps up to ``reach``.

    Differences are taken with steps of several sizes; the one that changes least with the size counts, and its change
    is its uncertainty (Ridders, Adv. Eng. Software 4, 75, 1982). Where that is far below what is asserted, smaller ones
    are not taken.
    """
    largest = min(MOVED_M / float(np.abs(got.zeta_m[..., column]).max()), reach)
    weights = CENTRAL if 2 * largest <= room else AHEAD
    sizes = {c: largest_of(got, column, c) for c in CHANNELS}
    differences: list[dict[str, np.ndarray]] = []
    for step in largest * 10 ** (-np.arange(STEPS) / 2):
        with suppress(ModelError):  # since a law can be stiff close to zero strength
            runs = {at: play(at * step) for at in weights}
            differences.append(
                {c: sum(weight * getattr(runs[at], c) for at, weight in weights.items()) / step for c in CHANNELS}
            )
        if len(differences) > 2 and all(best(differences, c)[0] <= SURE * sizes[c] for c in CHANNELS):
            break
    for channel in CHANNELS:
        unsure, want = best(differences, channel)
        off, size = np.abs(getattr(got, channel)[..., column] - want).max(), sizes[channel]
        known = KNOWN_OF_GAS if (what, channel) == ("trapped_gas.volume_m3", "pressure_pa") else KNOWN
        assert unsure <= known * size, f"{what}: {channel} is known to {unsure / size:.1e} only"
        doubt = 3 * unsure if unsure > SURE * size else 0.0  # none where the search ended early
        assert off <= WITHIN * size + doubt, f"{what}: {channel} off by {off / size:.1e} of {size:.3g}"


def largest_of(got: Derivatives, column: int, channel: str) -> float:
    """The largest derivative of the channels of this one's unit."""
    unit = channel.split("_")[-1]
    return float(max(np.abs(getattr(got, c)[..., column]).max() for c in CHANNELS if c.endswith(f"_{unit}")))


def best(differences: list[dict[str, np.ndarray]], channel: str) -> tuple[float, np.ndarray]:
    """The change of the difference that changes least with the step's size, and that difference."""
    tried = [d[channel] for d in differences]
    changes = [float(np.abs(a - b).max()) for a, b in itertools.pairwise(tried)]
    unsure, k = min((max(both), k) for k, both in enumerate(itertools.pairwise(changes), 1))
    return unsure, tried[k]


#: The drag of air moves a straw of two cells by less than Newton's error; that of water is large enough.
FELT = {"ambient_drag": {"fluid_kg_per_m3": 1000.0}}


def plausible(constant: Constant, strength: bool, random: np.random.Generator) -> float:
    """A value off its default that is valid in every law."""
    if strength:
        return typical(constant)
    return constant.default + 0.1 * random.uniform(0.5, 1.0) * (constant.high - constant.default)


def with_all(name: str) -> StrawParameters:
    """A straw in which every constant of a term has an effect. Tables are straight lines, as differences across a kink
    are inaccurate, and none of their points is where the run starts."""
    random, term = np.random.default_rng(3), TERMS[name]
    if not term.rising:
        values = {c.name: plausible(c, c.name in term.strengths, random) for c in term.constants} | FELT.get(name, {})
    else:
        values, names, default = {"amount": 1.0}, [c.name for c in term.constants], {c.name: c for c in term.constants}
        for points in term.rising:
            first = names.index(points[0])
            at = np.array([default[k].default for k in points])
            at[:-1] += 0.1 * np.diff(at)
            highs = np.array([default[k].high for k in names[first + POINTS : first + 2 * POINTS]])
            line = 0.05 * highs * (at / at[-1] if at[0] > 0 else 1 + 0.5 * at / np.abs(at).max())
            values |= dict(zip(names[first : first + 2 * POINTS], [*at, *line], strict=True))
    return replace(LIVELY, cycle=1.5).with_term(name, **values)


@pytest.mark.parametrize("name", list(TERMS))
def test_derivatives_by_every_constant_of_a_term_agree_with_differences(name: str) -> None:
    straw, term = with_all(name), TERMS[name]
    held = Held.of(straw, pressure, TIME_S, (), TOLERANCE_M)
    names = [c.name for c in term.constants]
    value = {c.name: straw.terms[name].get(c.name, c.default) for c in term.constants}
    got = differentiated(straw, [Direction.of(straw, f"terms.{name}.{k}") for k in names])
    if not term.rising:
        for column, constant in enumerate(term.constants):
            k = constant.name
            assert_true(
                got,
                column,
                lambda x, k=k: held.play(straw.with_term(name, **{k: value[k] + x}), pressure),
                f"{name}.{k}",
                room=value[k] if constant.low > 0 or k in term.strengths else np.inf,
                reach=REACH * abs(value[k]) if constant.low > 0 else np.inf,
            )
        return
    # tables: random directions through all of their points and values at once
    random = np.random.default_rng(5)
    for _ in range(2):
        share = random.normal(0, 1, len(names)) * np.array(
            [abs(value[c.name]) or 0.01 * c.high for c in term.constants]
        )
        way = sum(
            (float(x) * Direction.of(straw, f"terms.{name}.{k}") for x, k in zip(share, names, strict=True)),
            Direction.none(straw),
        )
        one = differentiated(straw, [way])

        def play(x: float, share: np.ndarray = share) -> Prediction:
            moved = {k: value[k] + x * by for k, by in zip(names, share, strict=True)}
            return held.play(straw.with_term(name, **moved), pressure)

        assert_true(one, 0, play, name, reach=0.004)  # points stay in order
        np.testing.assert_allclose(one.x_m[:, 0], got.x_m @ share, rtol=1e-7, atol=1e-7 * np.abs(one.x_m).max())


@pytest.mark.parametrize("name", [n for n in TERMS if not TERMS[n].rising])
def test_a_term_of_zero_strength_has_a_derivative_by_its_strength(name: str) -> None:
    """The first-order effect of a candidate law."""
    term, felt = TERMS[name], FELT.get(name, {})
    straw = LIVELY.with_term(name, **felt) if felt else LIVELY
    held = Held.of(straw, pressure, TIME_S, (), TOLERANCE_M)
    got = differentiated(straw, [Direction.of(straw, f"terms.{name}.{k}") for k in term.strengths])
    for column, k in enumerate(term.strengths):
        assert_true(
            got,
            column,
            lambda x, k=k: held.play(straw.with_term(name, **{k: x}), pressure),
            f"{name}.{k}",
            room=0.0,
            reach=REACH * typical(next(c for c in term.constants if c.name == k)),
        )


@pytest.mark.parametrize("form", ["truncated", "full"])
def test_derivatives_by_every_constant_of_the_straw_agree_with_differences(form: str) -> None:
    straw = LIVELY.replace(form=form, cycle=1.0).with_term("viscoelasticity", k1_n_per_m=200.0, tau_s=0.05)
    held = Held.of(straw, pressure, TIME_S, (), TOLERANCE_M)
    names = sorted(NUMBERS)
    got = differentiated(straw, [Direction.of(straw, name) for name in names])
    for column, name in enumerate(names):
        if name != "cycle":  # which affects terms only
            value = getattr(straw, name)
            play = lambda x, n=name, v=value: held.play(straw.replace(**{n: v + x}), pressure)  # noqa: E731
            assert_true(
                got, column, play, name, room=np.abs(value).min() or np.inf, reach=REACH * np.abs(value).min() or np.inf
            )


@pytest.mark.parametrize("name", ["E_pa", "h_m", "zeta0_m", "r_ch_m"])
def test_walls_by_finite_elements_have_derivatives_too(name: str) -> None:
    straw = LIVELY.replace(elasticity="shell")
    held, value = Held.of(straw, pressure, TIME_S, (), TOLERANCE_M), getattr(straw, name)
    got = differentiated(straw, [Direction.of(straw, name)])
    play = lambda x: held.play(straw.replace(**{name: value + x}), pressure)  # noqa: E731
    assert_true(got, 0, play, name, room=np.abs(value).min())


@pytest.mark.parametrize(("elasticity", "share"), [("equation 7", 0.0), ("equation 7", 0.4), ("shell", 0.0)])
def test_the_share_between_equation_7_and_finite_elements_has_a_derivative_at_both_ends(
    elasticity: str, share: float
) -> None:
    """As the diagnosis uses it: also at a share of zero, where there is no row to change."""
    straw = LIVELY.replace(elasticity=elasticity)
    start, end = (straw.with_term("wall_elasticity", share=share + x) for x in (0.0, 1e-3))
    held = Held.of(start, pressure, TIME_S, (), TOLERANCE_M)
    got = differentiated(start, [Direction.between(start, end, 1e-3)])
    play = lambda x: held.play(straw.with_term("wall_elasticity", share=share + x), pressure)  # noqa: E731
    assert_true(got, 0, play, elasticity, room=share, reach=REACH)


def test_a_constant_of_one_cell_or_frustum_is_differentiated_alone() -> None:
    straw = LIVELY.with_term("cohesion", force_n=2.0)
    held = Held.of(straw, pressure, TIME_S, (), TOLERANCE_M)
    whole, second, even, cohesion = differentiated(
        straw,
        [
            Direction.of(straw, "E_pa"),
            Direction.of(straw, "E_pa", cell=2),
            Direction.of(straw, "c_zeta_n_s_per_m", cell=1, frustum="even"),
            Direction.of(straw, "terms.cohesion.force_n", cell=2),
        ],
    ).x_m.T
    got = differentiated(straw, [Direction.of(straw, "terms.cohesion.force_n", cell=2)])
    assert_true(got, 0, lambda x: held.play(straw.with_term("cohesion", force_n=[2.0, 2.0 + x]), pressure), "cell 2")
    np.testing.assert_array_equal(got.x_m[:, 0], cohesion)
    assert np.abs(second).max() > 0
    assert np.abs(whole - second).max() > 0
    assert np.abs(even).max() > 0


def test_pressure_start_and_any_smooth_change_of_a_straw_have_derivatives() -> None:
    held = Held.of(LIVELY, pressure, TIME_S, (), TOLERANCE_M)
    start = np.array([1e-4, 0.0, 0.0, 0.02])

    def stretched(by: float) -> StrawParameters:
        return LIVELY.replace(r_i_m=LIVELY.r_i_m * (1 + by), r_o_m=LIVELY.r_o_m * (1 + by))

    directions = [
        Direction.driven(LIVELY, lambda t: np.ones_like(t), "offset_pa"),
        Direction.driven(LIVELY, pressure, "gain"),
        Direction.delay(LIVELY, pressure),
        Direction.started(LIVELY, start),
        Direction.between(stretched(-1e-6), stretched(1e-6), 2e-6),
    ]
    got = differentiated(LIVELY, directions)
    assert got.names == ("offset_pa", "gain", "delay_s", "start", "between")
    plays = [
        lambda x: held.play(LIVELY, lambda t: pressure(t) + x),
        lambda x: held.play(LIVELY, lambda t: pressure(t) * (1 + x)),
        lambda x: held.play(LIVELY, lambda t: pressure(t - x)),
        lambda x: held.play(LIVELY, pressure, x * start),
        lambda x: held.play(stretched(x), pressure),
    ]
    for column, play in enumerate(plays):
        assert_true(got, column, play, got.names[column])
    both = differentiated(LIVELY, [2 * directions[0] + directions[3]])
    np.testing.assert_allclose(both.x_m[:, 0], 2 * got.x_m[:, 0] + got.x_m[:, 3], atol=1e-9 * np.abs(both.x_m).max())


def test_the_prediction_is_that_of_simulate_to_the_last_bit_and_rates_are_its_slopes() -> None:
    fine_s = np.linspace(0.0, 0.12, 2401)
    plain = simulate(LIVELY, pressure, fine_s, ())
    got = differentiate(LIVELY, pressure, fine_s, (), [Direction.of(LIVELY, "E_pa")])
    for channel in CHANNELS:
        np.testing.assert_array_equal(getattr(plain, channel), getattr(got.prediction, channel))
    for channel in ("x_m", "z_m", "phi_rad", "volume_m3"):
        slope = np.gradient(getattr(plain, channel), fine_s)[5:-5]
        rate = getattr(got.by_time, channel)[5:-5]
        assert np.abs(slope - rate).max() < 0.05 * np.abs(rate).max()


def test_snaps_and_crossings_move_as_their_derivatives_say() -> None:
    held = Held.of(LIVELY, pressure, np.linspace(0.0, 0.12, 2401), (), TOLERANCE_M)
    got = differentiate(LIVELY, pressure, held.time_s, (), [Direction.of(LIVELY, "E_pa")], tolerance_m=TOLERANCE_M)
    step = 1e-4 * 0.92e9
    ends = [held.play(LIVELY.replace(E_pa=LIVELY.E_pa + s * step), pressure) for s in (-1, 1)]
    assert got.snaps
    for snap in got.snaps:
        moments = [_crossing_s(end.zeta_m[:, snap.cell - 1, 1], held.time_s, snap.time_s) for end in ends]
        assert snap.by[0] == pytest.approx((moments[1] - moments[0]) / (2 * step), rel=2e-3)
    level = float(got.prediction.x_m[0] + np.ptp(got.prediction.x_m) / 2)
    crossing = got.crossings("x_m", level)[0]
    moments = [_crossing_s(end.x_m - level, held.time_s, crossing.time_s) for end in ends]
    assert crossing.by[0] == pytest.approx((moments[1] - moments[0]) / (2 * step), rel=2e-3)


def _crossing_s(value: np.ndarray, time_s: np.ndarray, near_s: float) -> float:
    at = np.flatnonzero((value[1:] > 0) != (value[:-1] > 0))
    moments = time_s[at] - value[at] * (time_s[at + 1] - time_s[at]) / (value[at + 1] - value[at])
    return float(moments[np.abs(moments - near_s).argmin()])


def test_it_runs_in_another_process() -> None:
    table, direction = sampled(pressure, TIME_S), Direction.of(LIVELY, "E_pa")
    here = differentiate(LIVELY, table, TIME_S, (), [direction])
    with ProcessPoolExecutor(1) as pool:
        there = pool.submit(differentiate, LIVELY, table, TIME_S, (), [direction]).result()
    np.testing.assert_array_equal(here.x_m, there.x_m)


@pytest.mark.parametrize(
    ("name", "where", "message"),
    [
        ("E", {}, "unknown constant 'E'; known: E_pa"),
        ("terms.glue.force_n", {}, "unknown constant terms.glue.force_n; known: ambient_drag"),
        ("terms.cohesion.force", {}, "unknown constant terms.cohesion.force; known: force_n"),
        ("E_pa", {"cell": 3}, "E_pa of cell 3, which is not in a straw of 2 cells"),
        ("E_pa", {"frustum": "left"}, "E_pa of frustum 'left'; expected odd or even"),
        ("r_ch_m", {"cell": 1}, "r_ch_m is one number for the whole straw"),
        ("terms.line_lag.tau_s", {"cell": 1}, "terms.line_lag.tau_s is one number for the whole straw"),
    ],
)
def test_an_invalid_direction_is_named_in_the_error(name: str, where: dict, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        Direction.of(LIVELY, name, **where)


def test_a_direction_of_another_straw_is_refused() -> None:
    with pytest.raises(ModelError, match="of 3 cells, the straw has 2"):
        differentiated(LIVELY, [Direction.of(LIVELY.replace(cells=3), "E_pa")])
