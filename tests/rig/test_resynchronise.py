"""After silence and late or corrupted answers, no answer to an earlier request is taken for the present one's."""

import pytest

from straw.rig.emulator import Emulator
from straw.rig.errors import RigError
from straw.rig.faults import SeededFaults
from straw.rig.wire import Sent
from tests.rig.stepped_port import PROMPT, Delays, stepped

# All but "zero", which looks like a right answer, and "unplug", which this port cannot do. Garbled and cut answers that
# are well-formed count as answers, since readings are compared with what was sent.
KINDS = ("garble", "truncate", "merge", "late", "nak", "silence", "deaf", "reboot")


def test_no_answer_to_an_unconfirmed_vent_is_taken_for_the_next_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    """The vent is repeated while the answer to an earlier mark is in flight: that answer confirms less."""

    class LateOnce:
        """The first cancelled hold is not answered, and the mark after it 80 ms late."""

        cancels = marks = 0

        def answer(self, device: Emulator, line: bytes, time_s: float) -> Sent:
            answer = device.answer(line, time_s)
            self.cancels += line == b"AC\r"
            if self.cancels == 1 and line == b"AC\r":
                return Sent(b"")
            self.marks += self.cancels > 0 and line[1:2] in b"R?"
            return Sent(answer, late_s=0.08 if self.marks == 1 and line[1:2] in b"R?" else 0.0)

    controller, port = stepped(monkeypatch, "alicat", LateOnce())
    controller.open()
    for _ in range(5):
        assert controller.read()[0].raw == port.asked[-1][1]


@pytest.mark.parametrize("name", ["alicat", "ob1-mk4"])
@pytest.mark.parametrize(
    "delays",
    [
        PROMPT,
        Delays(driver_share=0.01, driver_s=0.1),
        Delays(answer_share=0.1, answer_s=0.15),
        Delays(driver_share=0.01, driver_s=0.15, answer_share=0.3, answer_s=0.1),
    ],
    ids=["on time", "busy computer", "slow instrument", "both"],
)
def test_every_reading_answers_the_last_request_however_slow_computer_and_instrument_are(
    monkeypatch: pytest.MonkeyPatch, name: str, delays: Delays
) -> None:
    faults = SeededFaults(0.05, seed=1, kinds=KINDS, late_s=(0.0, 0.18), away_s=0.15)
    controller, port = stepped(monkeypatch, name, faults, delays)
    is_open, good, stale = False, 0, []
    for k in range(1500):
        try:
            if not is_open:
                controller.open()
                is_open = True
            if k % 25 == 0:
                controller.set_pressure(1, 500.0 * (k % 41 - 20))
                continue
            reading = controller.read()[0]
            good += 1
            if not port.asked[-1][1].endswith(reading.raw):
                stale.append((k, reading.raw, port.asked[-4:]))
        except RigError:
            if k % 20 == 0:
                is_open = controller.is_open = False
                controller._close()
    assert stale == []
    assert good > 600


@pytest.mark.parametrize("name", ["alicat", "ob1-mk4"])
def test_communication_resumes_soon_after_a_long_silence_of_the_instrument(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    class Silent:
        """No answers between two times, s."""

        from_s = to_s = 0.0

        def answer(self, device: Emulator, line: bytes, time_s: float) -> Sent:
            return Sent(b"" if self.from_s <= time_s < self.to_s else device.answer(line, time_s))

    silent = Silent()
    controller, port = stepped(monkeypatch, name, silent, timeout_s=0.3)
    controller.open()
    for silence_s in (0.5, 1.5, 2.5, 3.5, 4.5, 20.0):
        silent.from_s = port.clock.monotonic_s()
        silent.to_s = silent.from_s + silence_s
        while True:
            try:
                assert controller.read()[0].raw == port.asked[-1][1]
                break
            except RigError:
                assert (
                    port.clock.monotonic_s() < silent.to_s + 2.6
                )  # LATE_S, the longest delay of an answer that is waited for
        assert port.clock.monotonic_s() > silent.to_s
