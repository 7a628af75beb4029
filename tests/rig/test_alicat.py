"""The Alicat: its grammar against wire text, its driver and an independent client against the emulator."""

import importlib.util
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from straw.rig.clock import SteppedClock
from straw.rig.controllers.alicat import Alicat, decode_frame, encode_set
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.emulator import Emulator
from straw.rig.emulators.alicat import AlicatEmulator
from straw.rig.errors import RigError
from straw.rig.guarded import GuardedController
from straw.rig.plant import PressurePlant
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.reading import Reading
from straw.rig.run_read import read_run
from straw.rig.session import run_protocol
from straw.rig.wire import Sent
from tests.benchmarks.soak import misread

EXCHANGES = (Path(__file__).parent / "exchanges" / "alicat.txt").read_text().splitlines()
PAIRS = [
    (sent[2:].encode() + b"\r", answer[2:].replace("|", "\r").encode() + b"\r")
    for sent, answer in pairwise(EXCHANGES)
    if sent.startswith("> ")
]


@pytest.fixture
def alicat(straw: object) -> Iterator[Emulation]:
    with Emulation(straw, "alicat", plant=PressurePlant(noise_pa=0.0, resolution_pa=10.0), latency_s=0.0) as emulation:
        yield emulation


def test_the_emulator_answers_as_the_wire_text_says() -> None:
    emulator = AlicatEmulator({1: PressurePlant(noise_pa=0.0, resolution_pa=10.0)})
    assert len(PAIRS) == 9
    for sent, answer in PAIRS:
        assert emulator.answer(sent, 0.0) == answer
    assert emulator.answer(b"B\r", 0.0) == b""  # addressed to another unit


def test_frames_of_both_kinds_of_controller_are_read() -> None:
    assert decode_frame(b"A +0014.70 -0025.00\r", "A")[:3] == (14.7, -25.0, frozenset())
    frame = decode_frame(b"A +0014.70 +0025.00 +0000.10 +0000.10 -0025.00     Air POV HLD\r", "A")
    assert frame[:3] == (14.7, -25.0, {"POV", "HLD"})
    assert encode_set("A", 5.44, 2) == b"AS5.44\r"


@pytest.mark.parametrize(
    "reply",
    [
        b"?\r",
        b"A ?\r",
        b"\r",
        b"A\r",
        b"B +0014.70 -0025.00\r",
        b"A +0014.70\r",
        b"A +0014.7O -0025.00\r",
        b"A +0014.70 -0025.00A +0014.70 -0025.00\r",
        b"A nan -0025.00\r",
        b"A +0014.70 -0025.00 XYZ\r",
    ],
)
def test_a_damaged_frame_is_refused_and_never_guessed(reply: bytes) -> None:
    with pytest.raises(RigError):
        decode_frame(reply, "A")


def test_a_whole_run_on_an_alicat_behind_its_guardian(
    alicat: Emulation, short: PressureProtocol, tmp_path: Path
) -> None:
    # held for long enough that the pressure settles where a busy machine starts to write half a second late
    held = replace(short, time_s=np.where(short.time_s > 0.1, short.time_s + 2.6, short.time_s))
    with GuardedController("alicat", alicat.url) as controller:
        outcome = run_protocol(controller, held, tmp_path / "run.mcap")
    run = read_run(tmp_path / "run.mcap")
    # a busy machine may hold the emulator up past the reply's deadline: every miss is then an event of the run
    assert outcome.missed == [event.kind for event in run.events].count("fault") < outcome.cycles
    assert run.metadata["exit_status"] == "success"
    assert run.metadata["model"].startswith("A M00")
    assert run.pressure is not None
    assert run.pressure.pressure_pa.min() == -25e3
    sent = [line for _, line in alicat.wire.received]
    assert sent[-2:] == [b"AC\r", b"AS0.00\r"]
    assert b"AS-25.00\r" in sent


def test_held_valves_are_reported_and_released_by_the_vent(alicat: Emulation) -> None:
    with make_controller("alicat", alicat.url) as controller:
        assert isinstance(controller, Alicat)
        controller.set_pressure(1, 10e3)
        controller._line.exchange(b"AHC\r", b"\r", 1.0)
        with pytest.raises(RigError, match="holds its valves"):
            controller.set_pressure(1, 5e3)
    assert not alicat.device.held  # type: ignore[attr-defined]


def test_a_pressure_beyond_the_sensor_is_rejected(alicat: Emulation) -> None:
    with make_controller("alicat", alicat.url) as controller:
        answer = alicat.device.answer

        def over(line: bytes, time_s: float) -> bytes:
            return answer(line, time_s).replace(b"\r", b" POV\r") if line == b"A\r" else answer(line, time_s)

        alicat.device.answer = over  # type: ignore[method-assign]
        with pytest.raises(RigError, match="POV: the pressure is beyond its sensor"):
            controller.read()


