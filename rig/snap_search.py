"""Snap search: quasi-static steps until a cell snaps, then bisection; an interval for the snap pressure.

As in the paper: steps of 0.5 kPa, each held until nothing moves. A snap is a change of position, volume or whatever is
watched that is far larger than the elastic change of the steps before it. Between the last pressure that held and the
first that did not, the search bisects: after each snap the straw is vented, reset, and brought back quasi-statically.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from statistics import fmean, pstdev
from typing import TypeVar

from straw.rig.controller import Controller
from straw.rig.errors import RigError
from straw.rig.interrupts import Interrupts
from straw.rig.patience import Patience
from straw.rig.reading import Reading
from straw.rig.run_write import RunWriter
from straw.rig.watch import QUIET_S, Watcher

POLL_S = 0.02
APPROACH_S = 0.15  # a hold on the way back to a pressure that is known to hold
Reset = Callable[[], None]
T = TypeVar("T")


@dataclass(frozen=True)
class SnapPlan:
    """From where to where (Pa gauge, both on one side of 0, or from 0), in what steps, how finely, how often."""

    start_pa: float
    end_pa: float
    step_pa: float = 500.0
    resolution_pa: float = 100.0
    repeats: int = 1
    channel: int = 1
    longest_hold_s: float = 30.0

    def __post_init__(self) -> None:
        numbers = (self.start_pa, self.end_pa, self.step_pa, self.resolution_pa)
        if not all(map(math.isfinite, numbers)) or self.start_pa == self.end_pa:
            raise RigError(f"snap search from {self.start_pa:g} to {self.end_pa:g} Pa: give two different pressures")
        if not 0.0 < self.resolution_pa <= self.step_pa or self.repeats < 1:
            raise RigError(
                "snap search: step and resolution must be above 0, the step the larger, and repeats 1 or more"
            )


@dataclass(frozen=True)
class Held:
    """One hold: command (Pa), mean reading over its end (Pa), standard uncertainty of that (Pa), how it ended."""

    told_pa: float
    read_pa: float
    sigma_pa: float
    snapped: bool
    lasted_s: float


@dataclass(frozen=True)
class Bracket:
    """One search: the last pressure that held and the first that snapped."""

    below: Held
    above: Held

    @property
    def interval_pa(self) -> tuple[float, float]:
        """The interval of the snap pressure (Pa) by the readings: both holds, each widened by two sigmas."""
        ends = sorted((self.below, self.above), key=lambda held: held.read_pa)
        return ends[0].read_pa - 2 * ends[0].sigma_pa, ends[1].read_pa + 2 * ends[1].sigma_pa


@dataclass(frozen=True)
class SnapFound:
    """Snap pressure (Pa): the middle of the common interval, its standard uncertainty, and every search."""

    pressure_pa: float
    sigma_pa: float
    brackets: tuple[Bracket, ...]

    @property
    def interval_pa(self) -> tuple[float, float]:
        """From the lowest to the highest that any of the searches leaves (Pa)."""
        lows, highs = zip(*(bracket.interval_pa for bracket in self.brackets), strict=True)
        return min(lows), max(highs)


def snap_search(
    controller: Controller,
    plan: SnapPlan,
    watcher: Watcher,
    reset: Reset | None,
    *,
    writer: RunWriter | None = None,
    progress: Callable[[float, str], None] | None = None,
) -> SnapFound:
    """Search on an open controller; it is vented before, between searches, and however this ends.

    ``reset`` brings a vented straw back to its configuration, by hand or in an emulator; without it there is one search
    and no bisection. RigError where nothing snaps up to the plan's end.
    """
    if reset is None and plan.repeats > 1:
        raise RigError("snap search: repeats need a reset of the straw in between")
    with Interrupts("interrupted: venting first") as interrupts:
        search = _Search(controller, plan, watcher, reset, writer, progress, interrupts)
        try:
            brackets = tuple(search.run())
        finally:
            controller.vent()
            search.event("vent", "confirmed by the controller")
        interrupts.check()
    middles = [fmean(bracket.interval_pa) for bracket in brackets]
    widths = [high - low for low, high in (bracket.interval_pa for bracket in brackets)]
    scatter_pa = pstdev(middles) / math.sqrt(max(len(middles) - 1, 1))
    return SnapFound(fmean(middles), math.hypot(scatter_pa, fmean(widths) / math.sqrt(12.0)), brackets)


class _Search:
    def __init__(
        self,
        controller: Controller,
        plan: SnapPlan,
        watcher: Watcher,
        reset: Reset | None,
        writer: RunWriter | None,
        progress: Callable[[float, str], None] | None,
        interrupts: Interrupts,
    ) -> None:
        self.controller, self.plan, self.watcher, self.reset = controller, plan, watcher, reset
        self.writer, self.progress, self.interrupts = writer, progress, interrupts
        self.sign = math.copysign(1.0, plan.end_pa - plan.start_pa)
        self.patience = Patience()

    def run(self) -> Iterator[Bracket]:
        for repeat in range(self.plan.repeats):
            self.begin(repeat > 0)
            yield self.bisected(self.coarse())

    def begin(self, after_a_snap: bool) -> None:
        """Vented and in its configuration, with nothing moving."""
        self.controller.vent()
        if after_a_snap and self.reset is not None:
            self.event("reset", "to the configuration at the start")
            self.reset()
        self.watcher.begin()
        self.hold(self.plan.start_pa)

    def coarse(self) -> Bracket:
        """Steps until the snap."""
        below = self.hold(self.plan.start_pa)
        for told_pa in self.ladder(self.plan.start_pa, self.plan.end_pa):
            held = self.hold(told_pa)
            if held.snapped:
                return Bracket(below, held)
            below = held
        raise RigError(
            f"snap search: nothing snapped between {self.plan.start_pa / 1e3:g} and {self.plan.end_pa / 1e3:g} kPa; "
            "search further, or check the configuration"
        )

    def bisected(self, bracket: Bracket) -> Bracket:
        """Halve the bracket until it is as narrow as wanted, or as the instrument allows."""
        below, above = bracket.below, bracket.above
        back = False
        while self.reset is not None and abs(above.told_pa - below.told_pa) > self.plan.resolution_pa * (1 + 1e-9):
            middle_pa = self.controller.rounded((below.told_pa + above.told_pa) / 2)
            if middle_pa in (below.told_pa, above.told_pa):
                break
            if not back:
                self.begin(True)
                for told_pa in self.ladder(self.plan.start_pa, below.told_pa):
                    self.hold(told_pa, at_most_s=APPROACH_S)
                below = self.hold(below.told_pa)
                if below.snapped:
                    raise RigError(
                        f"snap search: {below.told_pa / 1e3:g} kPa held once and snapped once; the cell was not set "
                        "back to the same state, or it is ageing: cycle it first"
                    )
            held = self.hold(middle_pa)
            back = not held.snapped
            below, above = (below, held) if held.snapped else (held, above)
        return Bracket(below, above)

    def ladder(self, from_pa: float, to_pa: float) -> Iterator[float]:
        """Told pressures from the step after ``from_pa`` up to ``to_pa``."""
        steps = math.ceil(abs(to_pa - from_pa) / self.plan.step_pa - 1e-9)
        for k in range(1, steps + 1):
            yield to_pa if k == steps else self.controller.rounded(from_pa + self.sign * k * self.plan.step_pa)

    def hold(self, told_pa: float, at_most_s: float | None = None) -> Held:
        """Set, and watch until nothing moves; what was read at the end, and whether something snapped."""
        clock = self.controller.clock
        command = self.answered(lambda: self.controller.set_pressure(self.plan.channel, told_pa))
        start_s = clock.monotonic_s()
        self.watcher.hold(command.pressure_pa)
        if self.writer:
            self.writer.command(command)
        readings: list[Reading] = []
        limit_s = at_most_s or self.plan.longest_hold_s
        while True:
            readings_now = self.answered(self.controller.read)
            reading = next(r for r in readings_now if r.channel == self.plan.channel)
            readings.append(reading)
            self.watcher.look(reading)
            if self.writer:
                self.writer.reading(reading)
            lasted_s = clock.monotonic_s() - start_s
            if self.watcher.steady(lasted_s) or lasted_s > limit_s:
                break
            clock.sleep(POLL_S)
        snapped = self.watcher.snapped() if at_most_s is None else False
        since_ns = readings[-1].monotonic_ns - round(QUIET_S * 1e9)
        last_pa = [reading.pressure_pa for reading in readings if reading.monotonic_ns >= since_ns]
        # The mean of quantised readings is no more certain than the spread within one step.
        sigma_pa = math.hypot(
            pstdev(last_pa) / math.sqrt(len(last_pa)), self.controller.resolution_pa / math.sqrt(12.0)
        )
        held = Held(command.pressure_pa, fmean(last_pa), sigma_pa, snapped, lasted_s)
        self.event(
            "snap" if snapped else "step", f"{held.told_pa:g} Pa held {lasted_s:.2f} s, read {held.read_pa:.0f} Pa"
        )
        if self.progress:
            self.progress(told_pa, "snap" if snapped else "holds")
        return held

    def answered(self, ask: Callable[[], T]) -> T:
        """The controller's reading, repeated where an answer is missing or corrupted, as in a run."""
        self.patience.answered()
        while True:
            self.interrupts.check()
            try:
                return ask()
            except RigError as error:
                self.patience.failed(error)
                self.event("fault", str(error))
            self.controller.clock.sleep(POLL_S)

    def event(self, kind: str, text: str) -> None:
        if self.writer:
            self.writer.event(kind, text, self.controller.clock.wall_ns())
