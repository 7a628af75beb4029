"""The OB1 MK4: its grammar against wire text, its driver against the emulator on TCP and on a pty."""

import math
import os
import socket
import threading
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from serial import SerialTimeoutException
from serial.urlhandler.protocol_socket import Serial as SocketSerial

from straw.rig.controller import Controller
from straw.rig.controllers.ob1_mk4 import READ_ALL, Dialect, decode_payload, decode_readings, encode_set, is_answer_to
from straw.rig.drivers import controller_names, make_controller
from straw.rig.emulate import Emulation
from straw.rig.emulators.ob1_mk4 import Ob1Mk4Emulator
from straw.rig.errors import LinkLostError, RigError
from straw.rig.limits import PressureLimits
from straw.rig.line import Line
from straw.rig.plant import PressurePlant

EXCHANGES = (Path(__file__).parent / "exchanges" / "ob1_mk4.txt").read_text().splitlines()
PAIRS = [(sent[2:] + "\n", answer[2:] + "\n") for sent, answer in pairwise(EXCHANGES) if sent.startswith("> ")]
ADDRESSES = ["127.0.0.1:0"] + (["pty"] if os.name == "posix" else [])


def test_the_emulator_answers_as_the_wire_text_says() -> None:
    emulator = Ob1Mk4Emulator({1: PressurePlant(noise_pa=0.0)})
    assert len(PAIRS) == 8
    for sent, answer in PAIRS:
        assert emulator.answer(sent.encode(), 0.0) == answer.encode()


def test_every_answer_in_the_wire_text_is_parsed_and_every_refusal_is_an_error() -> None:
    for sent, answer in PAIRS:
        assert is_answer_to(sent.encode(), answer.encode())
        if "|OK|" in answer:
            assert decode_payload(answer.encode()) == answer.strip().split("|OK|")[1]
        else:
            with pytest.raises(RigError, match="refused"):
                decode_payload(answer.encode())


def test_a_set_is_written_in_whole_mbar_from_channel_zero() -> None:
    assert encode_set(1, -25e3) == b"<PRESS!:0:-250\n"
    assert encode_set(4, 10e3) == b"<PRESS!:3:100\n"
    assert encode_set(1, 0.0, Dialect(first_channel=1)) == b"<PRESS!:1:0\n"
    for channel, pressure_pa in [(0, 0.0), (5, 0.0), (1, 150.0)]:
        with pytest.raises(RigError, match="cannot be told"):
            encode_set(channel, pressure_pa)


@pytest.mark.parametrize(
    "reply", [b"", b"\n", b">PINGA?|OK|1:2:3\n", b">PINGA?|OK|" + b"x:" * 12, b"\xff" * 9, b"junk\n"]
)
def test_a_damaged_reading_is_refused_and_never_guessed(reply: bytes) -> None:
    with pytest.raises(RigError):
        decode_readings(reply)
    with pytest.raises(RigError):
        decode_readings(b">PINGA?|OK|nan" + b":0" * 11)


@pytest.mark.parametrize("address", ADDRESSES)
def test_what_is_set_is_what_is_read_back_over_a_real_port(straw: object, address: str) -> None:
    with Emulation(straw, "ob1-mk4", address, plant=PressurePlant(noise_pa=0.0)) as emulation:
        with make_controller("ob1-mk4", emulation.url, sigma_pa=29.0) as controller:
            assert controller.snapshot()["firmware"] == "1.4.1"
            before = controller.clock.wall_ns()
            command = controller.set_pressure(1, -25_049.0)
            assert command.pressure_pa == -25_000.0
            deadline_ns = before + 1_000_000_000
            while (reading := controller.read()[0]).pressure_pa != -25e3:
                assert reading.wall_ns < deadline_ns
            assert before < command.wall_ns < reading.wall_ns
            assert 0 < reading.half_width_ns < 100_000_000
            assert reading.sigma_pa == 29.0
            assert reading.raw.startswith(b">PINGA?|OK|-250:")
        assert emulation.wire.received[-1][1] == b"<PRESS!:0:0\n"


def test_the_paper_s_settling_is_seen_through_the_wire(controller: Controller) -> None:
    start = controller.set_pressure(1, 30e3)
    curve = []
    while not curve or curve[-1][0] < 0.2:
        reading = controller.read()[0]
        width_s = (start.half_width_ns + reading.half_width_ns) * 1e-9
        curve.append(((reading.monotonic_ns - start.monotonic_ns) * 1e-9, reading.pressure_pa, width_s))

    def expected_pa(time_s: float) -> float:
        return 30e3 * (1 - math.exp(-50.0 * max(time_s, 0.0)))

    for time_s, pressure_pa, width_s in curve:  # the error of a stamp must lie within its stated uncertainty
        assert expected_pa(time_s - width_s) - 100.0 <= pressure_pa <= expected_pa(time_s + width_s) + 100.0
    assert curve[-1][1] == 30e3


@pytest.mark.parametrize("pressure_pa", [60.1e3, -40.1e3, math.nan, math.inf, -math.inf, 1e300])
def test_no_set_beyond_the_limits_reaches_the_wire(
    controller: Controller, sets: Callable[[], list[int]], pressure_pa: float
) -> None:
    controller.set_pressure(1, 60e3)
    with pytest.raises(RigError, match=r"nothing was sent") as caught:
        controller.set_pressure(1, pressure_pa)
    assert "\n" not in str(caught.value)
    controller.set_pressure(1, -40e3)
    assert sets() == [0, 600, -400]  # the first is the vent on opening