def test_an_emulated_minute_takes_far_less_than_a_minute(straw: object) -> None:
    clock = SteppedClock()
    with (
        Emulation(straw, "alicat", plant=PressurePlant(noise_pa=0.0), clock=clock) as emulation,
        make_controller("alicat", emulation.url, clock=clock) as controller,
    ):
        controller.set_pressure(1, 5e3)
        for _ in range(60):
            clock.sleep(1.0)
            assert controller.read()[0].pressure_pa == pytest.approx(5e3)
        assert clock.monotonic_s() > 60.0
    assert emulation.twin.history.time_s[-1] > 60.0


CLIENT = """
import asyncio, sys
from alicat import FlowController

async def main():
    async with FlowController(address=sys.argv[1]) as instrument:
        first = await instrument.get()
        await instrument.set_pressure(-12.5)
        await asyncio.sleep(0.3)
        second = await instrument.get()
        await instrument.hold()
        await instrument.cancel_hold()
        await instrument.lock()
        locked = await instrument.is_locked()
        await instrument.unlock()
        firmware = await instrument.get_firmware()
        await instrument.tare_pressure()
        pid = (await instrument.get_pid())["loop_type"]
        ramp = (await instrument.get_maxramp())["max_ramp"]
        await instrument.set_pressure(0.0)
        values = [first["pressure"], first["control_point"], second["pressure"], second["setpoint"]]
        print([*values, locked, firmware, pid, ramp])

asyncio.run(main())
"""


def test_an_independent_client_works_with_the_emulator(straw: object) -> None:
    # GPL, so never imported here: it runs in a process, and if need be an environment, of its own.
    python = os.environ.get("STRAW_ALICAT_PYTHON", "")
    if not python and importlib.util.find_spec("alicat") is None:
        pytest.skip("the PyPI package alicat is not here: pip install it, or name a Python in STRAW_ALICAT_PYTHON")
    plant = PressurePlant(noise_pa=0.0, resolution_pa=10.0)
    # The package (0.9.0) cannot read the short frames of a PCD, so the emulator plays an MCD that regulates pressure.
    addresses = ["pty", "127.0.0.1:0"] if os.name == "posix" else ["127.0.0.1:0"]
    with Emulation(straw, "alicat", *addresses, plant=plant, device={"frame": "mass"}) as emulation:
        for url in emulation.urls:
            time.sleep(0.3)  # until the pressure commanded before has decayed
            said = subprocess.run(
                [python or sys.executable, "-c", CLIENT, url.removeprefix("socket://")],
                capture_output=True,
                text=True,
                timeout=30,
            )
            assert (
                said.stdout.strip() == "[0.0, 'gauge pressure', -12.5, -12.5, True, 'A   10v05.0-R24', 'PD/PDF', 0.0]"
            ), said.stderr


def test_late_answers_do_not_end_a_run_and_are_recorded(straw: object, tmp_path: Path) -> None:
    class SometimesLate:
        """The 20th exchange is answered 0.7 s late, the 60th 1.9 s, each long after the driver's timeout."""

        count = 0

        def answer(self, device: Emulator, line: bytes, time_s: float) -> Sent:
            self.count += 1
            return Sent(device.answer(line, time_s), late_s={20: 0.7, 60: 1.9}.get(self.count, 0.0))

    protocol = protocol_from_toml(
        'pressure_unit = "kPa"\ninitial_deployed = []\nmain = [{ ramp = [0, 20], for_s = 5.0 }]', "slow.toml"
    )
    plant = PressurePlant(noise_pa=0.0, resolution_pa=10.0)
    with (
        Emulation(straw, "alicat", plant=plant, faults=SometimesLate(), latency_s=0.0) as emulation,
        make_controller("alicat", emulation.url) as controller,
    ):
        read, wrong = controller.read, []

        def judged() -> tuple[Reading, ...]:
            readings = read()
            wrong.append(misread(readings[0], plant, emulation, controller))
            return readings

        controller.read = judged  # type: ignore[method-assign]
        outcome = run_protocol(controller, protocol, tmp_path / "run.mcap")
    run = read_run(tmp_path / "run.mcap")
    assert run.metadata["exit_status"] == "success"
    assert outcome.missed == len([event for event in run.events if event.kind == "fault"]) > 0
    assert [text for text in wrong if text] == []  # every reading was the pressure within its time span
    assert len(wrong) == outcome.cycles - outcome.missed
