"""Designing experiments: their expected information, protocols within limits, and what the command refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from straw.replay.cli import main
from straw.replay.diagnose.settings import SIMULATED_EVERY_S
from straw.replay.diagnose.systems.straw.experiment import Rated
from straw.replay.diagnose.systems.straw.menu import allowed, drawn, menu, varied, written
from straw.replay.diagnose.systems.straw.observation import REPEATABILITY_S
from straw.replay.diagnose.systems.straw.separation import STIFF_SD, separation, snap_scatter
from straw.replay.investigate.propose import extremes, openings
from straw.rig.limits import PressureLimits
from straw.rig.protocol_toml import protocol_from_toml

NARROW = PressureLimits(-18e3, 31e3, 40e3)


def told(separation: list[list[float]], probability: list[float]) -> float:
    protocol = protocol_from_toml(written(menu(9)[0]), "p")
    return Rated(protocol, np.array(separation), 0).information(probability)


def test_the_expected_information_lies_between_zero_and_the_entropy_of_the_hypotheses():
    even, far = [0.5, 0.5], [[0.0, 50.0], [50.0, 0.0]]
    assert told(far, even) == pytest.approx(np.log(2))
    assert told([[0.0, 0.0], [0.0, 0.0]], even) == pytest.approx(0.0)
    assert told(far, [0.9, 0.1]) == pytest.approx(-0.9 * np.log(0.9) - 0.1 * np.log(0.1))
    assert told([[0.0, np.nan], [np.nan, 0.0]], even) == pytest.approx(0.0)  # one of them cannot be simulated


def test_the_lower_bound_of_information_never_exceeds_the_information():
    """Mutual information of two normal distributions s sigma apart, integrated."""
    y = np.linspace(-12, 14, 20001)
    for s in (0.5, 1.0, 2.0, 4.0):
        a, b = (np.exp(-((y - m) ** 2) / 2) / np.sqrt(2 * np.pi) for m in (0.0, s))
        mixed = (a + b) / 2
        entropy = -np.trapezoid(mixed * np.log(np.maximum(mixed, 1e-300)), y)
        exact = entropy - 0.5 * np.log(2 * np.pi * np.e)
        bound = told([[0.0, s], [s, 0.0]], [0.5, 0.5])
        assert 0.3 * exact < bound <= exact + 1e-9


def snapping(late_s: float = 0.0, height_m: float = 0.01) -> np.ndarray:
    """Tip (3, n) of a run of 3 s whose frustum is bent from 1.0 to 1.3 s; the tip stays higher afterwards."""
    t = np.arange(0.0, 3.0, SIMULATED_EVERY_S) - late_s
    bent = 0.2 * (np.tanh((t - 1.0) / 0.01) - np.tanh((t - 1.3) / 0.01)) / 2
    return np.stack([0 * t, height_m * (1 + np.tanh((t - 1.15) / 0.03)) / 2, bent])


def test_predictions_that_snap_at_different_times_are_separated_by_the_time_not_by_the_height_of_the_snap():
    late_s = 8e-3
    apart = separation(snapping(), snapping(late_s), np.zeros(2))
    assert apart == pytest.approx(np.sqrt(2) * late_s / REPEATABILITY_S, rel=0.02)  # beginning and end are both late


def test_a_difference_of_shape_counts_once_in_each_interval_of_the_noise():
    """1 mm (17 sigma) in Z for the last 1.85 s, 18.5 intervals."""
    apart = separation(snapping(), snapping(height_m=0.011), np.zeros(2))
    assert apart == pytest.approx(1e-3 / 60e-6 * np.sqrt(18.5), rel=0.05)


def test_snap_times_that_differ_between_repeats_as_much_as_between_hypotheses_carry_little_information():
    late_s = 8e-3
    scatter_s = snap_scatter(snapping(), snapping(STIFF_SD * late_s))
    assert scatter_s == pytest.approx([late_s, late_s], rel=0.02)
    assert separation(snapping(), snapping(late_s), scatter_s) == pytest.approx(1.0, rel=0.05)


def test_a_run_whose_repeats_may_snap_or_not_has_no_scatter():
    still = np.zeros_like(snapping())
    assert snap_scatter(snapping(), still) is None
    assert len(snap_scatter(still, still)) == 0
    assert separation(still, still, np.zeros(0)) == 0.0


def test_designs_and_their_variations_are_within_the_limits_of_pressure_and_rate():
    rng = np.random.default_rng(0)
    for _ in range(200):
        choice = drawn(rng, 9, NARROW)
        for one in (choice, varied(choice, rng, NARROW)):
            protocol = protocol_from_toml(written(one, NARROW), "designed")
            protocol.check_limits(NARROW)
            assert protocol.initial_deployed == one.deployed


def test_the_menu_is_cut_to_the_limits_and_uses_ramps_where_the_rate_is_limited():
    within = [c for c in menu(9) if allowed(c, NARROW)]
    assert 0 < len(within) < len(menu(9))
    for choice in within:
        protocol_from_toml(written(choice, NARROW), choice.name).check_limits(NARROW)


def test_before_anything_is_known_one_run_in_each_direction_comes_first_and_none_twice():
    both = openings(9, PressureLimits(-40e3, 60e3), [])
    assert [one.why.split(":")[0] for one in both] == ["a first deployment", "a first folding"]
    again = openings(9, PressureLimits(-40e3, 60e3), [both[0].protocol])
    assert [one.why.split(":")[0] for one in again] == ["a first folding"]
    assert openings(9, PressureLimits(-5e3, 5e3), []) == []


def test_before_a_model_is_called_complete_both_directions_are_run_as_far_as_the_limits_allow():
    wide = PressureLimits(-40e3, 60e3)
    far = extremes(9, wide, [])
    assert ['name = "deploy-40kPa"' in far[0].protocol, 'name = "fold-30kPa"' in far[1].protocol] == [True, True]
    assert all(one.opening for one in far)
    assert [one.why for one in extremes(9, wide, [far[0].protocol])] == [far[1].why]
    assert extremes(9, wide, [one.protocol for one in far]) == []
    (only,) = extremes(9, NARROW, [openings(9, NARROW, [])[1].protocol])  # -18 kPa: -16 is the largest, and was run
    assert 'name = "deploy-30kPa"' in only.protocol
    assert extremes(9, PressureLimits(-5e3, 5e3), []) == []


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--emulate", "--certainty", "2"], "--certainty 2"),
        (["--emulate", "--rounds", "0"], "--rounds 0"),
        (["--emulate", "--without", "gremlins"], "no such cause"),
        (["--emulate", "--tolerance", "y=3"], "tolerance"),
        (["--port", "/dev/nothing"], "--specimen NAME"),
        (["--port", "/dev/nothing", "--fast"], "--fast and --twin belong to --emulate"),
        ([], "no rig"),
    ],
)
def test_what_cannot_be_investigated_is_refused_in_one_line_and_leaves_no_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    assert main(["investigate", str(tmp_path), *words]) == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.count("\n") == 1
    assert not [p for p in tmp_path.iterdir() if p.name != ".straw-runs.json"]


def test_without_anyone_to_approve_nothing_is_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a real rig whose cells must first be set by hand --yes does not suffice, and no port is opened."""
    from straw.replay.investigate import dry_run

    monkeypatch.setattr(dry_run, "predict_protocol", lambda *_: (_Still(), 240.0))
    words = ["investigate", str(tmp_path), "--port", "/dev/nothing", "--specimen", "s", "--yes", "5"]
    assert main(words) == 1
    assert '"reason": "refused"' in (tmp_path / "investigate-s.jsonl").read_text().splitlines()[-1]


class _Still:
    """A prediction in which nothing happens."""

    time_s, phi_rad = np.arange(0, 1, 1 / 240), np.zeros(240)


def test_a_folder_that_is_not_there_is_made_and_a_file_in_its_place_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--emulate", "--fast"]
    assert main(["investigate", str(tmp_path / "new" / "deep"), *words]) == 1  # no terminal to answer on
    assert (tmp_path / "new" / "deep" / "investigate-twin.jsonl").is_file()
    (tmp_path / "file").write_text("")
    capsys.readouterr()
    assert main(["investigate", str(tmp_path / "file"), *words]) == 2
    assert "is not a folder" in capsys.readouterr().err
