"""Which of several fitted laws is reported: none over time where another explains as much, and no form that the
recordings do not determine."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from straw.replay.diagnose.discover import choose
from straw.replay.diagnose.discover.choose import (
    apart,
    degenerate,
    distinguished,
    drifts,
    fitting,
    forms_of,
    of_note,
    rivals,
    same_channels,
    written,
)
from straw.replay.diagnose.discover.pick import elsewhere, picked
from straw.replay.diagnose.discover.said import partly
from straw.replay.diagnose.discover.screen import Candidate, told_ahead
from straw.replay.diagnose.systems.function.codes import CHANNEL, CLOCK, FACTOR, OF_INPUT, OF_STATE, OF_TIME, RATE
from straw.replay.diagnose.systems.function.laws import Law, Place, State
from straw.replay.diagnose.systems.function.recording import HeldOut
from straw.replay.diagnose.systems.function.shapes import (
    CONSTANT,
    CUBE,
    FADES,
    LINEAR,
    POWER,
    QUADRATIC,
    SATURATES,
    SHAPES,
    SIGN,
    SQUARE,
    TABLE,
)

LEAK = Place(RATE, 0, "rate:p", "the rate of the pressure", "bar/s", 1.0)
SENSOR = Place(CHANNEL, 0, "channel:p", "the reading of the pressure", "bar", 1.0)
PRESSURE = State(OF_STATE, 0, "the pressure", "bar", 1.0, 7.0)
TIME = State(OF_TIME, 0, "time", "s", 0.0, 100.0)


def trial(law: Law, *errors: float, fit: Any = None, to_noise: bool = False, worth: float | None = None) -> Any:
    """A fit with its squared errors by block, of ten independent samples each."""

    def evidence(worth: float) -> float:
        return worth * float(np.log(sum(errors)))

    total, worth = float(sum(errors)), worth or 10.0 * len(errors)
    return SimpleNamespace(
        laws=(law,), error=np.array(errors), predicts=total, worth=worth, evidence=evidence, fit=fit, to_noise=to_noise
    )


def test_a_law_over_a_state_comes_before_a_drift_from_which_it_cannot_be_distinguished():
    leak, drift = trial(Law(LEAK, PRESSURE, LINEAR), 1.0, 3.0, 2.0), trial(Law(SENSOR, TIME, POWER), 2.0, 0.5, 2.1)
    assert written([drift, leak]) == [leak, drift]


def test_a_drift_that_explains_more_in_every_block_comes_first():
    leak, drift = trial(Law(LEAK, PRESSURE, LINEAR), 9.0, 8.0, 9.0), trial(Law(SENSOR, TIME, POWER), 1.0, 1.1, 0.9)
    assert written([leak, drift]) == [drift, leak]


def test_a_clock_that_wanders_over_time_is_no_drift():
    clock = Place(CLOCK, 0, "clock:p", "the clock of the pressure", "s", 1.0)
    assert drifts(Law(SENSOR, TIME, LINEAR))
    assert not drifts(Law(clock, TIME, LINEAR))


def test_other_forms_of_a_law_that_explain_as_much_are_named_and_no_others():
    def law(shape: int, state: State = PRESSURE, at: tuple[float, ...] = ()) -> Law:
        return Law(LEAK, state, shape, at)

    found = trial(law(LINEAR), 1.0, 1.2, 0.9)
    every = [
        found,
        trial(law(CUBE), 1.1, 1.1, 1.0),
        trial(law(SQUARE), 9.0, 8.0, 9.0),  # clearly worse
        trial(law(POWER, TIME), 1.0, 1.2, 0.9),  # over something else
        trial(law(TABLE, at=(1.0, 4.0, 7.0)), 1.0, 1.2, 0.9),  # no formula
    ]
    assert forms_of(found, every) == [every[1]]
    assert forms_of(every[-1], every) == []


def test_a_form_that_is_far_worse_in_one_block_only_is_no_other_form():
    """No difference of blocks shows it: all of it is in one; but it leaves twenty times the error."""
    found, poor = trial(Law(LEAK, PRESSURE, LINEAR), 1.0, 1.0, 1.0), trial(Law(LEAK, PRESSURE, CUBE), 1.0, 1.0, 58.0)
    slightly = trial(Law(LEAK, PRESSURE, SIGN), 1.0, 1.0, 1.2)
    assert forms_of(found, [found, poor, slightly]) == [slightly]


def test_a_law_that_leaves_twice_the_error_is_no_rival_though_one_block_has_all_of_it():
    found, poor, near = (trial(Law(LEAK, PRESSURE, LINEAR), *errors) for errors in ((1, 1, 1), (1, 1, 18), (1, 1, 4)))
    assert apart(poor, found)
    assert not apart(near, found)


def test_a_law_over_the_rate_of_an_input_is_told_from_a_delay_by_twice_the_error_only():
    fast = State(OF_INPUT, 1, "the rate of the near pressure", "bar/s", 0.0, 100.0)
    clock = Place(CLOCK, 0, "clock:p", "the clock of the pressure", "s", 0.1)
    law, late, far = (
        trial(Law(*what), *errors)
        for what, errors in (
            ((LEAK, fast, LINEAR), (1.0, 1.0, 1.0)),
            ((clock, TIME, LINEAR), (1.5, 1.5, 1.5)),
            ((clock, TIME, LINEAR), (9.0, 9.0, 9.0)),
        )
    )
    assert apart(late, law)
    assert not distinguished(late, law, inputs=1)  # of one input the second row is its rate
    assert distinguished(far, law, inputs=1)
    assert distinguished(late, law, inputs=2)  # where it is another input


@pytest.mark.parametrize(("exponent", "named"), [(2.03, ()), (2.2, ("power",))])
def test_one_form_written_twice_is_not_named_as_another(exponent, named, monkeypatch):
    """A square with sign of a pressure that is never negative; a power whose exponent is two within its deviation."""
    monkeypatch.setattr(choose, "covariance_of", lambda trial: np.diag([1.0, 0.02**2]))
    power = Law(LEAK, PRESSURE, POWER)
    unknowns = power.unknowns(0)
    at = SimpleNamespace(unknowns=unknowns, u=np.array([0.0, np.log(exponent / 1.5) / unknowns[1].scale]))
    assert unknowns[1].value(float(at.u[1])) == pytest.approx(exponent)
    square, signed = (trial(Law(LEAK, PRESSURE, shape), 1.0, 1.2, 0.9) for shape in (QUADRATIC, SQUARE))
    others = forms_of(square, [square, signed, trial(power, 1.0, 1.1, 0.9, fit=at)])
    assert tuple(SHAPES[one.laws[-1].shape].name for one in others) == named
    both = replace(PRESSURE, low=-1.0)
    square, signed = (trial(Law(LEAK, both, shape), 1.0, 1.2, 0.9) for shape in (QUADRATIC, SQUARE))
    assert forms_of(square, [square, signed]) == [signed]


@pytest.mark.parametrize(("also", "rival"), [((4.0, 0.1), False), ((0.2, 4.0), True)])
def test_what_explains_another_channel_is_no_rival(also, rival):
    current, accepted, other = (SimpleNamespace(squared=np.array(s)) for s in ((4.0, 4.0), (0.1, 4.0), also))
    assert same_channels(other, accepted, current) == rival


def test_the_same_law_over_history_and_an_equation_over_time_are_no_rivals_but_a_drift_of_the_sensor_is():
    law, late = Law(LEAK, PRESSURE, LINEAR), Law(LEAK, replace(PRESSURE, lag_s=2.0), CUBE)
    assert not rivals(late, law)
    assert not rivals(law, law)
    assert not rivals(Law(LEAK, TIME, LINEAR), law)
    assert rivals(law, late)
    assert rivals(Law(SENSOR, TIME, LINEAR), law)
    assert rivals(Law(SENSOR, PRESSURE, LINEAR), law)


def test_a_law_over_history_is_fitted_from_its_best_lag_and_beside_the_one_over_the_state():
    def candidate(state: State, leaves: float) -> Candidate:
        return Candidate(Law(LEAK, state, LINEAR), leaves, np.zeros(1))

    late, later = (replace(PRESSURE, lag_s=lag, longest_s=100.0) for lag in (2.0, 5.0))
    promised = [candidate(later, 0.2), candidate(late, 0.3), candidate(TIME, 0.5), candidate(PRESSURE, 1.1)]
    assert picked(promised) == [promised[0], promised[3], promised[2]]


def test_the_fitted_readings_determine_no_law_over_time_at_later_times():
    assert not told_ahead(Law(SENSOR, TIME, LINEAR), HeldOut("after"))
    assert told_ahead(Law(SENSOR, TIME, LINEAR), HeldOut("between"))
    assert told_ahead(Law(LEAK, PRESSURE, LINEAR), HeldOut("after"))


def test_a_curve_that_fits_but_does_not_predict_is_a_place_to_try_formulas_and_one_that_does_not_fit_is_none():
    def fit(evidence: float, predicts: float) -> Any:
        return SimpleNamespace(worth=40.0, predicts=predicts, evidence=lambda worth: evidence * worth / 40.0)

    base = fit(0.0, 45.0)
    bends, ahead, noise = fit(-170.0, 97.0), fit(-120.0, 12.0), fit(-8.0, 1.0)
    assert fitting([noise, ahead, bends], base) == [bends, ahead]


def test_a_saturation_far_beyond_what_was_visited_is_a_degenerate_form_of_a_line():
    """It has a constant more, or one at its bound; whether it is the same curve is asked of the equations."""
    line, saturating, square = (Law(LEAK, PRESSURE, shape) for shape in (LINEAR, SATURATES, SQUARE))

    def fitted(law: Law, *u: float) -> Any:
        return trial(law, 1.0, 1.0, 1.0, fit=SimpleNamespace(unknowns=law.unknowns(0), u=np.array(u)))

    found = fitted(line, 0.1)
    assert degenerate(fitted(saturating, 0.1, 0.0), found)
    assert not degenerate(fitted(square, 0.1), found)
    knee = saturating.unknowns(0)[1]
    assert degenerate(fitted(saturating, 0.1, knee.high), fitted(saturating, 0.1, 0.0))
    assert not degenerate(fitted(saturating, 0.1, 0.0), fitted(saturating, 0.1, 0.1))


def test_what_is_like_the_best_law_is_tried_too():
    """Over its state at other places, and at its place over states that promise nearly as much."""
    sensor, leak, over_time, drift = (
        Candidate(Law(place, state, LINEAR), leaves, np.zeros(1))
        for place, state, leaves in (
            (SENSOR, PRESSURE, 0.5),
            (LEAK, PRESSURE, 0.7),
            (LEAK, TIME, 0.6),
            (SENSOR, TIME, 0.9),
        )
    )
    assert elsewhere(sensor.law, [sensor, over_time, leak, drift], [sensor]) == [leak]
    near = replace(drift, leaves=0.52)
    assert elsewhere(sensor.law, [sensor, near, over_time, leak], [sensor]) == [near, leak]


def test_a_drift_counts_where_it_halves_the_error_and_another_law_by_a_tenth():
    base = trial(Law(LEAK, PRESSURE, LINEAR), 10.0, 10.0, 10.0)
    assert of_note(trial(Law(LEAK, PRESSURE, SQUARE), 5.0, 5.0, 5.0), base)
    assert not of_note(trial(Law(LEAK, TIME, SQUARE), 5.0, 5.0, 5.0), base)
    assert of_note(trial(Law(LEAK, TIME, SQUARE), 2.0, 2.0, 2.0), base)


def test_forms_are_told_apart_by_schwarzs_criterion_where_one_leaves_no_more_than_noise():
    """Of two that predict nearly as well the shorter is reported, unless the longer explains what it cannot."""
    short, right = Law(LEAK, PRESSURE, LINEAR), Law(LEAK, PRESSURE, FADES)
    fits = trial(short, 1.2, 1.2, 1.2), trial(right, 1.0, 1.0, 1.0)
    assert written(fits)[0].laws[-1].shape == LINEAR
    to_noise = fits[0], trial(right, 1.0, 1.0, 1.0, to_noise=True)
    assert written(to_noise)[0].laws[-1].shape == LINEAR
    far = trial(short, 1.2, 1.2, 1.2, worth=300.0), trial(right, 1.0, 1.0, 1.0, to_noise=True, worth=300.0)
    assert written(far)[0].laws[-1].shape == FADES


@pytest.mark.parametrize(("after", "part"), [(0.5, True), (0.35, True), (0.3, False), (0.12, False)])
def test_a_law_that_leaves_a_third_of_the_error_and_many_times_the_noise_explains_a_part(after, part):
    held = np.array([1.0]), np.array([after])
    found = SimpleNamespace(held=held, noise=np.array([0.05]), accepted=[object()])
    assert partly(SimpleNamespace(discovery=found)) is part
    found.noise = np.array([0.15])
    assert partly(SimpleNamespace(discovery=found)) is False


@pytest.mark.parametrize(("strength", "outside"), [(0.5, False), (1.5, True)])
def test_a_factor_that_leaves_a_constant_within_its_range_is_no_law(strength, outside):
    gain = Law(Place(FACTOR, 0, "constant:g", "the gain", "1", 0.3), PRESSURE, CONSTANT)
    base, better = trial(Law(LEAK, PRESSURE, LINEAR), 9.0, 9.0, 9.0), trial(gain, 1.0, 1.0, 1.0)
    model = SimpleNamespace(constants=(SimpleNamespace(low=0.5, high=2.0),))
    better.system = SimpleNamespace(model=model, constants=lambda values: np.array([1.0]))
    better.values = {"law.0.strength": strength}
    assert of_note(better, base) is outside
