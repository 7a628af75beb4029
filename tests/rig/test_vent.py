"""Every instrument can be vented and read, whatever program drove it: straw rig vent, read and ports."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from straw.replay.cli import main
from straw.rig.emulate import Emulation
from straw.rig.emulator import Emulator
from straw.rig.errors import RigError
from straw.rig.guarded import GuardedController
from straw.rig.ports import Known, is_guarded, known_ports, remember

LEFT_UNDER_PRESSURE = 30e3


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A computer without a record of driven instruments."""
    monkeypatch.setenv("STRAW_STATE_DIR", str(tmp_path / "state"))
    monkeypatch.setattr(
        "serial.tools.list_ports.comports", list
    )  # the computer's own ports may have instruments connected
    return tmp_path / "state"


@pytest.fixture
def pressed(emulation: Emulation) -> Emulation:
    """An instrument left under pressure, with no client connected."""
    emulation.plant.command(emulation.twin.now(), LEFT_UNDER_PRESSURE)
    time.sleep(0.2)
    return emulation


def test_vent_releases_the_pressure_and_read_changes_nothing(
    pressed: Emulation, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    at = ["--port", pressed.url]
    assert main(["rig", "read", *at, "--json", str(tmp_path / "r.json")]) == 0
    assert "channel 1: +30.00 kPa" in capsys.readouterr().out
    assert json.loads((tmp_path / "r.json").read_text())["readings"][0]["pressure_pa"] == LEFT_UNDER_PRESSURE
    assert pressed.plant._told_pa == LEFT_UNDER_PRESSURE
    assert main(["rig", "vent", *at, "--json", str(tmp_path / "v.json")]) == 0
    assert "vented, reads channel 1 +" in capsys.readouterr().out
    vented = json.loads((tmp_path / "v.json").read_text())["vented"][0]
    assert vented["is_empty"] is True
    assert pressed.plant._told_pa == 0.0


def test_without_a_port_every_port_that_was_driven_is_vented(
    pressed: Emulation, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["rig", "vent"]) == 2
    assert "no port is known" in capsys.readouterr().err
    remember("/dev/unplugged", "alicat", {"unit": "B"}, 0)
    remember(pressed.url, "ob1-mk4", {}, 0)
    assert main(["rig", "vent"]) == 0
    said = capsys.readouterr().out
    assert "/dev/unplugged (alicat): not there" in said
    assert f"{pressed.url} (ob1-mk4): vented" in said
    assert main(["rig", "ports", "--json", str(tmp_path / "p.json")]) == 0
    rows = {row["port"]: row["controller"] for row in json.loads((tmp_path / "p.json").read_text())["ports"]}
    assert rows["/dev/unplugged"] == "alicat"
    assert rows[pressed.url] == "ob1-mk4"


def test_ports_identifies_connected_instruments_and_sets_nothing(
    pressed: Emulation, capsys: pytest.CaptureFixture[str]
) -> None:
    remember(pressed.url, "ob1-mk4", {}, 0)
    assert main(["rig", "ports", "--identify"]) == 0
    assert "firmware 1.4.1" in capsys.readouterr().out
    assert pressed.plant._told_pa == LEFT_UNDER_PRESSURE


def test_a_vent_that_is_refused_or_leaves_the_pressure_fails(
    pressed: Emulation, capsys: pytest.CaptureFixture[str]
) -> None:
    answer = pressed.device.answer

    def stubborn(self: Emulator, line: bytes, time_s: float) -> bytes:
        return b">PRESS!|KO|\n" if line.startswith(b"<PRESS") else answer(line, time_s)

    pressed.device.answer = stubborn.__get__(pressed.device)  # type: ignore[method-assign]
    assert main(["rig", "vent", "--port", pressed.url]) == 1
    assert "NOT VENTED, open a valve by hand" in capsys.readouterr().out
    pressed.device.answer = (  # type: ignore[method-assign]
        lambda line, time_s: b">PRESS!|OK|0:0\n" if line.startswith(b"<PRESS") else answer(line, time_s)
    )
    assert main(["rig", "vent", "--port", pressed.url]) == 1
    assert "reads 30.0 kPa: open a valve by hand" in capsys.readouterr().out


def test_a_vent_that_is_not_confirmed_names_the_command(emulation: Emulation) -> None:
    controller = GuardedController("ob1-mk4", emulation.url, patience_s=0.1)
    controller.open()
    emulation.wire.close()
    with pytest.raises(RigError, match=f"NOT CONFIRMED.*straw rig vent --port {emulation.url} --controller ob1-mk4"):
        controller.close()


def test_settings_of_the_driver_are_remembered_and_guardians_that_have_ended_are_recognised(
    emulation: Emulation,
) -> None:
    with GuardedController("ob1-mk4", emulation.url, channels=(1,), timeout_s=0.4) as controller:
        known = known_ports()[0]
        assert known.settings == {"channels": (1,), "timeout_s": 0.4}
        assert known.guardian_pid == controller.guardian_pid
        assert is_guarded(known)
    deadline = time.monotonic() + 5.0
    while is_guarded(known_ports()[0]):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    assert not is_guarded(Known("x", "y", guardian_pid=os.getpid()))  # a process id in use by another process


@pytest.mark.skipif(os.name != "posix", reason="sends POSIX signals")
def test_a_run_that_holds_the_port_is_ended_by_its_guardian_even_when_script_and_guardian_hang(
    emulation: Emulation, capsys: pytest.CaptureFixture[str], sets: Callable[[], list[int]]
) -> None:
    code = (
        "import sys, time; from straw.rig.guarded import GuardedController\n"
        "c = GuardedController('ob1-mk4', sys.argv[1], heartbeat_s=60.0); c.open(); c.set_pressure(1, -25e3)\n"
        "print(c.guardian_pid, flush=True); time.sleep(60)"
    )
    script = subprocess.Popen([sys.executable, "-c", code, emulation.url], stdout=subprocess.PIPE, text=True)
    try:
        assert script.stdout is not None
        guardian_pid = int(script.stdout.readline())
        assert main(["rig", "read", "--port", emulation.url]) == 2
        assert f"held by guardian {guardian_pid}" in capsys.readouterr().err
        time.sleep(0.5)
        os.kill(script.pid, signal.SIGSTOP)
        os.kill(guardian_pid, signal.SIGSTOP)
        assert sets()[-1] == -250
        assert main(["rig", "vent"]) == 0
        assert f"guardian {guardian_pid}, which drove a run" in capsys.readouterr().out
        assert sets()[-1] == 0
    finally:
        script.kill()
        script.communicate()
