"""Whatever becomes of the script, the straw is vented: each way out, proven by what reached the wire and when."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from straw.replay.commands.rig_snap_search import answered
from straw.rig.controller import Controller
from straw.rig.emulate import Emulation
from straw.rig.errors import LimitError, LinkLostError, RigError
from straw.rig.guarded import GuardedController
from straw.rig.interrupts import Interrupts
from straw.rig.limits import PressureLimits
from straw.rig.protocol import PressureProtocol
from straw.rig.run_read import read_run
from straw.rig.session import run_protocol
from straw.rig.wire import Wire

Sets = Callable[[], list[int]]
posix = pytest.mark.skipif(os.name != "posix", reason="sends POSIX signals")
VENT = b"<PRESS!:0:0\n"

# A script as an experimentalist would write one. What it does under pressure comes in as text.
SCRIPT = """
import os, signal, sys, time
from straw.rig.guarded import GuardedController
if hasattr(signal, "SIGHUP"):  # under nohup it would be ignored, by everything that is started
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
with GuardedController("ob1-mk4", sys.argv[1], heartbeat_s=1.0, patience_s=20.0) as controller:
    controller.set_pressure(1, -25e3)
    print("under pressure", controller.guardian_pid, flush=True)
    {then}
"""
READING = "while True: controller.read(); time.sleep(0.01)"


class Script:
    """A script in a process of its own, brought to where the straw is under pressure."""

    def __init__(self, emulation: Emulation, then: str) -> None:
        self.emulation = emulation
        self.process = subprocess.Popen(
            [sys.executable, "-c", SCRIPT.format(then=then), emulation.url],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).parents[2],
        )
        assert self.process.stdout is not None
        said = self.process.stdout.readline()
        if not said:
            pytest.fail(f"the script ended: {self.process.communicate()[1]}")
        self.guardian_pid = int(said.split()[2])

    def vent_after(self, end: Callable[[], object], limit_s: float = 5.0) -> float:
        """Seconds from calling ``end`` to the vent's arrival on the wire."""
        time.sleep(0.1)
        start_s = self.emulation.twin.now()
        end()
        while self.emulation.twin.now() < start_s + limit_s:
            for at_s, line in reversed(self.emulation.wire.received):
                if at_s > start_s and line == VENT:
                    return at_s - start_s
            time.sleep(0.005)
        raise AssertionError(f"no vent within {limit_s} s")


@pytest.fixture
def script(emulation: Emulation) -> Iterator[Callable[[str], Script]]:
    made: list[Script] = []

    def make(then: str = READING) -> Script:
        made.append(Script(emulation, then))
        return made[-1]

    yield make
    for one in made:
        one.process.kill()
        one.process.communicate()
        deadline = time.monotonic() + 5.0
        while _alive(one.guardian_pid):
            assert time.monotonic() < deadline, "a guardian outlived its duty"
            time.sleep(0.01)


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except OSError:
        return False


@posix
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_script_that_dies_by_any_signal_leaves_a_vented_straw(
    script: Callable[..., Script], number: signal.Signals
) -> None:
    one = script()
    took_s = one.vent_after(lambda: one.process.send_signal(number))
    assert took_s < 1.0  # about 10 ms on an idle machine; never as long as the heartbeat, which is the second net
    assert one.process.wait(5.0) != 0


@posix
def test_a_script_that_hangs_is_vented_by_the_missing_heartbeat_and_its_later_sets_are_refused(
    script: Callable[..., Script],
) -> None:
    one = script(
        "time.sleep(0.1); controller.read(); sys.stdin.read(1) or time.sleep(2.0); controller.set_pressure(1, -5e3)"
    )
    took_s = one.vent_after(lambda: None)
    assert 0.8 < took_s < 2.0  # one second without a word
    _, said = one.process.communicate()
    assert "silent for 1 s" in said
    assert "nothing was sent" in said
    assert one.emulation.wire.received[-1][1] == VENT


@posix
def test_a_frozen_script_is_vented_and_its_guardian_killed_alone_is_replaced(script: Callable[..., Script]) -> None:
    frozen = script()
    assert frozen.vent_after(lambda: frozen.process.send_signal(signal.SIGSTOP)) < 2.0
    frozen.process.kill()
    frozen.process.wait()
    orphaned = script()
    took_s = orphaned.vent_after(lambda: os.kill(orphaned.guardian_pid, signal.SIGKILL))
    assert took_s < 3.0  # the script notices at its next reading and starts another guardian
    _, said = orphaned.process.communicate()
    assert "guardian process" in said


