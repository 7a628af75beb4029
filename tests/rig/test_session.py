"""A run is recorded as it happened, at its rate and within its limits."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from serial import SerialTimeoutException
from serial.urlhandler.protocol_socket import Serial as SocketSerial

from straw.rig.controller import Controller
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.errors import RigError
from straw.rig.limits import PressureLimits
from straw.rig.protocol import PressureProtocol
from straw.rig.run_read import read_run
from straw.rig.session import run_protocol

Sets = Callable[[], list[int]]


def test_a_run_is_recorded_as_it_happened(
    controller: Controller, emulation: Emulation, short: PressureProtocol, tmp_path: Path
) -> None:
    path = tmp_path / "run.mcap"
    seen: list[float] = []
    outcome = run_protocol(
        controller, short, path, metadata={"operator": "A"}, progress=lambda time_s, duration_s, pa: seen.append(time_s)
    )
    assert outcome.path == path
    assert not path.with_name("run.mcap.part").exists()
    run = read_run(path)
    assert run.lost == ()
    assert (run.run_id, run.specimen, run.initial_deployed, run.cycle, run.cells) == ("run", "straw-7", (1, 4), 12, 9)
    assert run.metadata["operator"] == "A"
    assert run.metadata["exit_status"] == "success"
    assert run.metadata["firmware"] == "1.4.1"
    assert run.attachments["protocol.toml"] == short.text.encode()
    assert [event.kind for event in run.events] == ["arm", "start", "step", "stop", "vent"]
    assert run.command is not None
    assert run.pressure is not None
    assert len(run.pressure) == outcome.cycles == len(seen)
    # Time 0 is the start of the main part: the step is there, to within a cycle or two on a busy machine.
    first = int(np.argmax(run.command.pressure_pa != 0.0))
    assert run.command.pressure_pa[first] == -25e3
    assert 0.0 <= run.command.time_s[first] < 0.1
    np.testing.assert_allclose(run.command(np.array([0.5, 0.55])), [-12.5e3, -6.25e3], atol=6e3)
    assert run.pressure(0.35) == pytest.approx(-25e3, abs=100.0)


def test_the_logged_pressure_is_the_reading_and_never_the_command(
    emulation: Emulation, short: PressureProtocol, tmp_path: Path
) -> None:
    emulation.plant.min_pa = -10e3  # a supply that cannot follow
    with make_controller("ob1-mk4", emulation.url) as controller:
        run_protocol(controller, short, tmp_path / "run.mcap")
    run = read_run(tmp_path / "run.mcap")
    assert run.pressure is not None
    assert run.command is not None
    assert run.command.pressure_pa.min() == -25e3
    assert run.pressure.pressure_pa.min() == -10e3


def test_a_computer_that_stalls_during_a_request_misses_an_answer_and_the_run_continues(
    emulation: Emulation, short: PressureProtocol, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = 0
    send = SocketSerial.write

    def stalled_once(port: SocketSerial, request: bytes) -> int | None:
        nonlocal asked
        asked += 1
        sent: int | None = send(port, request)
        if asked == 20:  # pyserial reports a timeout although all bytes were sent, when its own computer stalled
            raise SerialTimeoutException("Write timeout")
        return sent

    monkeypatch.setattr(SocketSerial, "write", stalled_once)
    with make_controller("ob1-mk4", emulation.url) as controller:
        outcome = run_protocol(controller, short, tmp_path / "run.mcap")
    run = read_run(tmp_path / "run.mcap")
    assert outcome.missed == [event.kind for event in run.events].count("fault") >= 1  # more on a busy machine
    assert run.metadata["exit_status"] == "success"
    assert next(event.text for event in run.events if event.kind == "fault").startswith("port socket://")


def test_the_straw_behind_the_wire_moves_with_the_run(
    straw: object, emulation: Emulation, short: PressureProtocol, tmp_path: Path
) -> None:
    with make_controller("ob1-mk4", emulation.url) as controller:
        run_protocol(controller, short, tmp_path / "run.mcap")
    run = read_run(tmp_path / "run.mcap")
    history = emulation.twin.history
    assert run.pressure is not None
    at_s = (run.zero_time_ns - history.zero_wall_ns) * 1e-9 + run.pressure.time_s
    truth_pa = np.interp(at_s, history.time_s, history.external_pa)
    # An offset of 50 ms between the two clocks would be 7 kPa rms.
    assert np.sqrt(np.mean((truth_pa - run.pressure.pressure_pa) ** 2)) < 3000.0
    assert np.max(np.diff(history.time_s)) < 1.001e-3
    assert history.x_m.min() == pytest.approx(-0.025, abs=1e-4)


def test_the_loop_keeps_its_rate(controller: Controller, short: PressureProtocol, tmp_path: Path) -> None:
    outcome = run_protocol(controller, short, tmp_path / "run.mcap", rate_hz=50.0)
    assert 25.0 < outcome.rate_hz <= 51.5  # never faster; slower only as far as a busy machine requires
    run = read_run(tmp_path / "run.mcap")
    assert outcome.missed == [event.kind for event in run.events].count("fault") < outcome.cycles


def test_a_controller_that_is_not_open_runs_nothing_and_leaves_no_file(
    emulation: Emulation, short: PressureProtocol, tmp_path: Path
) -> None:
    closed = make_controller("ob1-mk4", emulation.url)
    with pytest.raises(RigError, match="is not open; write: with controller"):
        run_protocol(closed, short, tmp_path / "run.mcap")
    closed.close()
    assert not emulation.wire.received
    assert list(tmp_path.iterdir()) == []


def test_one_garbled_reading_is_recorded_and_the_run_continues(
    controller: Controller, emulation: Emulation, short: PressureProtocol, tmp_path: Path
) -> None:
    answer, count = emulation.wire.device.answer, 0

    def sometimes_garbled(line: bytes, time_s: float) -> bytes:
        nonlocal count
        count += 1
        return b">PINGA?|OK|12:\xff\n" if count == 20 else answer(line, time_s)

    emulation.wire.device.answer = sometimes_garbled  # type: ignore[method-assign]
    outcome = run_protocol(controller, short, tmp_path / "run.mcap")
    run = read_run(tmp_path / "run.mcap")
    assert outcome.missed == [event.kind for event in run.events].count("fault") >= 1  # more on a busy machine
    assert run.metadata["exit_status"] == "success"


def test_a_protocol_beyond_the_controllers_limits_moves_nothing_and_leaves_no_file(
    emulation: Emulation, short: PressureProtocol, sets: Sets, tmp_path: Path
) -> None:
    with make_controller("ob1-mk4", emulation.url, limits=PressureLimits(-20e3, 20e3)) as controller:
        with pytest.raises(RigError, match="-25 kPa is below the limit of -20 kPa"):
            run_protocol(controller, short, tmp_path / "run.mcap")
        with pytest.raises(RigError, match="wants channel 2"):
            run_protocol(controller, replace(short, channel=2, pressure_pa=0 * short.time_s), tmp_path / "run.mcap")
    assert set(sets()) == {0}
    assert list(tmp_path.iterdir()) == []


def test_the_protocols_limits_apply_only_while_it_runs(
    controller: Controller, short: PressureProtocol, tmp_path: Path
) -> None:
    narrow = replace(short, limits=PressureLimits(-26e3, 1e3))
    during: list[PressureLimits] = []
    run_protocol(controller, narrow, tmp_path / "a.mcap", progress=lambda *_: during.append(controller.limits))
    assert set(during) == {narrow.limits}
    assert controller.limits == PressureLimits(-40e3, 60e3)


def test_an_existing_recording_is_never_overwritten(
    controller: Controller, short: PressureProtocol, sets: Sets, tmp_path: Path
) -> None:
    for name in ("run.mcap", "cut.mcap.part"):
        (tmp_path / name).write_bytes(b"precious")
    for name in ("run.mcap", "cut.mcap"):
        with pytest.raises(RigError, match="not overwritten"):
            run_protocol(controller, short, tmp_path / name)
    with pytest.raises(RigError, match="cannot be made"):
        run_protocol(controller, short, tmp_path / "no" / "folder" / "run.mcap")
    assert {path.read_bytes() for path in tmp_path.iterdir()} == {b"precious"}
    assert set(sets()) == {0}
