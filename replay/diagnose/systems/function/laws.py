"""A law added to a file's model: its place, state and shape; its unknowns and parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.systems.function.codes import FACTOR, OF_INPUT, OF_RATE, RATE
from straw.replay.diagnose.systems.function.shapes import (
    CONSTANT,
    FADES,
    FOLLOWS,
    GROWS,
    PLAY,
    POWER,
    SHAPES,
    TABLE,
    YIELDS,
    values_of,
)

Floats = NDArray[np.float64]

#: Deviation of the prior of a strength, in units that change its place by its own size: nearly flat.
WIDE = 10.0


@dataclass(frozen=True)
class Place:
    """A place of a law: kind and number as in the kernel, its description, unit of the law's values."""

    kind: int
    which: int
    name: str  # "rate:v", "constant:k", "channel:y", "clock:y", "input:u", "delay:u", "strength:1"
    says: str
    unit: str
    size: float  # a large value there


@dataclass(frozen=True)
class State:
    """A state of a law: kind and number, name, unit, and the span (low, high) that recordings visit.

    ``lag_s``: the state after a first-order lag of this time; ``play``: after a play of this half width; None for the
    state itself. ``symbol``: its name in the file's equations, where it has one.
    """

    kind: int
    which: int
    name: str
    unit: str
    low: float
    high: float
    lag_s: float | None = None
    play: float | None = None
    longest_s: float = np.inf  # of a lag: the recordings' duration
    symbol: str = ""

    @property
    def span(self) -> float:
        """Length of the visited span."""
        return self.high - self.low

    @property
    def is_rate(self) -> bool:
        """Whether it is the rate of a state or an input."""
        return self.kind in (OF_RATE, OF_INPUT) and not self.symbol

    @property
    def positive(self) -> bool:
        """Whether it is never negative, but for a fiftieth of the span, as noise may make it."""
        return self.low >= -self.span / 50

    @property
    def signed(self) -> bool:
        """Whether it has both signs, by more than that."""
        return not self.positive and self.high > self.span / 50

    @property
    def remembers(self) -> bool:
        """Whether it is what a history made of the state."""
        return self.lag_s is not None or self.play is not None


