"""The channel's radius from filling tests: a planted one lies inside its interval as often as stated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from straw.model.errors import ModelError
from straw.model.filling import COLUMNS, FillingTests, channel_radius, read_filling_tests

HEADER = ",".join(COLUMNS)


def planted(r_ch_m: float, scatter: float, seed: int, tests: int = 38) -> FillingTests:
    """Equation 2 solved for the time: dp = rho / (2 pi^2 r^4) (V / t)^2, with a relative scatter of the times."""
    pressure = np.linspace(5e3, 90e3, tests)
    time = 90e-6 * np.sqrt(1000.0 / (2 * np.pi**2 * r_ch_m**4 * pressure))
    noise = np.random.default_rng(seed).standard_normal(tests)
    return FillingTests(np.full(tests, 90e-6), pressure, time * (1 + scatter * noise))


def test_without_scatter_the_planted_radius_is_recovered_exactly() -> None:
    found = channel_radius(planted(0.315e-3, 0.0, 1))
    assert found.r_ch_m == pytest.approx(0.315e-3, rel=1e-12)
    assert found.exponent == pytest.approx(0.5, abs=1e-9)


def test_nineteen_of_twenty_intervals_contain_the_planted_radius() -> None:
    found = [channel_radius(planted(0.52e-3, 0.02, seed)) for seed in range(400)]
    held = np.mean([f.low_m <= 0.52e-3 <= f.high_m for f in found])
    assert held == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 400))
    free = [abs(f.exponent - 0.5) / f.exponent_sigma for f in found]
    assert np.mean(np.array(free) < 2) > 0.9


def test_the_shipped_sample_agrees_with_its_header_and_gives_the_papers_radius(repository: Path) -> None:
    tests = read_filling_tests(repository / "model" / "samples" / "filling.csv")
    pressure = np.repeat(np.linspace(5e3, 90e3, 19), 2)
    flow = np.pi * 0.52e-3**2 * np.sqrt(2 * pressure / 1000)
    time = 90e-6 / flow * (1 + 0.02 * np.random.default_rng(38).standard_normal(38))
    np.testing.assert_allclose(tests.pressure_difference_pa, pressure, atol=0.05)
    np.testing.assert_allclose(tests.filling_time_s, time, atol=0.0051)
    found = channel_radius(tests)
    assert found.low_m < 0.52e-3 < found.high_m
    assert round(found.r_ch_m * 1e3, 2) == 0.52


def test_wall_friction_shows_in_the_exponent() -> None:
    tests = planted(0.52e-3, 0.01, 3)
    slow = FillingTests(tests.volume_m3, tests.pressure_difference_pa, 3e6 / tests.pressure_difference_pa)
    assert channel_radius(slow).exponent == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no column volume_m3"),
        ("volume_m3,filling_time_s\n1,2\n", "no column pressure_difference_pa"),
        (f"{HEADER}\n9e-5,5e3,33\n9e-5,x,3\n", "line 3: not three numbers"),
        (f"# a\n{HEADER}\n9e-5,5e3,33\n9e-5,5e3\n", "line 4: not three numbers"),
        (f"{HEADER}\n9e-5,5e3,-33\n", "line 2: volume, pressure difference and time must be above zero"),
        (f"{HEADER}\n9e-5,nan,3\n", "line 2"),
    ],
)
def test_an_invalid_table_is_refused_with_its_line(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(ModelError, match=rf"t\.csv: .*{words}"):
        read_filling_tests(tmp_path / "t.csv")


def test_two_filling_tests_are_too_few() -> None:
    with pytest.raises(ModelError, match="three at least"):
        channel_radius(planted(0.52e-3, 0.0, 1, tests=2))
