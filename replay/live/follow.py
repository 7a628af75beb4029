"""The model beside a running rig: advanced by every reading, with a history for the page."""

from __future__ import annotations

import math
import threading
from typing import Any

import numpy as np

from straw.model.configuration import even
from straw.model.parameters import StrawParameters
from straw.model.simulate import Stepper
from straw.replay.report.data import SHOWN
from straw.rig.protocol import PressureProtocol

#: Longest step of the model at a time, s: a gap in the readings is passed in such pieces.
STEP_S = 0.05


class Follower:
    """Predicts a run in progress. Its rows are the page's, see ``COLUMNS``; safe to read from other threads."""

    COLUMNS = ("time", "measured", "command", "inside", "x_m", "z_m", "phi_rad", "zeta", "phi", "others")

    def __init__(self, straw: StrawParameters, protocol: PressureProtocol) -> None:
        self.straw, self.protocol = straw, protocol
        self.stepper = Stepper(straw, protocol.initial_deployed)
        self.rows: list[tuple[Any, ...]] = []
        self.events: list[tuple[float, str, str]] = []
        self.ended = threading.Event()
        self._before_pa = 0.0

    def take(self, message: dict[str, Any]) -> None:
        """One datagram of ``Live``: a cycle, an event, or the end."""
        if "end" in message:
            self.ended.set()
        elif "event" in message:
            self.events.append((message["t"] - self.protocol.zero_s, str(message["event"]), str(message["text"])))
        else:
            main, told = message["main"], message["told"]
            others = {
                f"{name} {channel} / {unit}": round(value * factor, 4)
                for name, unit, factor, values in (
                    ("pressure of channel", "kPa", 1e-3, message["pa"]),
                    ("command of channel", "kPa", 1e-3, told),
                    ("flow of channel", "µl/s", 1e9, message["flow"]),
                )
                for channel, value in values.items()
                if channel != main or name.startswith("flow")
            }
            self.reading(message["t"], message["pa"][main], told.get(main, math.nan), others)

    def reading(
        self, time_s: float, measured_pa: float, told_pa: float, others: dict[str, float] | None = None
    ) -> None:
        """Advance the model to a reading, seconds since the protocol's start."""
        start_s = self.stepper.time_s
        if time_s > start_s:
            pieces = max(1, math.ceil((time_s - start_s) / STEP_S))
            times_s = np.linspace(start_s, time_s, pieces + 1)[1:].tolist()
            pressures_pa = np.linspace(self._before_pa, measured_pa, pieces + 1).tolist()
            for at_s, low_pa, high_pa in zip(times_s, pressures_pa, pressures_pa[1:], strict=False):
                self.stepper.advance(at_s, low_pa, high_pa)
        self._before_pa = measured_pa
        self.rows.append(self._row(time_s, measured_pa, told_pa, others or {}))

    def _row(self, time_s: float, measured_pa: float, told_pa: float, others: dict[str, float]) -> tuple[Any, ...]:
        stepper = self.stepper
        tip = (value * factor for value, (_, _, factor) in zip(stepper.tip, SHOWN.values(), strict=True))
        zeta, phi = even(self.straw, stepper._state.q)  # the odd frusta are drawn as they were made
        return (
            round(time_s - self.protocol.zero_s, 5),
            round(measured_pa / 1e3, 4),
            round(told_pa / 1e3, 4) if math.isfinite(told_pa) else None,
            round(stepper.pressure_pa / 1e3, 4),
            *(round(value, 5) for value in tip),
            np.round(zeta, 7).tolist(),
            np.round(phi, 6).tolist(),
            others,
        )
