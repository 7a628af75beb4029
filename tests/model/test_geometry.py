"""Constants from lengths and snap pressures: the paper's from the paper's readings, and planted ones recovered."""

from __future__ import annotations

import numpy as np
import pytest

from straw.model.errors import ModelError
from straw.model.geometry import Readings, identify_geometry
from straw.model.parameters import StrawParameters
from straw.model.snap import snap_pair

STRAW = StrawParameters()


def test_the_papers_readings_give_the_papers_constants_to_the_last_digit() -> None:
    found = identify_geometry(Readings(1.5e-3, 5.8e-3, -13.5e3, 22.5e3), STRAW)
    assert round(found.zeta01_m * 1e3, 2) == 3.78
    assert round(found.zeta02_m * 1e3, 2) == -2.28
    assert round(found.h_m * 1e3, 3) == 0.508
    assert round(found.E_pa / 1e9, 2) == 0.92


@pytest.mark.parametrize("held", [True, False])
def test_a_planted_straw_is_recovered_from_its_readings(held: bool) -> None:
    """Lengths from the roots of equation 6a by hand; pressures from the statics, which are tested elsewhere."""
    zeta0, h, E = np.array([4.1e-3, -2.4e-3]), 0.45e-3, 1.3e9
    straw = STRAW.replace(zeta0_m=zeta0, h_m=np.array(h), E_pa=np.array(E), cells=4)
    c = straw.constants()
    roots = np.roots([8 * c.C1[0, 1], 0, 2 * c.C2[0, 1] - 8 * c.C1[0, 1] * zeta0[1] ** 2, -2 * c.C2[0, 1] * zeta0[1]])
    down, up = snap_pair(straw, 1, held=held)
    readings = Readings(zeta0.sum(), zeta0[0] + roots.real.max(), down.pressure_pa, up.pressure_pa)
    found = identify_geometry(readings, STRAW.replace(cells=4), held=held)
    assert found.zeta01_m == pytest.approx(4.1e-3, rel=1e-4)
    assert found.zeta02_m == pytest.approx(-2.4e-3, rel=1e-4)
    assert found.h_m == pytest.approx(h, rel=1e-3)
    assert found.E_pa == pytest.approx(E, rel=1e-3)


def test_sigmas_agree_with_the_scatter_of_readings_within_their_resolution() -> None:
    """Pressures alone, which dominate in h and E. A sigma from 9 draws is itself known to 1 / sqrt(2 * 8) = 25 %."""
    straw = STRAW.replace(cells=1)
    best = Readings(1.5e-3, 5.8e-3, -13.5e3, 24e3, length_resolution_m=0.0)
    stated = identify_geometry(best, straw)
    rng = np.random.default_rng(1)
    draws = [
        identify_geometry(Readings(1.5e-3, 5.8e-3, -13.5e3 + a, 24e3 + b, 0.0), straw)
        for a, b in rng.uniform(-250, 250, (9, 2))
    ]
    assert np.std([d.h_m for d in draws], ddof=1) == pytest.approx(stated.h_sigma_m, rel=0.75)
    assert np.std([d.E_pa for d in draws], ddof=1) == pytest.approx(stated.E_sigma_pa, rel=0.75)
    assert np.std([d.zeta02_m for d in draws], ddof=1) == pytest.approx(stated.zeta02_sigma_m, rel=0.75)


@pytest.mark.parametrize(
    ("readings", "words"),
    [
        ((5.8e-3, 1.5e-3, -13.5e3, 22.5e3), "0 < folded < deployed"),
        ((1.5e-3, 5.8e-3, 13.5e3, 22.5e3), "fold < 0 < deploy"),
        ((1.5e-3, 5.8e-3, -13.5e3, 10e3), "no wall thickness"),
        ((1.5e-3, 5.8e-3, -13.5, 22.5), "carry itself"),
    ],
)
def test_readings_no_straw_can_give_are_refused(readings: tuple[float, ...], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        identify_geometry(Readings(*readings), STRAW)
