"""Alicat PC/PCD pressure controller, ASCII on a serial port: the grammar as pure functions, and the driver.

Source: Alicat's serial primer. A request is the unit's letter, a command and a carriage return; the answer to a poll
(``A``) and to a setpoint (``AS5.44``) is a frame: the letter, the values, then status words. A pressure controller's
frame is pressure and setpoint; a mass controller's that regulates pressure is pressure, temperature, volume flow, mass
flow, setpoint, gas. ``?`` is a refusal. The unit of the pressures, and that they are gauge, is a setting of the
instrument that no frame repeats: give it as ``unit_pa``.
"""

from __future__ import annotations

import re
import time
from typing import Any, NamedTuple

from straw.rig.errors import NoAnswerError, RigError
from straw.rig.limits import PressureLimits
from straw.rig.line import Line
from straw.rig.line_controller import LineController, Mark
from straw.rig.reading import Answer

CR = b"\r"
NUMBER = re.compile(r"[+-]?\d{1,5}\.\d{1,4}")
STATUS = frozenset(["TOV", "MOV", "VOV", "POV", "OVR", "HLD", "VTM", "LCK"])
DISTRUSTED = {"POV": "the pressure is beyond its sensor", "OVR": "a value is beyond its sensor"}
# position of the setpoint, by the number of values; pressure is always the first
SETPOINT_AT = {2: 1, 4: 3, 6: 4, 7: 4}
MODEL = re.compile(rb"[A-Z] M00 [ -~]*\r")
ROW = re.compile(rb"[A-Z] [MD]\d\d [ -~]*\r")  # of the tables that describe it
REFUSED = b"?\r"
QUIET_S = 0.03  # longer than any pause between two lines of a table: 57 bytes on the slowest common line
#: Registers that the PyPI package alicat reads from all controllers: what is controlled, and the gains of its loop.
REGISTERS = (122, 21, 22, 23)


def marks_of(unit: str) -> list[Mark]:
    """Requests whose answers cannot be mistaken for a frame: registers, and the tables for firmware that has none."""
    registers: list[Mark] = [
        (f"{unit}R{n}".encode() + CR, re.compile(rf"{unit} +0*{n} *= *-?\d+\s*\r".encode())) for n in REGISTERS
    ]
    return [*registers, *((f"{unit}??{t}*".encode() + CR, re.compile(f"{unit} {t}00 [ -~]*\r".encode())) for t in "MD")]


def encode_set(unit: str, setpoint: float, decimals: int) -> bytes:
    """The request that sets a setpoint, in the instrument's own unit of pressure."""
    return f"{unit}S{setpoint:.{decimals}f}".encode() + CR


class Frame(NamedTuple):
    """One answer: pressure and setpoint in the instrument's unit, status words, and the raw bytes."""

    pressure: float
    setpoint: float
    status: frozenset[str]
    raw: bytes


def decode_frame(reply: bytes, unit: str) -> Frame:
    """The frame in a reply; RigError when it is damaged or a refusal."""
    text = reply.decode("ascii", errors="replace").strip("\r\n ")
    if text.endswith("?"):
        raise RigError(f"Alicat refused: {text!r}; check the range, and that its setpoint source is serial")
    words = text.split()
    values = [word for word in words[1:] if word not in STATUS]
    status = frozenset(words[1:]) & STATUS
    numbers = values[:-1] if len(values) in (6, 7) else values  # the last one names the gas
    if not words or words[0] != unit or len(values) not in SETPOINT_AT or not all(map(NUMBER.fullmatch, numbers)):
        raise NoAnswerError(f"Alicat sent a damaged frame {reply!r}; it was not used")
    return Frame(float(values[0]), float(values[SETPOINT_AT[len(values)]]), status, reply)


