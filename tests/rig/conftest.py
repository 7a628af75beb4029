"""Shared by the rig's tests: a straw with a closed-form motion, and an emulated rig around it."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from straw.rig.controller import Controller
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.plant import PressurePlant
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import protocol_from_toml
from straw.tracking.trace import TipTrace


class KnownStraw:
    """Stands in for straw.model.simulate.Stepper: the tip is proportional to the mean pressure of the step."""

    def __init__(self) -> None:
        self.time_s = 0.0
        self.tip = (0.0, 0.08, 0.0)
        self.volume_m3 = 1e-5
        self.pressure_pa = 0.0

    def advance(self, time_s: float, pressure_start_pa: float, pressure_end_pa: float) -> None:
        assert time_s > self.time_s
        self.time_s = time_s
        self.pressure_pa = (pressure_start_pa + pressure_end_pa) / 2
        self.tip = (self.pressure_pa * 1e-6, 0.08, self.pressure_pa * 1e-5)


@pytest.fixture
def straw() -> KnownStraw:
    return KnownStraw()


@pytest.fixture
def emulation(straw: KnownStraw) -> Iterator[Emulation]:
    with Emulation(straw, plant=PressurePlant(noise_pa=0.0), latency_s=0.0) as emulation:
        yield emulation


@pytest.fixture
def controller(emulation: Emulation) -> Iterator[Controller]:
    with make_controller("ob1-mk4", emulation.url) as controller:
        yield controller


@pytest.fixture
def sets(emulation: Emulation) -> Callable[[], list[int]]:
    """Returns every set pressure (mbar) that has reached the wire."""
    return lambda: [
        int(line.decode().strip().split(":")[2]) for _, line in emulation.wire.received if line.startswith(b"<PRESS!")
    ]


@pytest.fixture
def short() -> PressureProtocol:
    return protocol_from_toml(
        """
        name = "short"
        pressure_unit = "kPa"
        initial_deployed = [1, 4]
        specimen = "straw-7"
        cycle = 12
        prefix = [{ hold = 0, for_s = 0.1 }]
        main = [{ hold = -25, for_s = 0.4 }, { ramp = [-25, 0], for_s = 0.2 }]
        """,
        "short.toml",
    )


@pytest.fixture
def trace() -> TipTrace:
    n = 240
    time_s = np.arange(n) / 240
    valid = np.arange(n) % 7 != 3
    pose = [np.where(valid, a, np.nan) for a in (0.01 * time_s, 0.08 + 0.0 * time_s, np.sin(time_s))]
    sigma = [np.full(n, 2e-5), np.full(n, 3e-5), np.full(n, math.nan)]
    return TipTrace(time_s, *pose, *sigma, valid=valid, frame=np.arange(n))


@pytest.fixture
def recordings() -> Path:
    """Recordings of another apparatus, where they lie beside the checkout."""
    folder = Path(__file__).parents[2].parent / "shared" / "recordings"
    if not folder.is_dir():
        pytest.skip(f"no recordings of another logger in {folder}")
    return folder
