"""ELVEFLOW OB1 MK4 as seen at its port: the wire grammar (source: rig/controllers/ob1_mk4.py), no pressure physics."""

from __future__ import annotations

import re
from collections.abc import Mapping

from straw.rig.emulator import Emulator
from straw.rig.plant import Plant

SET = re.compile(r"<PRESS!:([0-3]):(-?\d{1,5})")
TRIGGER_SET = re.compile(r"<TRIGO!([01])")


class Ob1Mk4Emulator(Emulator):
    """A refusal is ``>KEYWD?|KO|``, as the real form is not public. Flow sensors are of type 1."""

    terminator = b"\n"
    baud = 115200

    def __init__(self, plants: Mapping[int, Plant], firmware: str = "1.4.1") -> None:
        super().__init__(plants)
        self.firmware = firmware
        self.trigger_out = 0

    def answer(self, line: bytes, time_s: float) -> bytes:
        """The reply line to one request line, given the plant's time in seconds; no reply to anything that is no
        request."""
        request = line.decode("ascii", errors="replace").strip()
        if not re.fullmatch(r"<[A-Z]{5}[?!].*", request):
            return b""
        value = self._value(request, time_s)
        return self.refusal(line) if value is None else f">{request[1:7]}|OK|{value}\n".encode()

    def refusal(self, line: bytes) -> bytes:
        """The answer that refuses."""
        return b">" + line[1:7] + b"|KO|\n"

    def _value(self, request: str, time_s: float) -> str | None:
        if request == "<FIRMV?":
            return self.firmware
        if request == "<PINGA?":
            return ":".join(self._shown(channel, time_s) for channel in (1, 2, 3, 4))
        if request in ("<TRIGI?", "<TRIGO?"):
            return "0" if request == "<TRIGI?" else str(self.trigger_out)
        if match := TRIGGER_SET.fullmatch(request):
            self.trigger_out = int(match[1])
            return match[1]
        if match := SET.fullmatch(request):
            channel, mbar = int(match[1]) + 1, int(match[2])
            if channel in self.plants:
                self.plants[channel].command(time_s, mbar * 100.0)
                return f"{match[1]}:{mbar}"
        return None

    def _shown(self, channel: int, time_s: float) -> str:
        """Regulator in mbar, flow in ul/min and the type of its sensor."""
        if channel not in self.plants:
            return "0:0:0"
        plant = self.plants[channel]
        return f"{round(plant.reading(time_s) / 100.0)}:{round(plant.flow(time_s) * 60e9)}:1"


EMULATOR = Ob1Mk4Emulator