@posix
def test_a_lost_link_is_vented_when_it_returns_even_after_the_script_is_dead(
    emulation: Emulation, script: Callable[..., Script]
) -> None:
    one = script()
    time.sleep(0.1)
    emulation.wire.close()
    one.process.wait(10.0)
    assert one.process.returncode == 1
    time.sleep(0.5)  # nobody is left but the guardian
    assert _alive(one.guardian_pid)
    start_s = time.monotonic()
    with Wire(emulation.device, emulation.url, clock=emulation.clock, now=emulation.twin.now) as again:
        while not again.received or again.received[-1][1] != VENT:
            assert time.monotonic() - start_s < 5.0
            time.sleep(0.01)
        deadline = time.monotonic() + 5.0
        while _alive(one.guardian_pid):  # having vented, it ends
            assert time.monotonic() < deadline
            time.sleep(0.01)


@posix
def test_script_and_guardian_both_killed_are_vented_by_the_standby_which_notes_it(
    emulation: Emulation, script: Callable[..., Script], tmp_path: Path
) -> None:
    one = script(f"from pathlib import Path; controller.record_in(Path({str(tmp_path / 'note')!r}))\n    {READING}")
    time.sleep(1.0)  # the standby has started

    def kill_both() -> None:
        os.kill(one.guardian_pid, signal.SIGSTOP)  # or it would vent before it dies
        one.process.kill()
        os.kill(one.guardian_pid, signal.SIGKILL)

    assert one.vent_after(kill_both) < 1.0
    deadline = time.monotonic() + 5.0
    while "confirmed" not in (tmp_path / "note").read_text():
        assert time.monotonic() < deadline
        time.sleep(0.01)
    assert "was killed: the standby vents" in (tmp_path / "note").read_text()


@posix
def test_a_guardian_that_hangs_is_ended_vented_in_two_seconds_and_called_by_its_name(
    script: Callable[..., Script],
) -> None:
    one = script()
    took_s = one.vent_after(lambda: os.kill(one.guardian_pid, signal.SIGSTOP))
    assert took_s < 2.0
    _, said = one.process.communicate()
    assert "gave no sign of life for 1 s" in said
    assert "straw rig vent --port socket://" in said


@posix
def test_a_guardian_that_hangs_while_the_script_sleeps_or_is_interrupted_is_vented_too(
    script: Callable[..., Script],
) -> None:
    asleep = script("time.sleep(30)")
    time.sleep(0.8)  # but for the heartbeat, nothing but the standby looks at the guardian
    os.kill(asleep.guardian_pid, signal.SIGSTOP)
    assert asleep.vent_after(lambda: None) < 2.5
    interrupted = script()
    os.kill(interrupted.guardian_pid, signal.SIGSTOP)
    assert interrupted.vent_after(lambda: interrupted.process.send_signal(signal.SIGINT)) < 2.0
    interrupted.process.wait(5.0)


@posix
def test_reads_of_a_script_that_froze_are_refused_with_the_true_reason(script: Callable[..., Script]) -> None:
    one = script()
    took_s = one.vent_after(lambda: one.process.send_signal(signal.SIGSTOP))
    assert took_s < 2.0
    one.process.send_signal(signal.SIGCONT)
    _, said = one.process.communicate(timeout=5.0)
    assert "silent for 1 s, so its guardian vented" in said
    assert "lost link" not in said


@posix
def test_a_pipe_ends_with_the_command_and_a_guardian_told_to_end_ends(
    emulation: Emulation, script: Callable[..., Script]
) -> None:
    one = script()
    time.sleep(0.1)
    emulation.wire.close()
    one.process.wait(10.0)
    start_s = time.monotonic()
    one.process.communicate(timeout=10.0)
    assert time.monotonic() - start_s < 1.0
    assert _alive(one.guardian_pid)  # it goes on trying, but nobody has to wait for it
    os.kill(one.guardian_pid, signal.SIGTERM)
    while _alive(one.guardian_pid):
        assert time.monotonic() - start_s < 8.0
        time.sleep(0.01)