def test_rounding_never_exceeds_a_limit(emulation: Emulation, sets: Callable[[], list[int]]) -> None:
    with make_controller("ob1-mk4", emulation.url, limits=PressureLimits(-1060.0, 1060.0)) as controller:
        assert controller.set_pressure(1, 1060.0).pressure_pa == 1000.0
        assert controller.set_pressure(1, -1060.0).pressure_pa == -1000.0
    assert sets() == [0, 10, -10, 0]


def test_the_operator_cannot_widen_the_regulators_range(emulation: Emulation) -> None:
    controller = make_controller("ob1-mk4", emulation.url, limits=PressureLimits(-1e6, 1e6))
    assert controller.limits == PressureLimits(-90e3, 100e3)
    small = make_controller("ob1-mk4", emulation.url, range_mbar=(0.0, 200.0))
    assert small.limits == PressureLimits(0.0, 20e3)


def test_a_rate_limit_stops_a_jump_even_after_a_long_hold(emulation: Emulation, sets: Callable[[], list[int]]) -> None:
    limits = PressureLimits(-40e3, 60e3, max_rate_pa_s=10e3)
    with make_controller("ob1-mk4", emulation.url, limits=limits) as controller:
        threading.Event().wait(0.5)
        with pytest.raises(RigError, match="breaks the limit of 10 kPa/s"):
            controller.set_pressure(1, 5e3)
        start_ns = controller.clock.monotonic_ns()
        while (now_s := (controller.clock.monotonic_ns() - start_ns) * 1e-9) < 0.3:
            controller.set_pressure(1, now_s * 10e3)  # exactly the limit, rounded to the instrument's steps
    assert max(sets()) >= 25
    assert sets()[-1] == 0


def test_a_channel_that_is_not_in_use_cannot_be_set(controller: Controller) -> None:
    with pytest.raises(RigError, match=r"channel 2 is not in use; open the controller with channels=\(2,\)"):
        controller.set_pressure(2, 0.0)
    with pytest.raises(RigError, match=r"channels 1\.\.4"):
        make_controller("ob1-mk4", "socket://127.0.0.1:1", channels=(5,))


def test_a_late_answer_is_not_taken_for_that_of_the_next_request() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def device() -> None:
            with server.accept()[0] as link:
                link.recv(64)
                link.sendall(b">PRESS!|OK|0:0\n>PINGA?|OK|77" + b":0" * 11 + b"\n")
                link.recv(64)  # the client closes the connection

        thread = threading.Thread(target=device)
        thread.start()
        line = Line(f"socket://127.0.0.1:{server.getsockname()[1]}")
        line.open()
        controller = make_controller("ob1-mk4", line.port)
        controller._line = line  # type: ignore[attr-defined]
        assert controller._read().pressure_pa[1] == 7700.0
        assert is_answer_to(READ_ALL, b">PINGA?|OK|\n")
        line.close()
        thread.join()


def test_a_vent_is_repeated_when_neither_the_previous_set_nor_its_own_first_request_was_accepted(
    controller: Controller, sets: Callable[[], list[int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    controller.set_pressure(1, 30e3)
    send, refused = SocketSerial.write, iter([True, True])

    def stalled_twice(port: SocketSerial, request: bytes) -> int | None:
        if next(refused, False):
            raise SerialTimeoutException("Write timeout")
        sent: int | None = send(port, request)
        return sent

    monkeypatch.setattr(SocketSerial, "write", stalled_twice)
    with pytest.raises(RigError, match=r"was not taken within 0\.3 s"):
        controller.set_pressure(1, 40e3)
    controller.vent()
    assert next(refused, None) is None
    assert sets()[:2] == [0, 300]
    assert set(sets()[2:]) == {0}


def test_a_pulled_cable_is_reported_in_one_line(emulation: Emulation) -> None:
    controller = make_controller("ob1-mk4", emulation.url)
    controller.open()
    emulation.wire.close()
    with pytest.raises(LinkLostError, match=r"was lost: .*; check cable and power"):
        controller.read()
    with pytest.raises(RigError, match="VENT IS NOT CONFIRMED, vent by hand now"):
        controller.close()


@pytest.mark.parametrize(
    "port", ["/dev/no-such-port", "socket://127.0.0.1:1", "socket://nohost", "gopher://x", "COM999"]
)
def test_a_port_that_does_not_open_is_reported_in_one_line(port: str) -> None:
    with pytest.raises(RigError, match=r"does not open: .*plug it in") as caught:
        make_controller("ob1-mk4", port).open()
    assert "\n" not in str(caught.value)
    assert port in str(caught.value)


def test_the_error_of_a_silent_instrument_names_it_and_the_time_waited() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = f"socket://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(RigError, match=r"nothing within 0\.1 s"):
            make_controller("ob1-mk4", port, timeout_s=0.1).open()


def test_controllers_are_found_by_name() -> None:
    assert "ob1-mk4" in controller_names()
    with pytest.raises(RigError, match=r"known: .*ob1-mk4"):
        make_controller("ob2", "COM1")


@pytest.mark.parametrize("name", controller_names())
def test_every_controller_describes_itself_and_its_capabilities(name: str) -> None:
    controller = make_controller(name, "socket://127.0.0.1:1")
    assert controller.name == name
    assert controller.resolution_pa > 0
    assert controller.span.and_also(controller.limits) == controller.limits
    with pytest.raises(RigError, match="not open"):
        controller.read()
