"""The model beside a running rig: moved on by every reading, remembered for the page."""

from __future__ import annotations

import math
import threading
from typing import Any

import numpy as np

from model.configuration import even
from model.parameters import StrawParameters
from model.simulate import Stepper
from replay.report.data import SHOWN
from rig.protocol import PressureProtocol

#: Longest step of the model at a time, s: a gap in the readings is passed in such pieces.
STEP_S = 0.05


class Follower:
    """Predicts a run as it goes on. Rows are what the page shows, see ``COLUMNS``; safe to read from other threads."""

    COLUMNS = ("time", "measured", "command", "inside", "x_m", "z_m", "phi_rad", "zeta", "phi")

    def __init__(self, straw: StrawParameters, protocol: PressureProtocol) -> None:
        self.straw, self.protocol = straw, protocol
        self.stepper = Stepper(straw, protocol.initial_deployed)
        self.rows: list[tuple[Any, ...]] = []
        self.ended = threading.Event()
        self._before_pa = 0.0

    def reading(self, time_s: float, measured_pa: float) -> None:
        """Move the model on to a reading, seconds since the protocol's start; NaN ends the run."""
        if math.isnan(time_s):
            self.ended.set()
            return
        start_s = self.stepper.time_s
        if time_s > start_s:
            pieces = max(1, math.ceil((time_s - start_s) / STEP_S))
            times_s = np.linspace(start_s, time_s, pieces + 1)[1:].tolist()
            pressures_pa = np.linspace(self._before_pa, measured_pa, pieces + 1).tolist()
            for at_s, low_pa, high_pa in zip(times_s, pressures_pa, pressures_pa[1:], strict=False):
                self.stepper.advance(at_s, low_pa, high_pa)
        self._before_pa = measured_pa
        self.rows.append(self._row(time_s, measured_pa))

    def _row(self, time_s: float, measured_pa: float) -> tuple[Any, ...]:
        stepper = self.stepper
        tip = (value * factor for value, (_, _, factor) in zip(stepper.tip, SHOWN.values(), strict=True))
        zeta, phi = even(self.straw, stepper._state.q)  # the odd frusta are drawn as they were made
        return (
            round(time_s - self.protocol.zero_s, 5),
            round(measured_pa / 1e3, 4),
            round(float(self.protocol(time_s)) / 1e3, 4),
            round(stepper.pressure_pa / 1e3, 4),
            *(round(value, 5) for value in tip),
            np.round(zeta, 7).tolist(),
            np.round(phi, 6).tolist(),
        )