@posix
def test_a_guardian_told_to_end_vents_first(script: Callable[..., Script]) -> None:
    one = script()
    assert one.vent_after(lambda: os.kill(one.guardian_pid, signal.SIGTERM)) < 1.0


@posix
def test_a_killed_run_keeps_its_record_and_the_guardian_notes_its_vent_beside_it(
    emulation: Emulation, script: Callable[..., Script], tmp_path: Path
) -> None:
    one = script(
        "from straw.rig.protocol_toml import protocol_from_toml; from straw.rig.session import run_protocol; "
        "run_protocol(controller, "
        "protocol_from_toml('pressure_unit = \"kPa\"\\ninitial_deployed = []\\nmain = [{ hold = -25, for_s = 60 }]', "
        f"'long.toml'), {str(tmp_path / 'run.mcap')!r})"
    )
    time.sleep(2.0)
    assert one.vent_after(one.process.kill) < 1.0
    deadline = time.monotonic() + 5.0
    while '"vent"' not in (note.read_text() if (note := tmp_path / "run.mcap.guardian").exists() else ""):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    assert read_run(tmp_path / "run.mcap.part").pressure is not None


def test_a_guarded_controller_is_used_like_any_other(
    emulation: Emulation, short: PressureProtocol, sets: Sets, tmp_path: Path
) -> None:
    with GuardedController("ob1-mk4", emulation.url) as controller:
        outcome = run_protocol(controller, short, tmp_path / "run.mcap")
        with pytest.raises(LimitError, match="nothing was sent"):
            controller.set_pressure(1, 61e3)
    run = read_run(tmp_path / "run.mcap")
    # a busy machine may hold the emulator up past the reply's deadline: every miss is then an event of the run
    assert outcome.missed == [event.kind for event in run.events].count("fault") < outcome.cycles
    assert run.metadata["firmware"] == "1.4.1"
    assert run.metadata["guardian"] == "heartbeat 2 s"
    assert run.metadata["exit_status"] == "success"
    assert min(sets()) == -250
    assert sets()[-1] == 0
    assert not (tmp_path / "run.mcap.guardian").exists()
    with pytest.raises(LinkLostError, match="not open"):
        controller.read()


@posix
def test_ctrl_c_counts_while_a_question_waits_for_its_answer_within_a_search_that_holds_signals_back(
    controller: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    keyboard, fingers = os.pipe()
    with os.fdopen(keyboard) as stdin, os.fdopen(fingers, "wb") as typing:
        monkeypatch.setattr("sys.stdin", stdin)
        os.write(fingers, b" yes \nno\n")
        assert [answered(controller, "did it snap?") for _ in range(2)] == ["yes", "no"]
        timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with Interrupts() as held_back:
            with pytest.raises(KeyboardInterrupt):
                answered(controller, "did it snap?")
            held_back.check()  # it was heard once, and is not heard again during the vent
        timer.join()
        typing.write(b"\n")  # lets the listener go
        typing.flush()
        time.sleep(0.1)


def test_a_guardian_that_was_told_to_close_ends_in_peace_while_its_script_still_holds_the_line(
    emulation: Emulation,
) -> None:
    controller = GuardedController("ob1-mk4", emulation.url)
    controller.open()
    process = controller._process
    assert process is not None
    controller._call("close")
    assert process.wait(10.0) == 0  # nothing it still listens to is torn away from under it
    controller.is_open = False
    controller._close()


def test_limits_hold_in_the_guardian_whatever_a_script_does_to_its_own_objects(
    emulation: Emulation, sets: Sets
) -> None:
    with GuardedController("ob1-mk4", emulation.url, limits=PressureLimits(-20e3, 20e3)) as controller:
        controller._limits = PressureLimits(-90e3, 90e3)  # malice, or a bug
        with pytest.raises(LimitError, match="below the limit of -20 kPa"):
            controller.set_pressure(1, -30e3)
        with pytest.raises(LimitError, match="above the limit"):
            controller._send(1, 30e3)
    assert set(sets()) == {0}


def test_a_port_that_does_not_open_is_told_through_the_guardian_in_one_line() -> None:
    with pytest.raises(RigError, match="does not open") as caught:
        GuardedController("ob1-mk4", "socket://127.0.0.1:1").open()
    assert "\n" not in str(caught.value)
