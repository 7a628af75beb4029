"""The diagnosis' verdict: probabilities from the misfit that each hypothesis leaves, and what they suffice to name."""

from __future__ import annotations

import pytest

from straw.replay.diagnose.judge import CALIBRATION, by_cause, decisive, surviving, weighed
from straw.replay.diagnose.settings import MOST_COUNTED, NAMED_ALONE
from straw.replay.diagnose.systems.straw.constants import MEASUREMENT
from straw.replay.diagnose.verdict import verdict_of


@pytest.mark.parametrize(("complete", "verdict"), [(0.6, "complete"), (0.45, "ambiguous")])
def test_the_model_is_called_complete_only_where_that_is_more_probable_than_not(complete, verdict):
    rest = {"cohesion": (1 - complete) / 2, "squeeze_film": (1 - complete) / 2}
    assert verdict_of({"complete": complete, **rest}, MEASUREMENT)[0] == verdict


@pytest.mark.parametrize(("unknown", "verdict"), [(0.6, "unknown_physics"), (0.45, "ambiguous")])
def test_a_cause_is_called_unknown_only_where_that_is_more_probable_than_not(unknown, verdict):
    rest = {"complete": (1 - unknown) / 2, "cohesion": (1 - unknown) / 2}
    said, causes = verdict_of({"unknown": unknown, **rest}, MEASUREMENT)
    assert said == verdict
    assert causes == (["unknown"] if verdict == "unknown_physics" else ["cohesion"])


def test_probabilities_are_summed_by_cause_and_the_smallest_sufficient_set_survives():
    probability = {"cohesion": 0.5, "cohesion+clock_offset": 0.3, "unknown": 0.18, "complete": 0.02}
    assert by_cause(probability) == pytest.approx({"cohesion": 0.8, "clock_offset": 0.3})
    assert surviving(probability) == ["cohesion", "cohesion+clock_offset", "unknown"]


def test_a_cause_whose_law_has_another_form_is_named_where_no_rival_explains_nearly_as_much():
    excess = {"complete": 1e6, "intrinsic_curvature": 1e4, "asymmetry": 4e5, "gauge_gain": 9e5}
    counts = {"intrinsic_curvature": 1, "asymmetry": 9, "gauge_gain": 1}
    assert verdict_of(weighed(excess, counts, MEASUREMENT), MEASUREMENT) == ("missing_physics", ["intrinsic_curvature"])
    assert (
        verdict_of(weighed(excess | {"intrinsic_curvature": 8e5, "asymmetry": 8e5}, counts, MEASUREMENT), MEASUREMENT)[
            0
        ]
        == "unknown_physics"
    )
    undecided = weighed(excess | {"asymmetry": 1e4}, counts | {"asymmetry": 1}, MEASUREMENT)
    assert undecided["asymmetry"] == undecided["intrinsic_curvature"] < NAMED_ALONE


def test_an_instrument_fault_that_leaves_as_much_as_a_law_is_less_probable_since_it_has_one_form_only():
    probability = weighed(
        {"complete": 1e6, "ambient_drag": 1e4, "gauge_gain": 1e4}, {"ambient_drag": 1, "gauge_gain": 1}, MEASUREMENT
    )
    assert probability["ambient_drag"] > probability["gauge_gain"]


def test_where_no_hypothesis_explains_much_the_cause_is_unknown_with_no_more_certainty_than_the_search_has():
    excess = {"complete": 40_000.0, "cohesion": 30_000.0, "asymmetry": 35_000.0, "gauge_gain": 39_000.0}
    probability = weighed(excess, {"cohesion": 6, "asymmetry": 9, "gauge_gain": 1}, MEASUREMENT)
    assert 0.8 < probability["unknown"] < 1 - CALIBRATION.missed + CALIBRATION.missed / 5
    assert sum(probability.values()) == pytest.approx(1.0)
    assert verdict_of(probability, MEASUREMENT) == ("unknown_physics", ["unknown"])


def test_a_cause_with_one_constant_that_gains_exactly_the_decisive_amount_is_as_probable_as_none():
    probability = weighed({"complete": decisive(), "line_lag": 0.0}, {"line_lag": 1}, ())
    assert probability["line_lag"] == pytest.approx(probability["complete"])


def test_a_pair_that_explains_what_neither_cause_explains_alone_is_named_rather_than_its_first_cause():
    excess = {"complete": 8e4, "trapped_gas": 3.1e4, "camera_roll": 5.4e4, "camera_roll+trapped_gas": 0.0}
    counts = {"trapped_gas": 1, "camera_roll": 1, "camera_roll+trapped_gas": 2}
    verdict, causes = verdict_of(weighed(excess, counts, MEASUREMENT), MEASUREMENT)
    assert (verdict, set(causes)) == ("missing_physics", {"trapped_gas", "camera_roll"})
    beside_noise = excess | {"trapped_gas": 60.0}  # which leaves nothing for a second cause
    assert verdict_of(weighed(beside_noise, counts, MEASUREMENT), MEASUREMENT) == ("missing_physics", ["trapped_gas"])


def test_a_second_cause_that_many_constants_could_imitate_counts_for_less_than_one_of_a_single_constant():
    """A wrong second cause explains what its constants span: of 4 directions, one of 8 constants nearly all."""
    excess = {"complete": 3.8e4, "asymmetry": 3.2e3, "asymmetry+poiseuille_loss": 0.0, "asymmetry+frustum_spread": 0.0}
    counts = {"asymmetry": 5, "asymmetry+poiseuille_loss": 6, "asymmetry+frustum_spread": 13}
    p = weighed(excess, counts, MEASUREMENT)
    # the sum of constants counts alike above MOST_COUNTED, so that this is the share of the misfit alone
    assert counts["asymmetry"] >= MOST_COUNTED
    share = 2 * CALIBRATION.scale / (2 * CALIBRATION.scale + 3.2e3)

    def by_chance(constants: float) -> float:
        beside = max(CALIBRATION.directions - constants, 1) / 2
        return CALIBRATION.second_chance + (1 - CALIBRATION.second_chance) * share**beside

    even = CALIBRATION.missed / (len(excess) + 1)  # with "unknown"
    ratio = (p["asymmetry+poiseuille_loss"] - even) / (p["asymmetry+frustum_spread"] - even)
    assert by_chance(8) > 10 * by_chance(1)
    # by the law of the true form; laws of another form have less to lose, and raise both
    assert 1.0 < ratio <= by_chance(8) / by_chance(1)