class Alicat(LineController):
    """Driver of one Alicat on ``port`` (name, by-id path or ``socket://host:port``); one channel.

    ``unit`` is its letter on the line, ``unit_pa`` what one of its pressure units is in Pa (kPa by default),
    ``span_pa`` its range (Pa gauge), ``decimals`` the digits of a setpoint.
    """

    name = "alicat"
    terminator = CR

    def __init__(
        self,
        port: str,
        *,
        unit: str = "A",
        unit_pa: float = 1000.0,
        span_pa: tuple[float, float] = (-100e3, 100e3),
        decimals: int = 2,
        baud: int = 19200,
        timeout_s: float = 0.3,
        **settings: Any,
    ) -> None:
        self.unit, self.unit_pa, self.decimals = unit, unit_pa, decimals
        self.span = PressureLimits(*span_pa)
        self.resolution_pa = unit_pa * 10.0**-decimals
        self.byte_s = 10 / baud
        self.marks = marks_of(unit)
        super().__init__(Line(port, baud=baud), timeout_s, **settings)
        if self.channels != (1,) or not re.fullmatch("[A-Z]", unit):
            raise RigError(
                f"Alicat {unit!r}, channels {self.channels}: its unit is one letter, and its only channel is 1"
            )
        self.model = ""

    def _identify(self) -> None:
        """Request the table that identifies it; nothing may be sent while the table's lines arrive."""
        self._line.drain()
        self._line.write(self.unit.encode() + b"??M*" + CR)
        deadline_s = time.monotonic() + self.timeout_s
        while not MODEL.fullmatch(reply := self._line.read_until(CR, self.timeout_s)):
            if time.monotonic() > deadline_s:
                raise NoAnswerError(
                    f"Alicat answered {reply!r} when asked for its model; check unit letter, port and baud"
                )
        self.model = reply.decode("ascii", errors="replace").strip()
        self._line.quiet(QUIET_S)

    def _is_whole(self, reply: bytes) -> bool:
        if reply == REFUSED or ROW.fullmatch(reply) or any(answer.fullmatch(reply) for _, answer in self.marks):
            return True
        try:
            decode_frame(reply, self.unit)
        except RigError:
            return False
        return True

    def _exchange(self, request: bytes) -> bytes:
        deadline_s = time.monotonic() + self.timeout_s
        reply = self._line.exchange(request, CR, self.timeout_s)
        while ROW.fullmatch(reply):  # the rest of a table that served as a mark
            reply = self._line.read_until(CR, deadline_s - time.monotonic())
        decode_frame(reply, self.unit)  # a damaged line may be the beginning of another
        return reply

    def _send(self, channel: int, pressure_pa: float) -> bytes:
        request = encode_set(self.unit, pressure_pa / self.unit_pa, self.decimals)
        reply = self._ask(request)
        self._confirm(request, reply)
        return reply

    def _confirm(self, request: bytes, reply: bytes) -> None:
        frame = decode_frame(reply, self.unit)
        if request[1:2] != b"S":
            return
        wanted = float(request[2:])
        if abs(frame.setpoint - wanted) > 0.5 * 10.0**-self.decimals:
            raise RigError(f"Alicat shows a setpoint of {frame.setpoint:g} when told {wanted:g}; check range and cable")
        if "HLD" in frame.status:
            raise RigError("Alicat holds its valves (HLD), so the setpoint does nothing; cancel the hold on its panel")

    def _read(self) -> Answer:
        frame = decode_frame(self._ask(self.unit.encode() + CR), self.unit)
        for word in frame.status & DISTRUSTED.keys():
            raise RigError(f"Alicat reports {word}: {DISTRUSTED[word]}; the reading {frame.pressure:g} was not used")
        return Answer({1: frame.pressure * self.unit_pa}, frame.raw)

    def _vent_requests(self, channel: int) -> tuple[bytes, bytes]:
        """Cancel a hold, which would keep the valves where they are, and set 0."""
        return self.unit.encode() + b"C" + CR, encode_set(self.unit, 0.0, self.decimals)

    def snapshot(self) -> dict[str, str]:
        """Model, port and settings, as strings for the record."""
        return {
            "controller": self.name,
            "model": self.model,
            "port": self._line.port,
            "channels": "1",
            "limits": str(self.limits),
            "unit_pa": f"{self.unit_pa:g}",
        }


CONTROLLER = Alicat
