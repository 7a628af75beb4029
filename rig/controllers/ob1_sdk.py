"""ELVEFLOW OB1 MK3 and MK3+ through the vendor's Windows DLL: both generations of its SDK, told apart by its exports.

Source: the SDK's own Python examples (``Elveflow64.py``) and user guide. Up to 3.08.06 a calibration array of 1000
doubles goes with every set and reading; since 3.10 the library keeps it, and one call brings regulator and sensor. The
instrument is no serial port: its name is what NI MAX calls it (``01F64B3B``), given here as the port. While this runs
the Elveflow Smart Interface must not. A lost link can read as a valid-looking 0, which ``Controller.read`` refuses
where it cannot be true. Flow sensors of an MK3 are not read.
"""

from __future__ import annotations

import ctypes
import os
from pathlib import Path
from typing import Any

from straw.rig.controller import Controller
from straw.rig.errors import LinkLostError, RigError
from straw.rig.limits import PressureLimits
from straw.rig.reading import Answer

CHANNELS = 4
MBAR_PA = 100.0
CALIBRATION = 1000  # doubles
#: Pressure range (mbar) by the code of a channel's regulator; 0 is none.
REGULATORS = {1: (0.0, 200.0), 2: (0.0, 2000.0), 3: (0.0, 8000.0), 4: (-900.0, 1000.0), 5: (-900.0, 6000.0)}
OPEN_S = 10.0  # its own examples wait for some seconds
LOST = {-8030: "no communication with the instrument", -8033: "its loop does not run"}
DLL_ENV = "STRAW_ELVEFLOW_DLL"


class Ob1Sdk(Controller):
    """Driver of an OB1 MK3/MK3+ called ``port``; ``regulators`` are the codes of its four channels.

    ``dll`` is the path of ``Elveflow64.dll`` (or set STRAW_ELVEFLOW_DLL). ``calibration`` is a file that the Elveflow
    software saved; without one the default calibration is used, with which one lab got 222 mbar for 278.
    """

    name = "ob1-sdk"
    resolution_pa = 10.0  # sent as a double; a tenth of a mbar is finer than any of its regulators

    def __init__(
        self,
        port: str,
        *,
        dll: str = "",
        regulators: tuple[int, int, int, int] = (4, 0, 0, 0),
        calibration: str = "",
        **settings: Any,
    ) -> None:
        self.port, self.dll, self.regulators, self.calibration = port, dll, regulators, calibration
        used = settings.get("channels", (1,))
        ranges = []
        for channel in used:
            code = regulators[channel - 1] if 1 <= channel <= CHANNELS == len(regulators) else None
            if code not in REGULATORS:
                raise RigError(f"OB1 channel {channel} has no regulator: codes are {regulators}, known are 1..5")
            ranges.append(REGULATORS[code])
        self.span = PressureLimits(
            max(low for low, _ in ranges) * MBAR_PA, min(high for _, high in ranges) * MBAR_PA
        )  # one range for all channels in use: the narrowest
        super().__init__(**settings)
        self._sdk: Any = None
        self._id = -1
        self._per_call = False  # the calibration goes with every call: SDK up to 3.08.06
        self._table = (ctypes.c_double * CALIBRATION)()

    def _open(self) -> None:
        path = self.dll or os.environ.get(DLL_ENV, "")
        if not path or not Path(path).is_file():
            raise RigError(f"OB1 needs the vendor's library {path or 'Elveflow64.dll'}; name it in {DLL_ENV} or dll=")
        self.progress(OPEN_S)
        try:
            self._sdk = ctypes.CDLL(path)  # cdecl, as the vendor's own examples load it
        except OSError as error:
            raise RigError(f"{path} does not load: {error}; a 64 bit Python needs the 64 bit library") from None
        self._per_call = hasattr(self._sdk, "OB1_Get_Press")
        if not self._per_call and not hasattr(self._sdk, "OB1_Get_Data"):
            raise RigError(f"{path} exports neither OB1_Get_Press nor OB1_Get_Data; it is not a known Elveflow SDK")
        number = ctypes.c_int32(-1)
        codes = [ctypes.c_uint16(code) for code in self.regulators]
        self._call("OB1_Initialization", self.port.encode("ascii"), *codes, ctypes.byref(number))
        self._id = number.value
        try:
            self._calibrate()
        except BaseException:
            self._close()
            raise

    def _calibrate(self) -> None:
        path, table, size = self.calibration.encode(), self._table, CALIBRATION
        if self.calibration and not Path(self.calibration).is_file():
            raise RigError(f"OB1 calibration {self.calibration} is not there; save one with the Elveflow software")
        if self._per_call:
            if self.calibration:
                self._call("Elveflow_Calibration_Load", path, table, size)
            else:
                self._call("Elveflow_Calibration_Default", table, size)
        elif self.calibration:
            self._call("OB1_Calib_Load", self._id, path)

    def _close(self) -> None:
        if self._sdk is not None and self._id >= 0:
            self.progress(OPEN_S)
            self._sdk.OB1_Destructor(self._id)
        self._id = -1

    def _send(self, channel: int, pressure_pa: float) -> bytes:
        extra = (self._table, CALIBRATION) if self._per_call else ()
        mbar = ctypes.c_double(pressure_pa / MBAR_PA)
        self._call("OB1_Set_Press", self._id, channel, mbar, *extra)
        return b""

    def _read(self) -> Answer:
        pressure_pa = {}
        said = []
        for channel in self.channels:
            value, sensor = ctypes.c_double(), ctypes.c_double()
            if self._per_call:
                # the first call samples all channels, the others return the sample
                acquire = int(channel == self.channels[0])
                table, size = self._table, CALIBRATION
                self._call("OB1_Get_Press", self._id, channel, acquire, table, ctypes.byref(value), size)
            else:
                self._call("OB1_Get_Data", self._id, channel, ctypes.byref(value), ctypes.byref(sensor))
            pressure_pa[channel] = value.value * MBAR_PA
            said.append(f"{channel}:{value.value!r}")
        return Answer(pressure_pa, " ".join(said).encode())

    def _vent(self, channel: int) -> None:
        self._send(channel, 0.0)

    def _trigger(self, high: bool) -> None:
        self._call("OB1_Set_Trig", self._id, int(high))

    def snapshot(self) -> dict[str, str]:
        """SDK generation, instrument and settings, as strings for the record."""
        return {
            "controller": self.name,
            "sdk": "3.08.06 or earlier" if self._per_call else "3.10 or later",
            "port": self.port,
            "channels": ",".join(map(str, self.channels)),
            "regulators": ",".join(map(str, self.regulators)),
            "calibration": self.calibration or "default",
            "limits": str(self.limits),
        }

    def _call(self, function: str, *arguments: Any) -> None:
        """Call the library; its error codes become errors that name the call."""
        if self._sdk is None or (self._id < 0 and function.startswith("OB1") and function != "OB1_Initialization"):
            raise LinkLostError(f"OB1 {self.port} is not open; open it first")
        self.progress(OPEN_S if function == "OB1_Initialization" else 0.0)
        code = getattr(self._sdk, function)(*arguments)
        if code in LOST:
            raise LinkLostError(
                f"OB1 {self.port} was lost: {LOST[code]} ({function} gave {code}); check cable and power"
            )
        if code != 0:
            raise RigError(f"OB1 {self.port}: {function} gave error {code}; see the SDK's error list, close the ESI")


CONTROLLER = Ob1Sdk
