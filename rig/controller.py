"""Controller: what every pressure controller does, with the limits and the vent below every script."""

from __future__ import annotations

import importlib
import math
import pkgutil
from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass
from types import TracebackType
from typing import Any, ClassVar, Self, final

from rig.clock import Clock
from rig.errors import LinkLostError, RigError
from rig.limits import STRAW_LIMITS, PressureLimits

RATE_WINDOW_S = 0.25  # after a long hold a rate limit must not allow one long jump: credit is saved for this long only


@dataclass(frozen=True)
class Stamp:
    """When something happened: half-way between asking and the answer's first byte, sure to within half of that."""

    monotonic_ns: int
    wall_ns: int
    half_width_ns: int


@dataclass(frozen=True)
class Reading(Stamp):
    """One measured gauge pressure (Pa) of one channel, with the raw bytes it came in; sigma NaN when unknown."""

    channel: int
    pressure_pa: float
    sigma_pa: float
    raw: bytes


@dataclass(frozen=True)
class Command(Stamp):
    """One set pressure (Pa) as the instrument got it, after rounding to what it can take."""

    channel: int
    pressure_pa: float


class Controller(ABC):
    """A pressure controller. Channels are numbered from 1; pressures are gauge, in Pa.

    A driver is one file in ``rig/controllers`` that ends in ``CONTROLLER = ItsClass`` and fills in the five methods
    with an underscore. Every set passes ``set_pressure``, which no driver overrides: nothing beyond ``limits`` can
    reach the wire. ``open`` vents, so that the state is known; ``close`` vents, so that nothing stays under pressure.
    """

    name: ClassVar[str]
    span: ClassVar[PressureLimits]  # what the instrument itself can do
    resolution_pa: ClassVar[float]  # smallest step the instrument can be told
    byte_s: ClassVar[float] = 0.0  # what one byte of an answer spends on the line

    def __init__(
        self, *, channels: tuple[int, ...] = (1,), limits: PressureLimits = STRAW_LIMITS, sigma_pa: float = math.nan
    ) -> None:
        self.channels = channels
        self.limits = self.span.and_also(limits)
        self.sigma_pa = sigma_pa
        self.clock = Clock()
        self.is_open = False
        self._last: dict[int, tuple[float, float]] = {}  # channel: (monotonic s, Pa), for the rate limit

    @abstractmethod
    def _open(self) -> None:
        """Open the link and make sure the right instrument answers."""

    @abstractmethod
    def _close(self) -> None:
        """Close the link; never raises."""

    @abstractmethod
    def _send(self, channel: int, pressure_pa: float) -> None:
        """Tell the instrument one pressure, already checked and rounded, once; return when it acknowledged."""

    @abstractmethod
    def _read(self) -> tuple[dict[int, float], bytes]:
        """Pressure (Pa) of each channel the instrument reports, and the raw reply."""

    @abstractmethod
    def _vent(self, channel: int) -> None:
        """Bring one channel to ambient pressure by the safest means the instrument has."""

    @abstractmethod
    def snapshot(self) -> dict[str, str]:
        """What a record should say about the instrument: firmware, port, settings."""

    @final
    def open(self) -> None:
        """Open the link, check the instrument, and vent: a known state to start from."""
        self._open()
        self.is_open = True
        try:
            self.vent()
        except BaseException:
            self.is_open = False
            self._close()
            raise

    @final
    def close(self) -> None:
        """Vent, then close the link whatever happened; raises RigError when the vent was not acknowledged."""
        if not self.is_open:
            return
        try:
            self.vent()
        finally:
            self.is_open = False
            self._close()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        try:
            self.close()
        except RigError:
            if error is None:  # an error that is already on its way explains more than the failed vent after it
                raise

    def rounded(self, pressure_pa: float) -> float:
        """The nearest pressure (Pa) inside the limits that the instrument can be told exactly."""
        step = self.resolution_pa
        lowest, highest = math.ceil(self.limits.min_pa / step), math.floor(self.limits.max_pa / step)
        return min(max(round(pressure_pa / step), lowest), highest) * step

    @final
    def set_pressure(self, channel: int, pressure_pa: float) -> Command:
        """Command one gauge pressure (Pa); RigError, with nothing sent, when it is not within the limits."""
        self._check_channel(channel)
        if reason := self.limits.why_not(pressure_pa):
            raise RigError(f"{self.name}: {reason} (channel {channel}); nothing was sent; lower the pressure")
        pressure_pa = self.rounded(pressure_pa)
        before_ns = self.clock.monotonic_ns()
        self._check_rate(channel, pressure_pa, before_ns * 1e-9)
        self._send(channel, pressure_pa)
        self._last[channel] = (before_ns * 1e-9, pressure_pa)
        return Command(**self._stamp(before_ns), channel=channel, pressure_pa=pressure_pa)

    @final
    def read(self) -> tuple[Reading, ...]:
        """Measured pressure of every channel in use."""
        before_ns = self.clock.monotonic_ns()
        pressure_pa, raw = self._read()
        stamp = self._stamp(before_ns, len(raw))
        if missing := [channel for channel in self.channels if channel not in pressure_pa]:
            raise RigError(f"{self.name}: channel {missing[0]} is not in its reply {raw!r}; check the channel number")
        return tuple(
            Reading(**stamp, channel=channel, pressure_pa=pressure_pa[channel], sigma_pa=self.sigma_pa, raw=raw)
            for channel in self.channels
        )

    @final
    def vent(self) -> None:
        """Bring every channel in use to ambient pressure; tries each of them before it complains."""
        failures: list[str] = []
        for channel in self.channels:
            try:
                self._vent_through_any_link(channel)
                self._last[channel] = (self.clock.monotonic_ns() * 1e-9, 0.0)
            except RigError as error:
                failures.append(str(error))
        if failures:
            raise RigError(f"{self.name}: THE VENT IS NOT CONFIRMED, vent by hand now: {failures[0]}")

    def _vent_through_any_link(self, channel: int) -> None:
        try:
            self._vent(channel)
        except LinkLostError:
            if not self.is_open:
                raise
            # A loose plug may be back by now: a fresh link costs little, a straw left under pressure much.
            self._close()
            with suppress(RigError):
                self._open()
                return self._vent(channel)
            raise
        return None

    def _check_channel(self, channel: int) -> None:
        if channel not in self.channels:
            raise RigError(
                f"{self.name}: channel {channel} is not in use; open the controller with channels=({channel},)"
            )

    def _check_rate(self, channel: int, pressure_pa: float, now_s: float) -> None:
        rate = self.limits.max_rate_pa_s
        if rate is None or channel not in self._last:
            return
        last_s, last_pa = self._last[channel]
        # One step of the instrument is always allowed, or rounding alone could break a slow ramp.
        allowed_pa = rate * min(now_s - last_s, RATE_WINDOW_S) * 1.2 + 1.5 * self.resolution_pa
        if abs(pressure_pa - last_pa) > allowed_pa:
            raise RigError(
                f"{self.name}: {last_pa / 1e3:g} to {pressure_pa / 1e3:g} kPa at once breaks the limit of "
                f"{rate / 1e3:g} kPa/s (channel {channel}); nothing was sent; use a ramp"
            )

    def _stamp(self, before_ns: int, answer_bytes: int = 0) -> dict[str, Any]:
        # The instrument measured before it began to answer, and the answer's own bytes take milliseconds.
        on_the_line_ns = round(answer_bytes * self.byte_s * 1e9)
        after_ns = max(before_ns, self.clock.monotonic_ns() - on_the_line_ns)
        middle_ns = (before_ns + after_ns) // 2
        return {
            "monotonic_ns": middle_ns,
            "wall_ns": self.clock.wall_ns(middle_ns),
            "half_width_ns": (after_ns - before_ns + 1) // 2,
        }


def controller_names() -> tuple[str, ...]:
    """Names that ``make_controller`` knows: one for each file in ``rig/controllers``."""
    import rig.controllers

    return tuple(sorted(module.name.replace("_", "-") for module in pkgutil.iter_modules(rig.controllers.__path__)))


def make_controller(name: str, port: str, **settings: Any) -> Controller:
    """The controller called ``name`` on ``port``, not opened yet; settings as its class takes them."""
    if name not in controller_names():
        raise RigError(f"controller {name!r} is unknown; known: {', '.join(controller_names())}")
    driver = importlib.import_module(f"rig.controllers.{name.replace('-', '_')}")
    made: Controller = driver.CONTROLLER(port, **settings)
    return made
