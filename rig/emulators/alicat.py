"""Alicat pressure controller as seen at its port (source: rig/controllers/alicat.py), no pressure physics."""

from __future__ import annotations

import re
from collections.abc import Mapping

from straw.rig.emulator import Emulator
from straw.rig.errors import RigError
from straw.rig.plant import Plant

GAUGE_PRESSURE = 38  # register 122 is the controlled variable
MODEL = ("M00 www.alicat.com", "M01 Alicat Scientific", "M02 Ph  emulated", "M03 PCD-100KPAG-D", "M04 Serial 000000")
UNIT_PA, FULL_SCALE = 1000.0, 100.0
FRAMES = {"pressure": "", "mass": "Air"}  # with the gas that the frame names
BAUDS = (2400, 9600, 19200, 38400, 57600, 115200)
LOOP = {85: 1, 21: 500, 22: 3500, 23: 100}  # registers of the control loop: algorithm, P, D, I
TARES = ("V", "PC", "P")


class AlicatEmulator(Emulator):
    """A dual-valve controller in kPa gauge on channel 1, called ``unit``.

    ``frame`` "pressure": a PCD, whose frame is pressure and setpoint. "mass": an MCD that regulates pressure, whose
    frame holds temperature, flows (standard litres a minute of the line's flow) and gas as well, the frame that the
    PyPI package alicat (0.9.0) reads. ``baud`` is its line's rate.
    """

    terminator = b"\r"

    def __init__(
        self, plants: Mapping[int, Plant], unit: str = "A", frame: str = "pressure", baud: int = 19200
    ) -> None:
        super().__init__(plants)
        if frame not in FRAMES or not re.fullmatch("[A-Z]", str(unit)) or baud not in BAUDS:
            raise RigError(
                f"emulated Alicat: unit {unit!r}, frame {frame!r}, baud {baud!r}; units are letters, frames are "
                f"{' and '.join(FRAMES)}, rates {', '.join(map(str, BAUDS))}"
            )
        self.unit, self.baud = unit, baud
        self.gas = FRAMES[frame]
        self.setpoint = 0.0
        self.registers = {122: GAUGE_PRESSURE, **LOOP}
        self.ramp, self.ramps = "+0000.00 0 4 kPa/s", "0 0 0 0"
        self.held = self.locked = False

    def answer(self, line: bytes, time_s: float) -> bytes:
        """The frame, table or refusal to one request; silence to another unit's."""
        request = line.decode("ascii", errors="replace").strip("\r\n ").replace("$$", "")
        if request[:1] != self.unit:
            return b""
        reply = self._reply(request[1:].strip(), time_s)
        return self.refusal(line) if reply is None else reply.encode() + b"\r"

    def refusal(self, line: bytes) -> bytes:
        """The answer that refuses."""
        return b"?\r"

    def reboot(self, time_s: float) -> None:
        """Restart, with setpoint 0."""
        super().reboot(time_s)
        self.setpoint, self.held = 0.0, False

    def _reply(self, command: str, time_s: float) -> str | None:
        if match := re.fullmatch(r"S\s*([+-]?\d{1,6}(\.\d{1,6})?)", command):
            return self._set(float(match[1]), time_s)
        if command in ("HC", "HP", "H", "C"):
            self.held = command != "C"
            for plant in self.plants.values():
                plant.hold(time_s, self.held)
        elif command in ("L", "U"):
            self.locked = command == "L"
        elif command in TARES:
            pass  # its zero is true already
        elif match := re.fullmatch(r"SR( (\d+\.\d\d) ([3-7]))?", command):
            if match[1]:
                self.ramp = f"{float(match[2]):+08.2f} 0 {match[3]} kPa"
            return f"{self.unit} {self.ramp}"
        elif match := re.fullmatch(r"LSRC((?: [01]){4})?", command):
            self.ramps = (match[1] or self.ramps).strip()
            return f"{self.unit} {self.ramps}"
        elif command == "??M*":
            return "\r".join(f"{self.unit} {row}" for row in MODEL)
        elif command == "??D*":
            rows = [("Pressure", "kPaG"), *([("Temp", "C"), ("Vol", "LPM"), ("Mass", "SLPM")] if self.gas else [])]
            rows += [("Setpoint", "kPaG"), *([("Gas", "")] if self.gas else [])]
            return "\r".join(f"{self.unit} D{k:02d} {name} {unit}" for k, (name, unit) in enumerate(rows))
        elif command == "VE":
            return f"{self.unit}   10v05.0-R24"
        elif command == "LS":
            return f"{self.unit} {self.setpoint:+08.2f} {self.setpoint:+08.2f} 12 kPaG"
        elif match := re.fullmatch(r"[RWrw](\d+)(=(\d+))?", command):
            register = int(match[1])
            if match[3]:
                self.registers[register] = int(match[3])
            return f"{self.unit}   {register:03d} = {self.registers.get(register, 0)}"
        elif command:
            return None
        return self._frame(time_s)

    def _set(self, setpoint: float, time_s: float) -> str | None:
        if abs(setpoint) > FULL_SCALE:
            return None
        self.setpoint = round(setpoint, 2)
        if 1 in self.plants:
            self.plants[1].command(time_s, self.setpoint * UNIT_PA)
        return self._frame(time_s)

    def _frame(self, time_s: float) -> str:
        plant = self.plants.get(1)
        pressure, flow = (plant.reading(time_s) / UNIT_PA, plant.flow(time_s) * 6e4) if plant else (0.0, 0.0)
        numbers = [pressure, 25.0, flow, flow, self.setpoint] if self.gas else [pressure, self.setpoint]
        words = [f"{number:+08.2f}" for number in numbers] + ([f"{self.gas:>7}"] if self.gas else [])
        words += ["HLD"] * self.held + ["LCK"] * self.locked
        return " ".join([self.unit, *words])


EMULATOR = AlicatEmulator
