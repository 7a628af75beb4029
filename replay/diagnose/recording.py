"""The interface of a recording for the diagnosis: its channels, its samples, its events and parts."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """One measured signal: its name in files with the unit, and its display name and unit."""

    name: str  # x_m
    symbol: str  # X
    shown_unit: str  # mm
    shown_per_si: float = 1.0  # 1000

    @property
    def label(self) -> str:
        """Label of an axis."""
        return f"{self.symbol} / {self.shown_unit}"

    @property
    def short(self) -> str:
        """Its name in findings: without the unit."""
        return self.name.split("_")[0]


@dataclass(frozen=True)
class Stretch:
    """A part of a recording with its own events: its name, times (s), and the event it belongs to."""

    phase: str
    from_s: float
    to_s: float
    event: int = 0  # numbered from 1; 0 where nothing happens
    during: bool = False  # whether it lasts up to the event's end, so that the event's place is informative


class Recording(Protocol):
    """One run: ``seen`` (channels, n), SI, at stamped times ``time_s`` (n,)."""

    @property
    def name(self) -> str:
        """The run's name."""

    @property
    def time_s(self) -> Floats:
        """Stamped times, s, (n,)."""

    @property
    def seen(self) -> Floats:
        """Values of the channels, SI, (channels, n)."""

    @property
    def events_s(self) -> Floats:
        """Times at which events begin and end in turn, (k,), s; empty without events."""

    @property
    def kind(self) -> Hashable:
        """Recordings of one kind may stand for each other when some are held out."""

    def sigma(self) -> Floats:
        """Noise and lack of repeatability, SI, (channels, n)."""

    def floor(self) -> Floats:
        """Noise to compare a fit with, SI, (channels, n)."""

    def stretches(self) -> list[Stretch]:
        """Its parts, in order."""

    def conditions(self) -> Mapping[str, float]:
        """Conditions of the run by name, with which constants may correlate from run to run."""
