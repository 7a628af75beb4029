"""What is worked out about a point of the search once for all runs."""

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.systems.straw.constants import base_unknowns
from straw.replay.diagnose.systems.straw.nearby import at_point, nearby

BASE = StrawParameters()


def test_runs_of_a_point_share_what_is_known_about_it_and_another_straw_does_not():
    unknowns = base_unknowns(BASE)
    about = nearby(BASE, unknowns, np.zeros(len(unknowns)))
    assert nearby(BASE, base_unknowns(BASE), np.zeros(len(unknowns))) is about
    assert nearby(BASE.replace(), unknowns, np.zeros(len(unknowns))) is not about
    assert nearby(BASE, unknowns, np.full(len(unknowns), 1e-9)) is not about
    straw, _ = at_point(BASE, unknowns, np.zeros(len(unknowns)))
    assert at_point(BASE, base_unknowns(BASE), np.zeros(len(unknowns)))[0] is straw
    assert at_point(BASE, unknowns, np.full(len(unknowns), 1e-9))[0] is not straw


def test_directions_are_derivatives_of_the_straws_constants_and_an_instruments_is_none():
    at = np.array([0.3, 0.01])
    scale = 0.1
    unknowns = (
        Unknown("straw.F_X_n", 0.02, kind="linear"),
        Unknown("instrument.clock_offset_s", scale, kind="linear"),
    )
    about = nearby(BASE, unknowns, at)
    force, clock = about
    assert force.direction is not None
    assert at_point(BASE, unknowns, at)[0].F_X_n == pytest.approx(0.006)
    assert np.max(np.abs(force.direction.scalars)) == pytest.approx(0.02, rel=1e-9)
    assert clock.direction is None
    late = (clock.above.stamped(np.zeros(1)) - clock.below.stamped(np.zeros(1))) / clock.step
    assert late == pytest.approx(scale, rel=1e-9)


def test_at_a_bound_one_side_is_the_point_itself():
    unknown = Unknown("straw.r_ch_m", 0.1, BASE.r_ch_m, "log", low=0.0)
    (beside,) = nearby(BASE, (unknown,), np.zeros(1))
    inner = nearby(BASE, (Unknown("straw.r_ch_m", 0.1, BASE.r_ch_m, "log"),), np.zeros(1))[0]
    assert beside.step == pytest.approx(inner.step / 2)
    assert beside.direction is not None
    assert inner.direction is not None
    np.testing.assert_allclose(beside.direction.scalars, inner.direction.scalars, rtol=1e-3)
