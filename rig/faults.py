"""Seeded faults on the wire, as from loose plugs, noise and faulty firmware: repeatable and logged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from straw.rig.emulator import Emulator
from straw.rig.wire import Sent

KINDS = ("garble", "truncate", "merge", "late", "nak", "silence", "deaf", "zero", "unplug", "reboot")
BANNER = b"\x00\xff boot 1.4.1 \x00"


@dataclass(frozen=True)
class Fault:
    """One injected fault: when (s, the device's time), which, and what was sent instead of the true answer."""

    time_s: float
    kind: str
    request: bytes
    truth: bytes
    sent: bytes


class SeededFaults:
    """Corrupts a share ``rate`` of all exchanges; equal seeds give equal faults. ``log`` lists every one.

    garble: one to three bytes are replaced. truncate: the end is lost. merge: the terminator is lost, so that the next
    answer follows on the same line. late: after the timeout. nak: refused. silence: executed, not answered. deaf:
    neither. zero: a well-formed answer with zeros in it. unplug: the port is gone for ``away_s``. reboot: the device
    loses its commands, ignores requests for ``away_s``, and sends noise at the end.
    """

    def __init__(
        self,
        rate: float,
        *,
        seed: int = 0,
        kinds: Sequence[str] = KINDS,
        late_s: tuple[float, float] = (0.0, 1.0),
        away_s: float = 0.5,
    ) -> None:
        self.rate, self.kinds, self.late_s, self.away_s = rate, tuple(kinds), late_s, away_s
        self.log: list[Fault] = []
        self._random = np.random.default_rng(seed)
        self._deaf_until_s = -np.inf
        self._greeting = b""

    def answer(self, device: Emulator, line: bytes, time_s: float) -> Sent:
        """What the wire brings back for this request line."""
        if time_s < self._deaf_until_s:
            self.log.append(Fault(time_s, "rebooting", line, b"", b""))
            return Sent(b"")
        kind = self.kinds[self._random.integers(len(self.kinds))] if self._random.random() < self.rate else ""
        if kind == "deaf":
            truth, sent = b"", Sent(b"")
        elif kind == "nak":
            truth, sent = b"", Sent(device.refusal(line))
        elif kind == "reboot":
            device.reboot(time_s)
            self._deaf_until_s, self._greeting = time_s + self.away_s, BANNER
            truth, sent = b"", Sent(b"")
        else:
            truth = device.answer(line, time_s)
            zeroed = device.zeroed(line, time_s) if kind == "zero" else truth
            sent = self._spoilt(kind, zeroed, device.terminator)
        sent = Sent(self._greeting + sent.data if sent.data else b"", sent.late_s, sent.away_s)
        if sent.data:
            self._greeting = b""
        if kind:
            self.log.append(Fault(time_s, kind, line, truth, sent.data))
        return sent

    def _spoilt(self, kind: str, truth: bytes, terminator: bytes) -> Sent:
        random = self._random
        if kind == "garble" and truth:
            data = bytearray(truth)
            for at in random.integers(len(data), size=random.integers(1, 4)):
                data[at] = random.integers(256)
            return Sent(bytes(data))
        if kind == "truncate":
            return Sent(truth[: random.integers(len(truth) + 1)])
        if kind == "merge":
            return Sent(truth.removesuffix(terminator))
        if kind == "late":
            return Sent(truth, late_s=random.uniform(*self.late_s))
        if kind == "silence":
            return Sent(b"")
        if kind == "unplug":
            return Sent(b"", away_s=self.away_s)
        return Sent(truth)
