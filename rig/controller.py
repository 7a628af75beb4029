"""Controller: what every pressure controller does, with the limits and the vent below every script."""

from __future__ import annotations

import math
import shlex
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self, final

from straw.rig.clock import Clock
from straw.rig.errors import LimitError, LinkLostError, RigError
from straw.rig.limits import STRAW_LIMITS, PressureLimits, RateLimiter
from straw.rig.plausible import Expectation
from straw.rig.reading import Answer, Command, Reading, Stamp, stamp_of


class Controller(ABC):
    """A pressure controller. Channels are numbered from 1; pressures are gauge, in Pa.

    A driver is one file, in ``rig/controllers`` or anywhere else, that ends in ``CONTROLLER = ItsClass`` and implements
    the methods with an underscore. Every set passes ``set_pressure``, which no driver overrides: nothing beyond
    ``limits`` can reach the wire. ``open`` vents, so that the state is known; ``close`` vents, so that nothing stays
    under pressure.
    """

    name: str
    port: str  # where it is connected, as given
    span: PressureLimits  # the instrument's own range
    resolution_pa: float  # smallest step of a command
    byte_s: float = 0.0  # how long one byte of an answer takes on the line

    def __init__(
        self,
        *,
        channels: tuple[int, ...] = (1,),
        limits: PressureLimits = STRAW_LIMITS,
        sigma_pa: float = math.nan,
        clock: Clock | None = None,
    ) -> None:
        self.channels = channels
        self.sigma_pa = sigma_pa
        self.clock = clock or Clock()
        self.is_open = False
        self._limits = self.span.and_also(limits)
        self._rate_limiters = {channel: RateLimiter(self.resolution_pa) for channel in channels}
        self._expected = {channel: Expectation() for channel in channels}
        self._lock = threading.RLock()  # one exchange at a time over all threads: replies must not be mixed up
        #: A driver calls it whenever it makes progress, with the seconds that its next step may take if that is long: a
        #: guardian thereby distinguishes a driver that waits for a slow instrument from one that hangs.
        self.progress: Callable[..., None] = lambda next_s=0.0: None

    @abstractmethod
    def _open(self) -> None:
        """Open the link and make sure the right instrument answers."""

    @abstractmethod
    def _close(self) -> None:
        """Close the link; never raises."""

    @abstractmethod
    def _send(self, channel: int, pressure_pa: float) -> bytes:
        """Send the instrument one pressure, already checked and rounded, once; return its acknowledgement."""

    @abstractmethod
    def _read(self) -> Answer:
        """The instrument's reading of each channel."""

    @abstractmethod
    def _vent(self, channel: int) -> None:
        """Bring one channel to ambient pressure by the safest means the instrument has."""

    @abstractmethod
    def snapshot(self) -> dict[str, str]:
        """What a recording should state about the instrument: firmware, port, settings."""

    def _trigger(self, high: bool) -> None:
        """Set the trigger output."""
        raise RigError(f"{self.name}: has no trigger output; drive the LED from another instrument, or leave it out")

    def beat(self) -> None:  # noqa: B027  only a guarded controller reports it
        """Signal that the script is alive, in pauses in which it neither sets nor reads."""

    def record_in(self, path: Path) -> None:  # noqa: B027  likewise
        """Where processes that outlive the script record what they did."""

    @property
    def vent_command(self) -> str:
        """The command line that vents this instrument."""
        return f"straw rig vent --port {shlex.quote(self.port)} --controller {self.name}"

    @property
    def limits(self) -> PressureLimits:
        """The limits in force; only ``narrowed`` changes them, and only to narrower ones."""
        return self._limits

    @contextmanager
    def narrowed(self, limits: PressureLimits) -> Iterator[PressureLimits]:
        """Within the block these limits apply as well."""
        before, self._limits = self._limits, self._limits.and_also(limits)
        try:
            yield self._limits
        finally:
            self._limits = before

    @final
    def open(self) -> None:
        """Open the link, check the instrument, and vent: a known state to start from."""
        self._open()
        self.is_open = True
        for expected in self._expected.values():
            expected.forget()
        try:
            self.vent()
        except BaseException:
            self.is_open = False
            self._close()
            raise

    @final
    def close(self) -> None:
        """Vent, then close the link in any case; raises RigError when the vent was not acknowledged."""
        if not self.is_open:
            return
        try:
            self.vent()
        finally:
            self.is_open = False
            self._close()

    @contextmanager
    def looking(self) -> Iterator[Self]:
        """Within the block the link is open for ``read`` and ``snapshot`` only: nothing is set, vented, or changed."""
        self._open()
        try:
            yield self
        finally:
            self._close()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        try:
            self.close()
        except RigError:
            if error is None:  # an error that is already being raised explains more than the failed vent after it
                raise

    def rounded(self, pressure_pa: float) -> float:
        """The nearest pressure (Pa) inside the limits that a command of the instrument can express."""
        step = self.resolution_pa
        lowest, highest = math.ceil(self.limits.min_pa / step), math.floor(self.limits.max_pa / step)
        return min(max(round(pressure_pa / step), lowest), highest) * step

    @final
    def set_pressure(self, channel: int, pressure_pa: float) -> Command:
        """Command one gauge pressure (Pa); RigError, with nothing sent, when it is not within the limits."""
        if channel not in self.channels:
            cure = f"open the controller with channels=({channel},)"
            raise RigError(f"{self.name}: channel {channel} is not in use; {cure}")
        reason = self.limits.why_not(pressure_pa)
        with self._lock:
            before_ns = self.clock.monotonic_ns()
            if reason is None:
                pressure_pa = self.rounded(pressure_pa)
                reason = self._rate_limiters[channel].why_not(pressure_pa, self.limits.max_rate_pa_s, before_ns * 1e-9)
            if reason is not None:
                cure = "ask for less, or for a slower ramp"
                raise LimitError(f"{self.name}: {reason} (channel {channel}); nothing was sent; {cure}")
            self._expected[channel].told(pressure_pa)
            raw = self._send(channel, pressure_pa)
            stamp = self._stamp(before_ns, len(raw))
            self._rate_limiters[channel].arrived(pressure_pa)
        return Command(**stamp, channel=channel, pressure_pa=pressure_pa, raw=raw)

    @final
    def read(self) -> tuple[Reading, ...]:
        """Measured pressure of every channel in use; RigError rather than an implausible value."""
        with self._lock:
            before_ns = self.clock.monotonic_ns()
            answer = self._read()
            stamp = self._stamp(before_ns, len(answer.raw))
        for channel in self.channels:
            in_force_pa = self._rate_limiters[channel].places_pa
            if reason := self._expected[channel].why_refused(channel, answer, self.span, in_force_pa):
                raise RigError(f"{self.name}: {reason}")
        return tuple(
            Reading(
                **stamp,
                channel=channel,
                pressure_pa=answer.pressure_pa[channel],
                sigma_pa=self.sigma_pa,
                raw=answer.raw,
                flow_m3_s=answer.flow_m3_s.get(channel, math.nan),
            )
            for channel in self.channels
        )

    @final
    def vent(self) -> None:
        """Bring every channel in use to ambient pressure; tries all of them before it raises an error."""
        failures: list[str] = []
        with self._lock:
            for channel in self.channels:
                try:
                    self.vent_channel(channel)
                except RigError as error:
                    failures.append(str(error))
        if failures:
            what = f"THE VENT IS NOT CONFIRMED, vent by hand now, or with `{self.vent_command}`"
            raise RigError(f"{self.name}: {what}: {failures[0]}")

    @final
    def trigger(self, high: bool) -> Stamp:
        """Set the trigger output, such as an LED in the camera's view; return when it changed."""
        with self._lock:
            before_ns = self.clock.monotonic_ns()
            self._trigger(high)
            return Stamp(**self._stamp(before_ns))

    @final
    def vent_channel(self, channel: int) -> None:
        """Bring one channel to ambient pressure, over a fresh link if the old one is lost."""
        self._expected[channel].told(0.0)
        try:
            self._vent(channel)
        except LinkLostError as lost:
            if not self.is_open:
                raise
            # A loose plug may be connected again: a fresh link costs little, a straw left under pressure much.
            self._close()
            try:
                self._open()
                self._vent(channel)
            except RigError:
                raise lost from None
        self._rate_limiters[channel].arrived(0.0)

    def _stamp(self, before_ns: int, answer_bytes: int = 0) -> dict[str, Any]:
        return stamp_of(self.clock, before_ns, answer_bytes * self.byte_s)
