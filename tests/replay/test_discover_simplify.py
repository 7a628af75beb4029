"""Laws made simpler: parts of one law found in two rounds, and laws renumbered where one before them is dropped."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from straw.replay.diagnose.discover.discover import base_trial, polished
from straw.replay.diagnose.discover.simplify import _moved, merged, pruned, refined
from straw.replay.diagnose.discover.trial import Trial, tried
from straw.replay.diagnose.systems.function.codes import OF_INPUT, OF_STATE, RATE, STRENGTH
from straw.replay.diagnose.systems.function.laws import Law, Place, State
from straw.replay.diagnose.systems.function.model import load_model
from straw.replay.diagnose.systems.function.passed import passed
from straw.replay.diagnose.systems.function.read_recordings import recordings_of
from straw.replay.diagnose.systems.function.shapes import BUMP, LINEAR, TABLE
from straw.replay.diagnose.systems.function.system import FunctionSystem

TANK = '''
"""A tank that is filled; without the leak that it has at some levels."""
time = "t"
inputs = {"q": ("q", "l/s")}
channels = {"h": ("h", "l")}
constants = {"a": (0.2, "1/s", 0.02, 2.0)}
start = {"h": "h"}
units = {"h": "l"}

def slopes(t, x, u, c):
    return u.q - c.a * x.h
'''
FLOW = State(OF_INPUT, 0, "the flow", "l/s", 0.0, 1.0)
LEVEL = State(OF_STATE, 0, "h", "l", 0.0, 10.0, symbol="h")
INTO = Place(RATE, 0, "rate:h", "the rate of h", "l/s", 1.0)
#: The planted leak: its strength, place and width.
LEAK, AT, WIDTH = -0.4, 5.0, 1.0


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    """The base fitted to two recordings with a leak around one level."""
    path: Path = tmp_path_factory.mktemp("tank") / "tank.py"
    path.write_text(TANK)
    system, rng = FunctionSystem(load_model(path)), np.random.default_rng(2)
    t, tables = np.arange(0, 80, 0.1), {}
    for name, period in (("a", 40.0), ("b", 27.0)):
        q = 1.3 + 1.1 * np.sin(2 * np.pi * t / period)
        h = np.zeros(len(t))
        for k in range(len(t) - 1):
            x = h[k]
            for part in range(20):
                flow = q[k] + (q[k + 1] - q[k]) * part / 20
                x += 0.005 * (flow - 0.2 * x + LEAK * np.exp(-(((x - AT) / WIDTH) ** 2)))
            h[k + 1] = x
        tables[name] = name, {"t": t, "q": q, "h": h + rng.normal(0, 0.01, len(t))}
    recordings = [one.without_held() for one in recordings_of(system.model, tables)]
    return base_trial(system, recordings)


def with_laws(base: Trial, *laws: Law) -> Trial:
    """The base with laws beside it, fitted from zero."""
    unknowns, u = list(base.fit.unknowns), base.fit.u
    for number, law in enumerate(laws):
        unknowns += law.unknowns(number)
        u = np.append(u, law.start(number))
    return tried(base.campaign.with_system(base.system.with_laws(*laws)), unknowns, u, base.unit)


def test_two_curves_over_one_state_at_one_place_become_one_law_as_a_formula(base):
    coarse = Law(INTO, LEVEL, TABLE, tuple(np.linspace(0, 9, 8)))
    both = with_laws(base, coarse, Law(INTO, LEVEL, TABLE, tuple(np.linspace(0.6, 8.4, 8))))
    one = merged(both, base, passed(base.system, base.campaign.observations, base.values))
    assert len(one.laws) == 1
    assert one.laws[0].shape == BUMP
    assert one.values["law.0.place"] == pytest.approx(AT, abs=0.1)
    assert one.values["law.0.width"] == pytest.approx(WIDTH, rel=0.1)
    assert one.values["law.0.strength"] == pytest.approx(LEAK, rel=0.1)


def test_what_a_coarse_curve_leaves_is_found_by_a_finer_one_and_its_formula(base):
    coarse = with_laws(base, Law(INTO, LEVEL, TABLE, tuple(np.linspace(0, 10, 8))))
    one = refined(coarse, base, passed(base.system, base.campaign.observations, base.values))
    assert one.predicts < 0.5 * coarse.predicts
    assert one.laws[0].shape == BUMP
    assert one.values["law.0.place"] == pytest.approx(AT, abs=0.1)


def test_a_curve_that_is_fine_enough_stays(base):
    fine = with_laws(base, Law(INTO, LEVEL, TABLE, tuple(np.linspace(0, 10.7, 24))))
    assert refined(fine, base, passed(base.system, base.campaign.observations, base.values)) is fine


def test_a_law_that_a_later_one_has_made_redundant_is_dropped_and_the_rest_renumbered(base):
    useless, leak = Law(INTO, FLOW, LINEAR), Law(INTO, LEVEL, BUMP)
    factor = Law(Place(STRENGTH, 1, "strength:1", "the strength of the law in the rate of h", "1", 0.5), FLOW, LINEAR)
    full = with_laws(base, useless, leak, factor)
    fewer = pruned(full)
    assert [law.place.kind for law in fewer.laws] == [RATE, STRENGTH]
    assert fewer.laws[0].shape == BUMP
    assert fewer.laws[1].place.which == 0
    assert 0.95 * fewer.predicts <= full.predicts


def test_a_factor_follows_the_law_that_it_multiplies():
    factor = Law(Place(STRENGTH, 1, "strength:1", "the strength of the law in the rate of h", "1", 0.5), FLOW, LINEAR)
    assert _moved(factor, 0).place.which == 0
    assert _moved(factor, 0).place.name == "strength:0"
    assert _moved(factor, 2) is factor


def test_an_accepted_law_is_integrated_as_finely_as_it_needs(base):
    """It was chosen with steps of ten seconds, one for each of a hundred samples."""
    coarse = replace(base, campaign=base.campaign.with_system(replace(base.system, longest_s=10.0)))
    assert polished(coarse).system.longest_s < 1.0