@dataclass(frozen=True)
class Law:
    """A law at a place over a state, as a table with points ``at`` or as a formula."""

    place: Place
    state: State
    shape: int
    at: tuple[float, ...] = ()

    @property
    def unit(self) -> float:
        """A strength (or table value) that moves its place by its own size."""
        if self.shape == TABLE:
            return self.place.size
        return self.place.size / max(self._largest(), 1e-300)

    def _largest(self) -> float:
        """The shape's largest value over the visited span, at strength one and its constants' starts."""
        p = self._parameters({}, "", 1.0)
        p = p[int(self.state.remembers) :]
        return float(np.max(np.abs(values_of(self.shape, p, np.linspace(self.state.low, self.state.high, 21)))))

    def unknowns(self, number: int) -> tuple[Unknown, ...]:
        """Unknowns of this law as the ``number``-th of a system's."""
        name = f"law.{number}."
        out: list[Unknown] = []
        if self.shape == TABLE:
            out += [Unknown(f"{name}value{k}", self.unit, kind="linear", sd=WIDE) for k in range(len(self.at))]
        else:
            out.append(Unknown(f"{name}strength", self.unit, kind="linear", sd=WIDE))
            for constant, start, low, high, of in SHAPES[self.shape].constants:
                out.append(self._constant(name + constant, start, low, high, of))
        if self.state.lag_s is not None:
            # between a lag of a twentieth, shorter than which it cannot be resolved, and ten times the recording
            ends = np.log(1 / 20), np.log(max(10 * self.state.longest_s / self.state.lag_s, 2.0))
            out.append(Unknown(f"{name}lag_s", 1.0, self.state.lag_s, "log", sd=1.5, low=ends[0], high=ends[1]))
        if self.state.play is not None:
            # narrower it is dry friction, wider the state never crosses it
            ends = np.log(5e-4 * self.state.span / self.state.play), np.log(0.5 * self.state.span / self.state.play)
            out.append(Unknown(f"{name}play", 1.0, self.state.play, "log", sd=1.5, low=ends[0], high=ends[1]))
        return tuple(out)

    def _constant(self, target: str, start: float, low: float, high: float, of: str) -> Unknown:
        s = self.state
        if of == "place":
            ends = (s.low + low * s.span) / s.span, (s.low + high * s.span) / s.span
            mean = (s.low + start * s.span) / s.span
            return Unknown(target, s.span, kind="linear", mean=mean, sd=1.0, low=ends[0], high=ends[1])
        if low < 0:
            return Unknown(target, 1.0, kind="linear", mean=start, sd=1.0, low=low, high=high)
        scale = s.span if of == "span" else 1.0
        return Unknown(target, 1.0, start * scale, "log", sd=2.0, low=np.log(low / start), high=np.log(high / start))

    def start(self, number: int, units: float = 0.0) -> Floats:
        """u of its unknowns at a strength of so many units, or of a table of zeros."""
        return np.array([units if k.target.endswith("strength") else k.mean for k in self.unknowns(number)])

    def parameters(self, number: int, values: Mapping[str, float]) -> Floats:
        """Its parameters for the kernel, where its unknowns have these values; the lag's time, if any, first."""
        return self._parameters(values, f"law.{number}.", 0.0)

    def _parameters(self, values: Mapping[str, float], name: str, strength: float) -> Floats:
        lag = [] if self.state.lag_s is None else [values.get(name + "lag_s", self.state.lag_s)]
        lag += [] if self.state.play is None else [values.get(name + "play", self.state.play)]
        if self.shape == TABLE:
            return np.array([*lag, *self.at, *(values.get(f"{name}value{k}", 0.0) for k in range(len(self.at)))])
        out = [*lag, values.get(name + "strength", strength)]
        for constant, start, low, high, of in SHAPES[self.shape].constants:
            unknown = self._constant(constant, start, low, high, of)
            out.append(values.get(name + constant, unknown.value(unknown.mean)))
        if self.shape == POWER:
            out.append(self.state.span)
        elif self.shape in (FADES, GROWS):
            out.append(self.state.low if self.shape == FADES else self.state.high)
        return np.array(out)

    def slot(self, constant: str) -> int:
        """The place of one of its constants among its parameters."""
        lag = int(self.state.remembers)
        if constant in ("lag_s", "play"):
            return 0
        if constant.startswith("value"):
            return lag + len(self.at) + int(constant.removeprefix("value"))
        return lag + ("strength", *(name for name, *_ in SHAPES[self.shape].constants)).index(constant)

    def curve(self, number: int, values: Mapping[str, float], at: Floats) -> Floats:
        """Its values over the state at (n,)."""
        p = self.parameters(number, values)[int(self.state.remembers) :]
        return values_of(self.shape, p, np.asarray(at, dtype=np.float64))

    @property
    def beyond(self) -> bool:
        """Whether it only gives a constant a value beyond its range."""
        return self.place.kind == FACTOR and self.shape == CONSTANT

    @property
    def own(self) -> bool:
        """Whether it is over the difference between a state and its history."""
        return self.shape in (FOLLOWS, PLAY, YIELDS)

    @property
    def memories(self) -> int:
        """How many numbers it remembers: a gradual play also where its state was."""
        return int(self.state.remembers) + (self.shape == YIELDS)

    @property
    def curved(self) -> bool:
        """Whether it is a curve over its state: a constant is none, nor is a lag."""
        return self.shape != CONSTANT and not self.own

    @property
    def says(self) -> str:
        """Its place and state in words."""
        if self.beyond:
            return f"{self.place.says}, beyond its range"
        if self.shape == CONSTANT and not self.state.remembers:
            return self.place.says
        return f"{self.place.says}, over {self.over}"

    @property
    def said(self) -> str:
        """The same within a sentence."""
        if self.beyond:
            return f"in {self.place.says}, beyond what the file allows"
        if self.shape == CONSTANT and not self.state.remembers:
            return f"in {self.place.says}"
        return f"in {self.place.says}, depending on {self.over}"

    @property
    def over(self) -> str:
        """Its state in words."""
        if self.own and self.place.name.partition(":")[2] == self.state.symbol and self.place.kind != RATE:
            return "its own history"
        if self.own:
            return f"the hysteresis of {self.state.name}"
        return self.state.name if not self.state.remembers else f"the history of {self.state.name}"

    def tabled(self, at: Sequence[float]) -> Law:
        """The law as a table."""
        return replace(self, shape=TABLE, at=tuple(at))
