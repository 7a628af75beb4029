"""Watchers: decide that a straw has come to rest, and that a cell has snapped."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from statistics import median

from straw.rig.errors import RigError
from straw.rig.reading import Reading

QUIET_S = 0.25  # motion is judged over this time and an equal time before it
STILL = 0.005  # moved: by more than this share of a usual step's motion
DYING = 0.9  # a decaying motion loses at least a tenth from one QUIET_S to the next
NOTHING = 1e-4  # share of a usual step: even the slowest passage past a limit point is faster
JUMP = 5.0  # snapped: by more than so many usual steps. Softening before a limit point makes 1.6, a snap some fifty
SHORTEST_S = 0.4  # the controller takes 70 ms, water and air longer
USUAL_AFTER = 3  # steps

Position = tuple[float, ...]


class Watcher(ABC):
    """Receives every hold and every reading, and decides whether the hold is over and whether a cell snapped."""

    @abstractmethod
    def begin(self) -> None:
        """A new search starts from the straw's present state."""

    @abstractmethod
    def hold(self, told_pa: float) -> None:
        """A new pressure is held from now on."""

    @abstractmethod
    def look(self, reading: Reading) -> None:
        """Another reading."""

    @abstractmethod
    def steady(self, held_s: float) -> bool:
        """Whether the straw is at rest."""

    @abstractmethod
    def snapped(self) -> bool:
        """Whether a cell snapped in this hold."""


class MotionWatcher(Watcher):
    """Watches a position: the tip's X, Z and Phi, or the straw's volume; any unit, as only ratios are used.

    ``position`` gives it at a reading; ``noise`` is a change that means nothing.
    """

    def __init__(self, position: Callable[[Reading], Position], noise: float = 0.0) -> None:
        self.position, self.noise = position, noise
        self._per_pa: list[float] = []  # elastic change per Pa of the steps so far
        self._step_pa = 0.0
        self.begin()

    def begin(self) -> None:
        """Start from the present state, but keep the stiffness."""
        self._told_pa: float | None = None
        self._before: Position | None = None
        self._trace: list[tuple[int, Position]] = []

    def hold(self, told_pa: float) -> None:
        """Positions count from the end of the hold before."""
        self._before = self._trace[-1][1] if self._trace else None
        self._change_pa = 0.0 if self._told_pa is None else abs(told_pa - self._told_pa)
        self._told_pa, self._trace = told_pa, []

    def look(self, reading: Reading) -> None:
        """Where it is now."""
        self._trace.append((reading.monotonic_ns, self.position(reading)))

    def steady(self, held_s: float) -> bool:
        """Whether the remaining motion is less than ``STILL`` of a usual step.

        Slowness alone is not sufficient: just past a limit point a straw creeps for seconds before it snaps. A decaying
        motion loses the same share in equal times, so the remainder follows from its last two intervals; a creeping one
        loses ever less, and then accelerates.
        """
        if held_s < max(SHORTEST_S, 2 * QUIET_S):
            return False
        earlier, later = self._moved(2, 1), self._moved(1, 0)
        if max(earlier, later) <= max(NOTHING * self._usual(), self.noise):
            return True
        share = later / earlier if earlier > 0.0 else math.inf
        return share < DYING and later * share / (1.0 - share) <= STILL * self._usual()

    def snapped(self) -> bool:
        """Whether it moved by more than ``JUMP`` usual steps; else this step counts as usual from now on."""
        if self._before is None or self._change_pa == 0.0:
            return False
        moved = _distance(self._before, self._trace[-1][1])
        self._step_pa = max(self._step_pa, self._change_pa)
        if len(self._per_pa) >= USUAL_AFTER and moved > max(JUMP * self._usual(), 10.0 * self.noise):
            return True
        self._per_pa.append(moved / self._change_pa)
        return False

    def _moved(self, since: int, until: int) -> float:
        """The farthest from where it was, between so many ``QUIET_S`` ago and so many."""
        now_ns, quiet_ns = self._trace[-1][0], round(QUIET_S * 1e9)
        stretch = [p for at_ns, p in self._trace if now_ns - since * quiet_ns <= at_ns <= now_ns - until * quiet_ns]
        return max(_distance(stretch[0], position) for position in stretch) if stretch else 0.0

    def _usual(self) -> float:
        return median(self._per_pa) * self._step_pa if self._per_pa else 0.0


def volume_from_flow(noise_m3: float = 2e-9) -> MotionWatcher:
    """Watches the volume that a flow sensor in the line has counted (m^3)."""
    counted = [0.0, math.nan, math.nan]  # volume, time, flow

    def position(reading: Reading) -> Position:
        if math.isnan(reading.flow_m3_s):
            raise RigError("snap search: the controller reports no flow sensor; connect one, or answer by hand (--ask)")
        volume, at_s, flow = counted
        now_s = reading.monotonic_ns * 1e-9
        if not math.isnan(at_s):
            volume += (flow + reading.flow_m3_s) / 2 * (now_s - at_s)
        counted[:] = volume, now_s, reading.flow_m3_s
        return (volume,)

    return MotionWatcher(position, noise_m3)


class AskingWatcher(Watcher):
    """A person watches: each hold lasts ``hold_s``, then ``ask`` returns whether a cell snapped."""

    def __init__(self, ask: Callable[[float], bool], hold_s: float = 2.0) -> None:
        self.ask, self.hold_s = ask, hold_s
        self._told_pa = 0.0
        self._asked = False

    def begin(self) -> None:
        """No question about the first hold of a search."""
        self._asked = False

    def hold(self, told_pa: float) -> None:
        """Keep the pressure for the question."""
        self._told_pa = told_pa

    def look(self, reading: Reading) -> None:
        """Readings are not used."""

    def steady(self, held_s: float) -> bool:
        """After the agreed time."""
        return held_s >= self.hold_s

    def snapped(self) -> bool:
        """The observer's answer."""
        first, self._asked = not self._asked, True
        return not first and self.ask(self._told_pa)


def _distance(a: Position, b: Position) -> float:
    return math.sqrt(sum((x - y) ** 2 for x, y in zip(a, b, strict=True)))
