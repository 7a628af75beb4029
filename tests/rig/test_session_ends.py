"""Every way a run can end early vents and keeps its data: errors, signals, a lost connection, a full disk."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from straw.rig.controller import Controller
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.errors import RigError
from straw.rig.protocol import PressureProtocol
from straw.rig.run_read import read_run
from straw.rig.session import run_protocol

Sets = Callable[[], list[int]]


def test_a_script_that_fails_is_vented_and_its_data_kept(
    controller: Controller, short: PressureProtocol, sets: Sets, tmp_path: Path
) -> None:
    def fail(time_s: float, duration_s: float, pressure_pa: float) -> None:
        if time_s > 0.3:
            raise ZeroDivisionError("a bug in the script")

    with pytest.raises(ZeroDivisionError):
        run_protocol(controller, short, tmp_path / "run.mcap", progress=fail)
    assert sets()[-2:] == [-250, 0]
    run = read_run(tmp_path / "run.mcap")
    assert [event.kind for event in run.events[-2:]] == ["vent", "fail"]
    assert run.metadata["exit_reason"] == "ZeroDivisionError: a bug in the script"
    assert run.pressure is not None
    assert run.pressure.time_s[-1] > 0.15


@pytest.mark.skipif(os.name != "posix", reason="sends POSIX signals")
@pytest.mark.parametrize(
    ("number", "raised"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, SystemExit)], ids=["Ctrl-C", "kill"]
)
def test_ctrl_c_and_kill_vent_first_even_when_they_are_repeated(
    controller: Controller,
    short: PressureProtocol,
    sets: Sets,
    tmp_path: Path,
    number: signal.Signals,
    raised: type[BaseException],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    vent = type(controller)._vent

    def impatient_vent(self: Controller, channel: int) -> None:
        if sets()[-1] != 0:
            os.kill(os.getpid(), number)  # again, in the middle of venting
        vent(self, channel)

    monkeypatch.setattr(type(controller), "_vent", impatient_vent)

    def stop(time_s: float, duration_s: float, pressure_pa: float) -> None:
        if time_s > 0.3:
            os.kill(os.getpid(), number)

    with pytest.raises(raised):
        run_protocol(controller, short, tmp_path / "run.mcap", progress=stop)
    assert sets()[-2:] == [-250, 0]
    run = read_run(tmp_path / "run.mcap")
    assert [event.kind for event in run.events[-2:]] == ["vent", "abort"]
    assert run.metadata["exit_status"] == "abort"
    assert run.metadata["vent"] == "confirmed"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.skipif(os.name != "posix", reason="sends POSIX signals")
def test_a_process_that_receives_sigterm_vents_before_it_ends(emulation: Emulation, sets: Sets, tmp_path: Path) -> None:
    script = f"""
from straw.rig.drivers import make_controller
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.session import run_protocol
text = 'pressure_unit = "kPa"\\ninitial_deployed = []\\nmain = [{{hold = 20, for_s = 60}}]'
with make_controller("ob1-mk4", "{emulation.url}") as controller:
    run_protocol(controller, protocol_from_toml(text, "long.toml"), r"{tmp_path / "run.mcap"}")
"""
    process = subprocess.Popen([sys.executable, "-c", script], cwd=Path(__file__).parents[2], stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 20.0
    while 200 not in sets():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=20.0) == 128 + signal.SIGTERM
    assert sets()[-1] == 0
    assert read_run(tmp_path / "run.mcap").metadata["exit_status"] == "abort"


def test_a_lost_connection_ends_the_run_and_keeps_the_data(
    emulation: Emulation, short: PressureProtocol, tmp_path: Path
) -> None:
    controller = make_controller("ob1-mk4", emulation.url)
    controller.open()
    pull = threading.Timer(0.5, emulation.wire.close)
    pull.start()
    with pytest.raises(RigError, match=r"VENT IS NOT CONFIRMED.*was lost.*what was recorded is kept in") as caught:
        run_protocol(controller, short, tmp_path / "run.mcap")
    pull.join()
    assert "\n" not in str(caught.value)
    run = read_run(tmp_path / "run.mcap")
    assert run.metadata["exit_status"] == "fail"
    assert run.metadata["vent"] == "not confirmed"
    assert run.pressure is not None
    assert len(run.pressure) > 10
    with pytest.raises(RigError, match="VENT IS NOT CONFIRMED"):
        controller.close()


def test_a_connection_that_returns_is_used_to_vent(
    controller: Controller, emulation: Emulation, short: PressureProtocol, sets: Sets, tmp_path: Path
) -> None:
    def unplug(time_s: float, duration_s: float, pressure_pa: float) -> None:
        if time_s > 0.3:
            controller._line._serial._socket.shutdown(socket.SHUT_RDWR)  # type: ignore[attr-defined]

    with pytest.raises(RigError, match=r"was lost.*what was recorded is kept in"):
        run_protocol(controller, short, tmp_path / "run.mcap", progress=unplug)
    assert sets()[-2:] == [-250, 0]
    assert read_run(tmp_path / "run.mcap").metadata["vent"] == "confirmed"


def test_an_instrument_that_refuses_everything_ends_the_run(
    controller: Controller, emulation: Emulation, short: PressureProtocol, tmp_path: Path
) -> None:
    answer = emulation.wire.device.answer
    start_s = emulation.twin.now()

    def refusing(line: bytes, time_s: float) -> bytes:
        return b">PINGA?|KO|\n" if b"PINGA" in line and time_s > start_s + 0.5 else answer(line, time_s)

    emulation.wire.device.answer = refusing  # type: ignore[method-assign]
    with pytest.raises(RigError, match=r"refused.*kept in"):
        run_protocol(controller, short, tmp_path / "run.mcap")
    assert emulation.wire.received[-1][1] == b"<PRESS!:0:0\n"


def test_a_full_disk_stops_the_run_and_vents(
    controller: Controller, short: PressureProtocol, sets: Sets, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_space(descriptor: int) -> None:
        if sets()[-1] != 0:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr("straw.rig.run_file.os.fsync", no_space)
    monkeypatch.setattr("straw.rig.run_write.FLUSH_S", 0.2)
    with pytest.raises(RigError, match="No space left on device; check space"):
        run_protocol(controller, short, tmp_path / "run.mcap")
    assert sets()[-2:] == [-250, 0]
    assert (tmp_path / "run.mcap.part").exists()
