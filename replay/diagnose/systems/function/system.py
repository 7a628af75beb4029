"""A user's system for the diagnosis: its constants as unknowns, recordings against it, laws added to it.

Unknown starts of states are constants of each recording alone; they are profiled out inside a recording's misfit
(`shots.py`), so that the engine does not see them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown, in_order
from straw.replay.diagnose.recording import Channel
from straw.replay.diagnose.settings import FIRST_ROUNDS, ROUNDS
from straw.replay.diagnose.starts import logarithmic, scattered
from straw.replay.diagnose.system import Differences, Level, System
from straw.replay.diagnose.systems.function.encoding import Encoding, encoded, encoding
from straw.replay.diagnose.systems.function.laws import Law
from straw.replay.diagnose.systems.function.least import least
from straw.replay.diagnose.systems.function.model import Constant, Model
from straw.replay.diagnose.systems.function.plain import plain_march
from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.shots import played
from straw.replay.diagnose.systems.function.stack import stacked

Floats = NDArray[np.float64]

#: Scale of a start about a channel's first readings: its noise, or this share of the channel's span, and the largest
#: distance in these; a farther start would compensate for a missing law.
START_SHARE, START_UNITS = 2e-3, 5.0
#: A first reading is faulty if it alone is off by this many times the median second difference of the first twenty. Of
#: normal noise that is 6.7 standard deviations of a second difference, exceeded once in fifty thousand million.
FAULTY, FIRST = 10.0, 20
#: Starts of the base that are followed.
FOLLOWED = 3


@dataclass(frozen=True, eq=False)
class FunctionSystem(System):
    """A model with laws added to it.

    ``fixed`` are values by target that are no unknowns here; ``sigma`` (channels,), the recordings' noise where it is
    empty; ``longest_s`` the longest step of the integration.
    """

    model: Model
    laws: tuple[Law, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    sigma: tuple[float, ...] = ()
    longest_s: float = np.inf
    #: Encodings by unknowns.
    _encodings: dict[tuple[Unknown, ...], Encoding] = field(init=False, repr=False, default_factory=dict)

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The file's, in its own units."""
        return tuple(Channel(y.name, self.model.named(y.name), y.unit) for y in self.model.channels)

    @property
    def base(self) -> tuple[Unknown, ...]:
        """Constants that are not fixed and belong to no optional law."""
        optional = self.optional
        return tuple(unknown_of(c) for c in self.model.constants if not c.fixed and c.name not in optional)

    @property
    def optional(self) -> dict[str, str]:
        """Constants of the file's optional laws: the law by constant; the first of each is zero unless it acts."""
        return {name: law for law, names in self.model.get("laws", {}).items() for name in names}

    @property
    def causes(self) -> tuple[str, ...]:
        """The file's optional laws."""
        return tuple(self.model.get("laws", {}))

    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        """Causes together."""
        wanted = [constant for name in names for constant in self.model.get("laws", {})[name]]
        unknowns = [unknown_of(c, strength=True) for c in self.model.constants if c.name in wanted]
        first = tuple(k.mean if k.kind != "strength" else 0.5 for k in unknowns)
        signs = tuple(tuple(sign * 0.3 if k.mean == 0 else k.mean for k in unknowns) for sign in (1, -1))
        return Hypothesis(in_order(names, self.faults), tuple(unknowns), (first, *signs), self.faults)

    def with_laws(self, *laws: Law) -> FunctionSystem:
        """The system with these laws in place of its present ones."""
        return replace(self, laws=tuple(laws))

    def at(self, values: Mapping[str, float]) -> FunctionSystem:
        """The system with some values by target that are no unknowns."""
        return replace(self, fixed={**self.fixed, **values})

    def values(self, unknowns: Sequence[Unknown], u: Floats) -> dict[str, float]:
        """Values by target with unknowns at u."""
        return {**self.fixed, **{k.target: k.value(float(x)) for k, x in zip(unknowns, u, strict=True)}}

    def constants(self, values: Mapping[str, float]) -> Floats:
        """Constants (constants,) in the file's order."""
        strengths = {names[0] for names in self.model.get("laws", {}).values()}
        given = (0.0 if c.name in strengths else c.value for c in self.model.constants)
        named = zip(self.model.constants, given, strict=True)
        return np.array([values.get(f"constant.{c.name}", value) for c, value in named] or [0.0])

    def played(self, recording: Recorded, values: Mapping[str, float], start: Floats) -> tuple[Floats, Floats, Floats]:
        """Shown (channels, n), states and their rates (states with lagging ones, n); NaN where it diverges.

        ``start`` (states,) is where the states start.
        """
        rows, p, lags = encoded(dict(enumerate(self.laws)), values)
        c, t, inputs = self.constants(values), recording.time_s, np.ascontiguousarray(recording.inputs)
        if self.model.plain:
            y = plain_march(self.model, t, inputs, c, rows, p)
            return y, np.empty((0, y.shape[1])), np.empty((0, y.shape[1]))
        x0, sizes = np.append(start, np.zeros(lags)), (len(self.model.states), len(self.model.channels))
        t = np.ascontiguousarray(t)
        y, x, r = played()(*self.model.functions, t, inputs, x0, c, rows, p, *sizes, self.longest_s)
        return y, x, r

    #: The largest distance of a start from a channel's first readings, in its scale.
    reach: ClassVar[float] = START_UNITS

    def free_starts(self) -> list[int]:
        """States whose start is free in each recording."""
        return [i for i, one in enumerate(self.model.starts) if one.low < one.high]

    def started(self, recording: Recorded) -> tuple[Floats, Floats]:
        """Known or estimated starts of the states, and their scale, (states,)."""
        start, scale = np.zeros(len(self.model.starts)), np.ones(len(self.model.starts))
        names = [y.name for y in self.model.channels]
        for i, one in enumerate(self.model.starts):
            if one.channel is not None:
                row = recording.seen[names.index(one.channel)]
                good = np.isfinite(row)
                start[i] = first_value(recording.time_s[good], row[good])
                noise = float(recording.noise[names.index(one.channel)])
                scale[i] = max(noise, START_SHARE * float(np.ptp(row[good])))
            elif one.value is not None:
                start[i] = one.value
                scale[i] = (one.high - one.low) / 4 or 1.0
        return start, scale

    def profiled(self, recording: Recorded, values: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Shown (channels, n) with the best starts, and these (states,)."""
        here = replace(self, sigma=self.sigma or tuple(recording.noise)).at(values)
        given = here.encoding(())
        ys, starts, _ = stacked(here, [recording]).profiled(here, given, given.at(np.zeros(0)), fresh=True)
        return ys, starts[0]

    def misfit(
        self,
        recording: Recorded,
        unknowns: Sequence[Unknown],
        u: Floats,
        *,
        level: Level = Level.FINE,
        derivatives: bool = False,
    ) -> Differences | None:
        """Samples that are not held out, starts profiled out; None where the model diverges."""
        here = replace(self, sigma=self.sigma or tuple(recording.noise))
        given, one = here.encoding(unknowns), stacked(here, [recording])
        ys, starts, known = one.profiled(here, given, given.at(u), fresh=True)
        if not np.isfinite(ys).all():
            return None
        slopes = known.varied(here, given, u, ys, starts) if derivatives else np.empty((0, 0))
        work = len(recording.time_s) * (1 + 2 * slopes.shape[-1])
        return Differences(one.differences(here, ys), slopes, ys - recording.seen, work)

    def encoding(self, unknowns: Sequence[Unknown]) -> Encoding:
        """Unknowns as the kernel takes them."""
        asked = tuple(unknowns)
        known = self._encodings.get(asked)
        if known is None:
            names = [c.name for c in self.model.constants]
            known = encoding(self.laws, names, self.constants(self.fixed), self.fixed, asked)
            self._encodings[asked] = known
        return known

    def size(self, recording: Recorded, level: Level) -> int:
        """All samples of all channels, and one for events, of which there are none."""
        return int(recording.seen.size + 1)

    def given(self) -> Floats:
        """u of the base at the file's values."""
        known = {f"constant.{c.name}": c for c in self.model.constants}
        return np.array([0.0 if k.kind == "log" else known[k.target].value / k.scale for k in self.base])

    def fit_base(self, campaign: Campaign, proposed: Sequence[Floats]) -> tuple[Fit, Fit]:
        """From the file's values and from points of their ranges."""
        unknowns = self.base
        points = [self.given(), *proposed, *scattered(unknowns)]
        best = np.argsort(logarithmic(campaign, points), kind="stable")[:FOLLOWED]
        starts = {int(k) for k in best} | {0}
        ends = [least(campaign, unknowns, points[k], rounds=FIRST_ROUNDS) for k in sorted(starts)]
        fit = least(campaign, unknowns, min(ends, key=lambda one: one.cost).u, rounds=ROUNDS)
        return fit, fit

    def named(self, unknown: Unknown) -> tuple[str, str, str]:
        """Cause, constant and unit of an unknown."""
        kind, _, name = unknown.target.partition(".")
        if kind == "constant":
            return self.optional.get(name, "base"), name, self.model.unit(name)
        number, _, constant = name.partition(".")
        units = {"strength": self.laws[int(number)].place.unit, "lag_s": "s"}
        return f"law {number}", constant, units.get(constant, "1")

    def equation(self, unknown: Unknown) -> tuple[str, str] | None:
        """The constant by its own name."""
        _, _, name = unknown.target.partition(".")
        return (f"constant {self.model.named(name)}", self.model.named(name))

    def simulated(self, recording: Recorded, unknowns: Sequence[Unknown], u: Floats) -> Floats:
        """What the channels would show, (channels, n)."""
        return self.profiled(recording, self.values(unknowns, u))[0]

    def written(self, model: Any) -> dict[str, str]:
        """Values by target."""
        return {"constants": "\n".join(f"{name} = {value!r}" for name, value in model.items())}


def unknown_of(constant: Constant, *, strength: bool = False) -> Unknown:
    """A constant as an unknown: by its logarithm where its range is positive."""
    target = f"constant.{constant.name}"
    if strength:
        # ten units reach the end of the range, a nearly flat prior
        scale = max(abs(constant.low), abs(constant.high)) / 10
        return Unknown(target, scale, kind="linear", sd=10.0, low=constant.low / scale, high=constant.high / scale)
    if constant.low > 0:
        low, high = np.log(constant.low / constant.value), np.log(constant.high / constant.value)
        return Unknown(target, 1.0, constant.value, "log", sd=max(-low, high, 1e-9), low=low, high=high)
    scale = (constant.high - constant.low) / 2
    ends = constant.low / scale, constant.high / scale
    return Unknown(target, scale, kind="linear", mean=constant.value / scale, sd=1.0, low=ends[0], high=ends[1])


def first_value(t: Floats, row: Floats) -> float:
    """The value at the first of times (n,) from the readings of a channel (n,).

    It is the first reading, unless that one alone is off the course of the next ones: its second difference is far
    larger than usual and than the next, which has half of it where the second reading is the faulty one. Then it is
    where the next two lead.
    """
    bend = np.abs(np.diff(row[:FIRST], 2))
    faulty = len(bend) > 2 and bend[0] > FAULTY * np.median(bend) and bend[1] < bend[0] / 4
    return float(row[1] + (row[2] - row[1]) * (t[0] - t[1]) / (t[2] - t[1])) if faulty else float(row[0])
