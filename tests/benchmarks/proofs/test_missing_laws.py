"""Laws that the library does not hold, found from runs of the independent apparatus, with their place and formula."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import fitted
from straw.replay.diagnose.systems.straw.constants import base_unknowns
from straw.replay.diagnose.systems.straw.missing import missing_force
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.states import STATES
from straw.replay.diagnose.systems.straw.system import StrawSystem
from tests.apparatus.campaign import NONE, campaign
from tests.apparatus.effects import Cause
from tests.replay.test_missing import BASE, BY_NAME


def searched(runs, states):
    """The laws found over these states beside a base of channel and damping."""
    with ThreadPoolExecutor() as pool:
        here, base = Campaign([observe(run) for run in runs], StrawSystem(BASE), pool), base_unknowns(BASE)[:3]
        return missing_force(here, fitted(here, base, np.zeros(len(base)), rounds=5), states=states)


def test_a_stop_is_found_where_it_is_with_its_stiffness_though_points_of_its_curve_lie_beside_it():
    """In one run; `tests.benchmarks.missing_force` has six."""
    runs = campaign((Cause("unknown", 1e-3, "board against a stop", 1),), 3, ("deploy-35kPa-1",), NONE)
    found = searched(runs, [BY_NAME["tip X, along X"]])
    law = found[-1].laws[0].formula
    assert law is not None
    (stop,) = law.atoms
    assert stop.shape is not None
    assert stop.shape.value == pytest.approx(51e-3, abs=max(3 * stop.shape.sigma, 0.05e-3))
    assert law.coefficients[0] == pytest.approx(-800.0, abs=max(3 * float(law.sigmas[0]), 8.0))


def test_a_gauge_that_saturates_is_found_as_an_error_over_its_reading_with_its_size():
    runs = campaign((Cause("unknown", 4e3, "gauge saturates", 1),), 3, ("fold-25kPa", "deploy-35kPa-1"), NONE)
    found = searched(runs, [BY_NAME["gauge over pressure"], BY_NAME["tip X, along Z"]])
    assert found[-1].curve.state.name == "gauge over pressure"
    assert found[-1].explains > 0.8
    law = found[-1].laws[0]
    # it reads 31 kPa at 35 kPa, and -21 kPa at -25 kPa
    wrong = np.interp([31e3, 0.0, -21e3], law.at, law.values)
    assert wrong[0] - wrong[1] == pytest.approx(-4e3, rel=0.4)
    assert wrong[2] - wrong[1] == pytest.approx(4e3, rel=0.4)
    assert law.formula is not None
    assert law.formula.keeps > 0.95
    assert found[-1].model.formulas
    told = found[-1].as_json()
    assert len(told["curve"]) == len(law.at)
    assert told["formula"]["text"].startswith("error(p) = ")


def test_a_magnet_is_found_where_it_is_with_its_law_over_the_distance():
    """Planted: 0.1 N (10 mm)^2 / (r^2 + (2 mm)^2) from (55, -12) mm. The 2 mm are 5 % of the force, or 0.2 mm of place,
    at the 9 mm that the tip comes near; 1 % of the straw's length, as its geometry is held, is 0.5 mm."""
    runs = campaign((Cause("unknown", 0.1, "magnet near the tip", 1),), 3, ("deploy-35kPa-1",), NONE)
    near = [state for state in STATES if state.name == "tip distance"][2]
    law = searched(runs, [near])[-1].laws[0]
    (_, x_m, _), (_, z_m, _) = law.further
    assert (x_m, z_m) == pytest.approx((55e-3, -12e-3), abs=0.8e-3)
    assert law.formula is not None
    r = np.array([9e-3, 12e-3, 18e-3])
    np.testing.assert_allclose(law.formula.of(r), 0.1 * 1e-4 / (r**2 + 4e-6), atol=0.1 * 0.12)
    assert set(law.as_json()["point"]) == {"X", "Z"}
