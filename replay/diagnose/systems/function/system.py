"""A user's system for the diagnosis: its constants as unknowns, recordings against it, laws added to it.

Unknown starts of states are constants of each recording alone; they are profiled out inside a recording's misfit
(variable projection: Golub and Pereyra 1973), so that the engine does not see them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, fitted
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown, in_order
from straw.replay.diagnose.numerical import jacobian
from straw.replay.diagnose.robust import robust_cost, weights
from straw.replay.diagnose.settings import FIRST_ROUNDS, ROUNDS
from straw.replay.diagnose.starts import logarithmic, scattered
from straw.replay.diagnose.system import Channel, Differences, Level, System
from straw.replay.diagnose.systems.function.kernel import CHANNEL, CLOCK, DELAY, INPUT, OF_TIME
from straw.replay.diagnose.systems.function.laws import Law, encoded
from straw.replay.diagnose.systems.function.model import Constant, Model
from straw.replay.diagnose.systems.function.plain import plain_march
from straw.replay.diagnose.systems.function.recording import Recorded

Floats = NDArray[np.float64]

#: Steps to a start, the step of its differences, the width of its prior in units of its scale, and the least gain of a
#: step as a share of the cost.
START_ROUNDS, START_STEP, START_SD, START_GAIN = 5, 1e-3, 30.0, 1e-3
#: Scale of a start about a channel's first readings: its noise, or this share of the channel's span, and the largest
#: distance in these; a farther start would compensate for a missing law.
START_SHARE, START_UNITS = 2e-3, 5.0
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
    library: Mapping[str, Law] = field(default_factory=dict)
    #: Last profiled result of each recording, by values, as a search evaluates a point twice.
    _last: dict[str, tuple[Any, Any]] = field(init=False, repr=False, default_factory=dict)

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
        """The file's optional laws, and faults of instruments."""
        return (*self.model.get("laws", {}), *self.library)

    @property
    def faults(self) -> frozenset[str]:
        """Causes that act in channels, clocks and inputs."""
        return frozenset(n for n, law in self.library.items() if law.place.kind in (CHANNEL, CLOCK, DELAY, INPUT))

    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        """Causes together."""
        unknowns: list[Unknown] = []
        for name in names:
            if name in self.library:
                number = len(self.laws) + list(self.library).index(name)
                unknowns += self.library[name].unknowns(number)
            else:
                wanted = self.model.get("laws", {})[name]
                unknowns += [unknown_of(c, strength=True) for c in self.model.constants if c.name in wanted]
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
        laws = {k: law for k, law in enumerate((*self.laws, *self.library.values())) if _acts(k, values)}
        marching = {k: law for k, law in laws.items() if law.place.kind not in (CLOCK, DELAY)}
        rows, p, lags = encoded(marching, values)
        late = np.zeros(len(recording.inputs))
        for k, law in laws.items():
            if law.place.kind == DELAY:
                late[law.place.which] = law.parameters(k, values)[0]
        c = self.constants(values)
        given = (rows, p, late)
        if self.model.plain:
            shown = plain_march(self.model, recording.time_s, recording.inputs, c, *given)
            y, x, r = shown, np.empty((0, shown.shape[1])), np.empty((0, shown.shape[1]))
        else:
            sizes = len(self.model.states), len(self.model.channels)
            x0 = np.concatenate([start, np.zeros(lags)])
            y, x, r = self.model.march(recording.time_s, recording.inputs, x0, c, *given, *sizes, self.longest_s)
        for k, law in laws.items():
            if law.place.kind == CLOCK:
                t, j = recording.time_s, law.place.which
                lateness = law.curve(k, values, t if law.state.kind == OF_TIME else np.ones_like(t))
                if np.any(lateness != 0):
                    y[j] = np.interp(t - lateness, t, y[j])
        return y, x, r

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
                good = row[np.isfinite(row)]
                start[i] = float(np.median(good[:3]))
                scale[i] = max(float(recording.noise[names.index(one.channel)]), START_SHARE * float(np.ptp(good)))
            elif one.value is not None:
                start[i] = one.value
                scale[i] = (one.high - one.low) / 4 or 1.0
        return start, scale

    def profiled(self, recording: Recorded, values: Mapping[str, float]) -> tuple[Floats, Floats, Floats]:
        """Shown (channels, n) with the best starts, these (states,), and their columns (m, free) in sigmas."""
        asked = recording.time_s.size, tuple(sorted(values.items()))
        known = self._last.get(recording.name)
        if known is None or known[0] != asked:
            known = asked, self._profiled(recording, values)
            self._last[recording.name] = known
        y, at, columns = known[1]
        return y.copy(), at, columns

    def _profiled(self, recording: Recorded, values: Mapping[str, float]) -> tuple[Floats, Floats, Floats]:
        """Gauss-Newton whose columns are recomputed only where a step with the old ones does not help."""
        start, scale = self.started(recording)
        free = self.free_starts()
        near = np.array([START_UNITS * scale[i] if self.model.starts[i].channel else np.inf for i in free])
        low = np.maximum([self.model.starts[i].low for i in free], start[free] - near)
        high = np.minimum([self.model.starts[i].high for i in free], start[free] + near)

        def tried(o: Floats) -> tuple[Floats, Floats, Floats]:
            at = start.copy()
            at[free] = np.clip(at[free] + scale[free] * o, low, high)
            y = self.played(recording, values, at)[0]
            return y, at, self._differences(recording, y, recording.tells_start)

        o = np.zeros(len(free))
        y, at, r = tried(o)
        columns = np.zeros((len(r), len(free)))
        if not free or not np.isfinite(y).all():
            return y, at, columns
        cost, fresh, old = robust_cost(r), False, columns
        for _ in range(START_ROUNDS):
            if not columns.any():
                fresh = True
                for k in range(len(free)):
                    columns[:, k] = (tried(o + START_STEP * np.eye(len(free))[k])[2] - r) / START_STEP
            if not np.isfinite(columns).all() or not columns.any():
                columns = np.zeros_like(columns)
                break
            w = weights(r)
            curvature = (columns * w[:, None]).T @ columns + np.eye(len(free)) / START_SD**2
            step = -np.linalg.solve(curvature, columns.T @ (w * r) + o / START_SD**2)
            gain = 0.0
            for share in (1.0, 0.2):
                y_new, at_new, r_new = tried(o + share * step)
                if np.isfinite(r_new).all() and robust_cost(r_new) < cost:
                    gain, cost = cost - robust_cost(r_new), robust_cost(r_new)
                    o, y, at, r = o + share * step, y_new, at_new, r_new
                    break
            if gain < START_GAIN * cost:
                if fresh:
                    break
                old, columns = columns, np.zeros_like(columns)
            fresh = False
        return y, at, columns if columns.any() else old

    def _differences(self, recording: Recorded, y: Floats, which: NDArray[np.bool_]) -> Floats:
        sigma = np.array(self.sigma or recording.noise)[:, None]
        out = np.where(which, (y - recording.seen) / sigma, 0.0)
        return np.where(np.isnan(recording.seen), 0.0, out).ravel()

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
        y, at, own = self.profiled(recording, self.values(unknowns, u))
        if not np.isfinite(y).all():
            return None
        fitted_only = recording.fitted

        def in_sigmas(point: Floats) -> Floats | None:
            shown = self.played(recording, self.values(unknowns, point), at)[0]
            out = self._differences(recording, shown, fitted_only)
            return np.append(out, 0.0) if np.isfinite(out).all() else None

        vector = np.append(self._differences(recording, y, fitted_only), 0.0)
        slopes = np.empty((0, 0))
        if derivatives:
            slopes = jacobian(in_sigmas, unknowns, u, vector, central=False)
            if own.size and fitted_only.any():
                q, _ = np.linalg.qr(np.vstack([own, np.zeros((1, own.shape[1]))]))
                slopes -= q @ (q.T @ slopes)
        return Differences(vector, slopes, y - recording.seen, len(recording.time_s) * (1 + 2 * slopes.shape[-1]))

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
        ends = [fitted(campaign, unknowns, points[k], rounds=FIRST_ROUNDS) for k in sorted(starts)]
        fit = fitted(campaign, unknowns, min(ends, key=lambda one: one.cost).u, rounds=ROUNDS)
        return fit, fit

    def named(self, unknown: Unknown) -> tuple[str, str, str]:
        """Cause, constant and unit of an unknown."""
        kind, _, name = unknown.target.partition(".")
        if kind == "constant":
            return self.optional.get(name, "base"), name, self.model.unit(name)
        number, _, constant = name.partition(".")
        laws = [*((f"law {k}", law) for k, law in enumerate(self.laws)), *self.library.items()]
        cause, law = laws[int(number)]
        return cause, constant, law.place.unit if constant in ("strength",) else "s" if constant == "lag_s" else "1"

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
        scale = max(abs(constant.low), abs(constant.high)) / 10
        return Unknown(target, scale, kind="linear", sd=10.0, low=constant.low / scale, high=constant.high / scale)
    if constant.low > 0:
        low, high = np.log(constant.low / constant.value), np.log(constant.high / constant.value)
        return Unknown(target, 1.0, constant.value, "log", sd=max(-low, high, 1e-9), low=low, high=high)
    scale = (constant.high - constant.low) / 2
    ends = constant.low / scale, constant.high / scale
    return Unknown(target, scale, kind="linear", mean=constant.value / scale, sd=1.0, low=ends[0], high=ends[1])


def _acts(number: int, values: Mapping[str, float]) -> bool:
    """Whether a target is a law's."""
    return any(target.startswith(f"law.{number}.") for target in values)
