"""A run simulated in stretches equals the run in one piece, and time at rest costs nothing."""

import numpy as np

from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.model.stretches import Stretch, simulate_stretches

EVERYTHING = (-np.inf, np.inf)


def pressure(time_s: np.ndarray) -> np.ndarray:
    """A fold at 0.5 s, and a small step 30 s later, each with the settling of a controller."""
    fold = -25e3 * -np.expm1(-50.0 * np.maximum(time_s - 0.5, 0.0))
    return fold + 5e3 * -np.expm1(-50.0 * np.maximum(time_s - 30.0, 0.0))


def test_the_motion_is_the_same_with_the_time_at_rest_left_out() -> None:
    straw, deployed = StrawParameters(), [1, 4]
    stretches = [Stretch(0.5, False), Stretch(30.0, True), Stretch(32.0, False)]
    long = simulate_stretches(straw, pressure, stretches, deployed, rate_hz=240.0, window_s=EVERYTHING)
    assert long.skipped_s > 15.0
    whole = simulate(straw, pressure, np.arange(0.0, 32.0, 1 / 240), deployed)
    # each of two runs with different steps is within 10 um and 0.3 mrad of the truth (test_simulate), so within twice
    # that of the other; STILL_M times the seconds left out is no more
    for name, close in (("x_m", 2e-5), ("z_m", 2e-5), ("phi_rad", 6e-4)):
        np.testing.assert_allclose(
            getattr(long, name), np.interp(long.time_s, whole.time_s, getattr(whole, name)), atol=close
        )
    assert len(long.time_s) < 0.5 * len(whole.time_s)
    part = simulate_stretches(straw, pressure, stretches, deployed, rate_hz=240.0, window_s=(30.0, 31.0))
    inside = (long.time_s >= 30.0) & (long.time_s < 31.0)
    np.testing.assert_allclose(part.x_m, long.x_m[inside], atol=1e-7)


def test_a_year_of_rest_is_simulated_at_once() -> None:
    stretches = [Stretch(0.5, False), Stretch(3e7, True), Stretch(3e7 + 1.0, False)]
    long = simulate_stretches(StrawParameters(), pressure, stretches, [1, 4], rate_hz=240.0, window_s=EVERYTHING)
    assert len(long.time_s) < 240 * 30
    assert long.time_s[-1] > 3e7
