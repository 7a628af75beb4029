"""ELVEFLOW OB1 MK4 on its serial port: the UART grammar as pure functions, and the driver that speaks it.

Source: micro-manager/mmCoreAndDevices ``DeviceAdapters/Elveflow/ob1_mk4.cpp`` and micro-manager.org/Elveflow, the only
public description. A request is ``<`` + keyword of five letters + ``?`` or ``!`` + parameters + newline, the answer one
line that starts with ``>``. Not public, so settable in ``Dialect``: the words between keyword and values, the
form of a refusal, the units of the readings. There is no checksum, no vent command and no watchdog: venting is setting
0.
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from typing import Any

from straw.rig.errors import NoAnswerError, RigError
from straw.rig.limits import PressureLimits
from straw.rig.line import Line
from straw.rig.line_controller import LineController
from straw.rig.reading import Answer

FIRMWARE = b"<FIRMV?\n"
READ_ALL = b"<PINGA?\n"
CHANNELS = 4
BAUD = 115200
NUMBER = re.compile(r"-?\d{1,6}(\.\d{1,6})?")
ANSWER = re.compile(rb">[A-Z]{5}[?!]\W[ -~]*\n")
MARKS = [
    (request, re.compile(b">" + re.escape(request[1:7]) + rb"\W[ -~]*\n"))
    for request in (FIRMWARE, b"<TRIGI?\n", b"<TRIGO?\n")
]
ECHO = re.compile(r"[0-4]:-?\d+")


@dataclass(frozen=True)
class Dialect:
    """What the public sources leave open, with the inferred answer as default.

    ``ok`` follows the keyword in every good answer; ``first_channel`` is the instrument's number of its first channel;
    ``reading_unit_pa`` is the unit of the regulator values (mbar), ``flow_unit_m3_s`` that of a flow sensor (ul/min).
    """

    ok: str = "OK"
    separator: str = "|"
    first_channel: int = 0
    reading_unit_pa: float = 100.0
    flow_unit_m3_s: float = 1e-9 / 60


def encode_set(channel: int, pressure_pa: float, dialect: Dialect = Dialect()) -> bytes:
    """The request that sets a channel (from 1) to a whole number of mbar."""
    mbar = round(pressure_pa / 100.0)
    if not 1 <= channel <= CHANNELS or abs(mbar * 100.0 - pressure_pa) > 1e-6:
        raise RigError(f"OB1 MK4 cannot be told channel {channel}, {pressure_pa!r} Pa: channels 1..4, whole mbar")
    return f"<PRESS!:{channel - 1 + dialect.first_channel}:{mbar}\n".encode()


def is_answer_to(request: bytes, reply: bytes) -> bool:
    """Whether the reply carries the keyword of the request; a late reply does not."""
    return reply[:1] == b">" and reply[1:7] == request[1:7]


def decode_payload(reply: bytes, dialect: Dialect = Dialect()) -> str:
    """What follows ``>KEYWD?|OK|``; RigError when the instrument refused or the line is damaged."""
    text = reply.decode("ascii", errors="replace").strip()
    head, *rest = text.split(dialect.separator)
    if not re.fullmatch(r">[A-Z]{5}[?!]", head) or not rest:
        raise NoAnswerError(
            f"OB1 MK4 answered {text!r}, which is not its grammar; check port and firmware (1.4.1 or later)"
        )
    if rest[0] != dialect.ok:
        raise RigError(f"OB1 MK4 refused: {text!r}; check channel and pressure range")
    return dialect.separator.join(rest[1:])


def decode_readings(reply: bytes, dialect: Dialect = Dialect()) -> Answer:
    """Regulators (Pa) and flow sensors by channel (from 1) of ``reg0:sens0:type0:...:reg3:sens3:type3``.

    A sensor of type 0 is none. RigError when the line is damaged.
    """
    fields = decode_payload(reply, dialect).split(":")
    if len(fields) != 3 * CHANNELS or not all(map(NUMBER.fullmatch, fields)):
        raise NoAnswerError(f"OB1 MK4 sent a damaged reading {reply!r}; it was not used")
    regulators, sensors, kinds = (dict(enumerate(map(float, fields[k::3]), 1)) for k in range(3))
    return Answer(
        {channel: value * dialect.reading_unit_pa for channel, value in regulators.items()},
        reply,
        {channel: value * dialect.flow_unit_m3_s for channel, value in sensors.items() if kinds[channel]},
    )


class Ob1Mk4(LineController):
    """Driver of an OB1 MK4 on ``port`` (name, by-id path or ``socket://host:port``); pressures in whole mbar.

    ``range_mbar`` is the regulators', which the instrument does not report; ``limits`` default to what the straw
    withstands and are never wider. ``sigma_pa`` is the standard uncertainty of one reading, NaN when unknown.
    """

    name = "ob1-mk4"
    resolution_pa = 100.0
    byte_s = 10 / BAUD  # 8N1: ten bits
    terminator = b"\n"
    marks = MARKS

    def __init__(
        self,
        port: str,
        *,
        timeout_s: float = 0.5,
        range_mbar: tuple[float, float] = (-900.0, 1000.0),
        dialect: Dialect = Dialect(),
        **settings: Any,
    ) -> None:
        self.span = PressureLimits(range_mbar[0] * 100.0, range_mbar[1] * 100.0)
        super().__init__(Line(port, baud=BAUD), timeout_s, **settings)
        if not set(self.channels) <= set(range(1, CHANNELS + 1)):
            raise RigError(f"OB1 MK4 has channels 1..{CHANNELS}, not {self.channels}")
        self.dialect = dialect
        self.firmware = ""

    def _identify(self) -> None:
        self.firmware = decode_payload(self._exchange(FIRMWARE), self.dialect)

    def _is_whole(self, reply: bytes) -> bool:
        return ANSWER.fullmatch(reply) is not None

    def _exchange(self, request: bytes) -> bytes:
        deadline = time.monotonic() + self.timeout_s
        reply = self._line.exchange(request, b"\n", self.timeout_s)
        while not is_answer_to(request, reply):
            left_s = deadline - time.monotonic()
            if left_s <= 0.0:
                raise NoAnswerError(f"OB1 MK4 answered {reply!r} to {request!r}; check port, cable and firmware")
            reply = self._line.read_until(b"\n", left_s)
        return reply

    def _send(self, channel: int, pressure_pa: float) -> bytes:
        request = encode_set(channel, pressure_pa, self.dialect)
        reply = self._ask(request)
        self._confirm(request, reply)
        return reply

    def _confirm(self, request: bytes, reply: bytes) -> None:
        echo, told = decode_payload(reply, self.dialect), request.decode().strip().partition(":")[2]
        # That it echoes the command is inferred; where it does, a command that was garbled on the way shows.
        if ECHO.fullmatch(echo) and echo != told:
            raise RigError(f"OB1 MK4 understood {echo} when {told} was sent; check the cable")

    def _read(self) -> Answer:
        return decode_readings(self._ask(READ_ALL), self.dialect)

    def _vent_requests(self, channel: int) -> tuple[bytes]:
        return (encode_set(channel, 0.0, self.dialect),)

    def _trigger(self, high: bool) -> None:
        decode_payload(self._ask(b"<TRIGO!%d\n" % high), self.dialect)

    def snapshot(self) -> dict[str, str]:
        """Firmware, port and settings, as strings for the record."""
        return {
            "controller": self.name,
            "firmware": self.firmware,
            "port": self._line.port,
            "channels": ",".join(map(str, self.channels)),
            "limits": str(self.limits),
            "range": str(self.span),
            "dialect": str(self.dialect),
        }


CONTROLLER = Ob1Mk4
