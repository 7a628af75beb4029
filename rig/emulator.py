"""Emulator: what all emulated devices share: a wire grammar, plants behind it, and injected faults."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

from straw.rig.plant import Plant


class Emulator(ABC):
    """One device as seen at its port: wire grammar only, no pressure physics, and time as an argument.

    ``plants`` maps channels (from 1) to whatever holds the pressure; channels without one read 0. A new emulator is
    one file in ``rig/emulators`` that ends in ``EMULATOR = ItsClass``.
    """

    terminator: ClassVar[bytes]
    baud: int

    def __init__(self, plants: Mapping[int, Plant]) -> None:
        self.plants = plants

    @abstractmethod
    def answer(self, line: bytes, time_s: float) -> bytes:
        """The reply to one request line; empty for silence."""

    @abstractmethod
    def refusal(self, line: bytes) -> bytes:
        """The answer that refuses this request."""

    def zeroed(self, line: bytes, time_s: float) -> bytes:
        """The well-formed reply when every sensor shows zero, as from a board that lost its regulators."""
        plants, self.plants = self.plants, {}
        try:
            return self.answer(line, time_s)
        finally:
            self.plants = plants

    def reboot(self, time_s: float) -> None:
        """Restart: no channel has a command."""
        for plant in self.plants.values():
            plant.hold(time_s, closed=False)
            plant.command(time_s, 0.0)
