"""Limits and the plausibility of readings, below every script: which sets are refused, which readings rejected."""

from collections.abc import Iterator

import numpy as np
import pytest

from straw.rig.clock import SteppedClock
from straw.rig.controller import Controller
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.errors import LimitError, RigError
from straw.rig.limits import PressureLimits, RateLimiter
from straw.rig.plant import PressurePlant


def test_limits_can_only_be_narrowed_and_are_restored_afterwards(controller: Controller) -> None:
    with pytest.raises(AttributeError):
        controller.limits = PressureLimits(-90e3, 90e3)  # type: ignore[misc]
    before = controller.limits
    with controller.narrowed(PressureLimits(-1e3, 90e3)) as narrow:
        assert narrow == PressureLimits(-1e3, 60e3)
        with pytest.raises(LimitError):
            controller.set_pressure(1, -2e3)
    assert controller.limits == before


@pytest.mark.parametrize("seed", range(5))
def test_no_sequence_of_sets_exceeds_the_rate_limit(seed: int) -> None:
    # Arbitrary sets at arbitrary times; of those that pass, the rate over every time interval is checked.
    random = np.random.default_rng(seed)
    rate, step = 10e3, 100.0
    limiter, now_s, at_pa = RateLimiter(step), 0.0, 0.0
    passed = [(0.0, 0.0)]
    for _ in range(1500):
        now_s += random.choice([0.0, 1e-4, 1e-2, 0.3])
        wanted_pa = round(random.choice([at_pa + step, at_pa - step, random.uniform(-40e3, 60e3)]) / step) * step
        if limiter.why_not(wanted_pa, rate, now_s) is None:
            limiter.arrived(wanted_pa)
            passed.append((now_s, wanted_pa))
            at_pa = wanted_pa
    time_s, pressure_pa = np.array(passed).T
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(pressure_pa)))])
    later, earlier = np.tril_indices(len(passed), -1)
    allowed_pa = rate * (time_s[later] - time_s[earlier] + 0.25) + step
    assert len(passed) > 100
    assert np.all(travelled[later] - travelled[earlier] <= allowed_pa * (1 + 1e-6))


def test_a_set_that_may_not_have_arrived_counts_as_arrived_and_as_not_arrived() -> None:
    limiter = RateLimiter(100.0)
    limiter.arrived(0.0)
    assert limiter.why_not(2e3, 10e3, 1.0) is None  # sent, never acknowledged
    assert limiter.why_not(-2e3, 10e3, 1.3) is not None  # from 2 kPa it would be a step of 4 kPa
    assert limiter.why_not(1e3, 10e3, 1.3) is None


@pytest.fixture
def quick(straw: object) -> Iterator[tuple[Emulation, Controller]]:
    clock = SteppedClock()
    with (
        Emulation(straw, plant=PressurePlant(noise_pa=0.0), clock=clock) as emulation,
        make_controller("ob1-mk4", emulation.url, clock=clock) as controller,
    ):
        yield emulation, controller


def test_a_sudden_exact_zero_is_rejected(quick: tuple[Emulation, Controller]) -> None:
    emulation, controller = quick
    controller.set_pressure(1, -25e3)
    controller.read()  # settling from 0
    controller.clock.sleep(1.0)
    assert controller.read()[0].pressure_pa == -25e3
    plants, emulation.device.plants = emulation.device.plants, {}
    for _ in range(3):
        with pytest.raises(RigError, match=r"reads exactly 0 all at once, as a lost link does .*; not used"):
            controller.read()
    emulation.device.plants = plants
    controller.set_pressure(1, 25e3)  # the pressure passes through 0
    for _ in range(40):
        controller.clock.sleep(0.002)
        controller.read()


def test_an_implausible_reading_is_rejected_once_and_accepted_if_it_persists(
    quick: tuple[Emulation, Controller],
) -> None:
    emulation, controller = quick
    controller.set_pressure(1, -25e3)
    controller.clock.sleep(1.0)
    controller.read()
    emulation.plant.max_pa = emulation.plant.min_pa = -10e3  # the vacuum pump stops
    emulation.plant.command(emulation.twin.now(), -25e3)
    controller.clock.sleep(1.0)
    with pytest.raises(RigError, match="reads -10 kPa where only -25 to -25 kPa can be"):
        controller.read()
    assert controller.read()[0].pressure_pa == -10e3
