"""An operator holds, resumes, stops and vents a run from another thread or process; every end vents and is recorded."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from straw.rig import operator as operator_module
from straw.rig.controller import Controller
from straw.rig.errors import RigError
from straw.rig.operator import Operator, StoppedError
from straw.rig.orders import Orders, control_of, running, send_order
from straw.rig.protocol import PressureProtocol
from straw.rig.run_read import read_run
from straw.rig.session import run_protocol


class TimedOrders(Operator):
    """Gives each order once, at its delay (s) after the start or the previous order, on however slow a machine."""

    def __init__(self, *orders: tuple[float, str]) -> None:
        super().__init__()
        self.waiting, self.last_s = list(orders), 0.0

    def heard(self, now_s: float, *_: object) -> None:
        if self.waiting and now_s - self.last_s >= self.waiting[0][0]:
            self.last_s = now_s
            self.order(self.waiting.pop(0)[1], "Ada")


def test_a_hold_keeps_the_pressure_and_the_protocol_continues_where_it_was_held(
    controller: Controller, short: PressureProtocol, tmp_path: Path
) -> None:
    person = TimedOrders((0.2, "hold"), (0.3, "resume"))
    outcome = run_protocol(controller, short, tmp_path / "run.mcap", operator=person)
    run = read_run(outcome.path)
    times = {event.kind: event.time_s for event in run.events if event.kind in ("hold", "resume", "stop")}
    # However late the cycles of a busy machine are, the protocol takes its own duration plus the time it was held.
    assert times["stop"] + short.zero_s >= short.duration_s + person.held_s - 1e-3
    assert person.held_s > 0.15
    assert run.pressure is not None
    held = (run.pressure.time_s > times["hold"]) & (run.pressure.time_s < times["resume"])
    assert held.sum() > 1  # readings are recorded during the hold
    assert outcome.stopped == ""


@pytest.mark.parametrize("how", ["stop", "vent"])
def test_a_stop_vents_and_records_who_gave_it(
    controller: Controller, short: PressureProtocol, tmp_path: Path, how: str, sets: Callable[[], list[int]]
) -> None:
    outcome = run_protocol(controller, short, tmp_path / "run.mcap", operator=TimedOrders((0.2, how), (0.2, "resume")))
    run = read_run(outcome.path)
    assert sets()[-2:] == [-250, 0]
    assert outcome.stopped.endswith("by Ada")
    assert (run.metadata["exit_status"], run.metadata["vent"]) == ("abort", "confirmed")
    assert outcome.stopped == run.metadata["exit_reason"]


def test_a_vent_cannot_be_revoked_and_a_second_one_changes_nothing() -> None:
    person = Operator()
    assert person.order("vent", "Ada") == "ending"
    assert person.order("resume", "Bea") == "ending"
    assert person.order("vent", "Bea") == "ending"
    with pytest.raises(StoppedError, match="vented by Ada"):
        person.check()
    with pytest.raises(RigError, match="unknown"):
        person.order("explode", "Bea")


def test_a_hold_that_is_not_ended_in_time_is_ended_by_venting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operator_module, "LONGEST_HOLD_S", 10.0)
    person = Operator()
    person.order("hold", "Ada")
    assert person.protocol_s(1.0) == person.protocol_s(10.9) == 1.0
    with pytest.raises(StoppedError, match="held"):
        person.protocol_s(11.1)


def test_another_process_finds_the_run_and_its_orders_need_the_ticket(tmp_path: Path) -> None:
    recording, person = tmp_path / "run.mcap", Operator()
    with Orders(recording, person, {"protocol": "fold"}):
        control = control_of(recording)
        assert control.stat().st_mode & 0o077 == 0
        found = running(recording.with_name("run.mcap.part"))
        assert found is not None
        assert (found["protocol"], found["state"]) == ("fold", "running")
        forged = control.read_text().replace(found["ticket"], "guess")
        other = tmp_path / "other.control"
        other.write_text(forged)
        with pytest.raises(RigError, match="does not answer"):
            send_order(other, "vent")
        assert send_order(control, "hold", "Ada") == "held"
        began_s = time.monotonic()
        assert send_order(control, "vent", "Ada") == "ending"
        assert time.monotonic() - began_s < 0.1
    assert not control.exists()
    assert running(recording) is None
