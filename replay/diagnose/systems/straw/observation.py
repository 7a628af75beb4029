"""One recording made ready for diagnosis: its tip, its noise, its snaps and the pressure that drove it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from straw.model.drive import Table
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.model.simulate import sampled
from straw.replay.compare.comparison import CHANNELS
from straw.replay.compare.driving import driving_pressure
from straw.replay.diagnose.recording import Stretch
from straw.replay.diagnose.systems.straw.envelope import Envelope, envelope_of
from straw.replay.diagnose.systems.straw.gauge import quieted
from straw.replay.diagnose.systems.straw.snaps import Levels, crossings, levels_of, stretches
from straw.replay.diagnose.systems.straw.vented import vented
from straw.replay.errors import ReplayError
from straw.replay.identify.difference import UNSTATED
from straw.rig.run import Run

Floats = NDArray[np.float64]

#: What two runs of the same straw differ by beside the camera's noise, in X, Z (m) and Phi (rad): chosen. In the
#: campaigns a, c and d of `../shared/recordings`, means of 72 frames at rest of three repeats scatter by 2 to 14 um and
#: by 0.15 to 1.1 mrad; the camera's noise alone, with `LASTING` and `LASTS_S`, makes 8 um and 0.5 mrad.
REPEATABILITY = (5e-6, 5e-6, 0.3e-3)
#: The same in the time of a snap, s: chosen; in these campaigns snaps scatter by 0.03 to 0.16 ms.
REPEATABILITY_S = 1e-3
#: By which the ringing after it is early or late, s; allows for laws whose form is not exact, too.
SLACK_S = 2e-3
#: The tip's rate is that of its mean over this, s: two pictures at 240 Hz.
RATE_OVER_S = 8e-3
#: Window in which a ringing tip is once fast, s.
RINGS_S = 0.08
#: How long the recorded tip must be at least.
SHORTEST = 30


@dataclass(frozen=True, eq=False)
class Observation:
    """What one run shows: tip (3, n) = X, Z (m), Phi (rad) at stamped times (n,), and the times of its snaps."""

    run: Run
    time_s: Floats
    tip: Floats
    at_rest: Floats  # (3, n) sigma while nothing moves
    rate: Floats  # (3, n) how fast the tip moves, per s
    levels: Levels
    snaps_s: Floats
    pressure: Table  # as the gauge showed it, without what is its noise
    start_s: float
    end_s: float
    vent_pa: float | None = None  # what the gauge reads before anything is commanded, where it is not nothing
    rests: dict[str, Floats] = field(default_factory=dict)  # by form of the equations: where a straw like it rests

    @property
    def name(self) -> str:
        """The run's name."""
        return self.run.run_id

    @property
    def seen(self) -> Floats:
        """What the channels show: the tip."""
        return self.tip

    @property
    def events_s(self) -> Floats:
        """Snaps."""
        return self.snaps_s

    @property
    def kind(self) -> tuple[int, ...] | None:
        """The start configuration."""
        return self.run.initial_deployed

    def floor(self) -> Floats:
        """Noise, with what a snap's time is repeatable to, (3, n)."""
        return self.sigma(REPEATABILITY_S)

    def conditions(self) -> dict[str, float]:
        """Pressure, wear, and whether a cell snaps."""
        log = self.run.pressure
        assert log is not None
        most = float(log.pressure_pa[np.argmax(np.abs(log.pressure_pa))])
        return {
            "the direction of the pressure": float(np.sign(most)),
            "the size of the pressure": abs(most),
            "the number of cycles before": float(self.run.cycle),
            "whether a cell snaps": float(len(self.snaps_s) > 0),
        }

    def stretches(self) -> list[Stretch]:
        """Before, during and after each snap."""
        return stretches(self.time_s, self.snaps_s)

    @cached_property
    def envelope(self) -> Envelope:
        """The tip's slow part and the envelope of its ringing, and the standard deviation of each part."""
        return envelope_of(self.time_s, self.tip, self.at_rest)

    def rest_of(self, straw: StrawParameters) -> None:
        """Keep the rest state of a straw before the run, in both forms of the equations, as a start for similar straws.

        Done once, before any simulation: otherwise results would depend, in their last digits, on which straw is
        simulated first.
        """
        assert self.run.initial_deployed is not None
        for form in ("truncated", "full"):
            with suppress(ModelError):  # then every straw finds its own
                worn = straw.replace(form=form).in_run(self.run.cycle, self.run.zero_time_ns)
                self.rests[form] = rest_state(worn, self.run.initial_deployed, float(self.pressure.pressure_pa[0]))

    def sigma(self, slack_s: float = SLACK_S) -> Floats:
        """Noise (3, n): where the tip moves fast, a little difference in time is a difference in place."""
        return np.asarray(np.sqrt(self.at_rest**2 + (self.rate * slack_s) ** 2))


def observe(run: Run) -> Observation:
    """An observation of a gathered run; ReplayError where it shows too little."""
    tip, pressure = run.tip, run.pressure
    assert tip is not None
    assert pressure is not None
    good = tip.valid & np.all([np.isfinite(getattr(tip, c)) for c in CHANNELS], axis=0)
    if np.count_nonzero(good) < SHORTEST:
        raise ReplayError(
            f"{run.path}: {np.count_nonzero(good)} valid tip samples of at least {SHORTEST}; leave this run out"
        )
    time_s = tip.time_s[good]
    seen = np.stack([getattr(tip, c)[good] for c in CHANNELS])
    stated = np.stack([getattr(tip, f"sigma_{c}")[good] for c in CHANNELS])
    camera = np.where(np.isfinite(stated) & (stated > 0), stated, np.array([[UNSTATED[c]] for c in CHANNELS]))
    step_s = float(np.median(np.diff(time_s)))
    rate = np.abs(np.gradient(gaussian_filter1d(seen, RATE_OVER_S / step_s, axis=1), time_s, axis=1))
    # what noise alone looks like as a rate is taken off
    rate = np.clip(rate - camera / np.sqrt(RATE_OVER_S / step_s) / RATE_OVER_S, 0, None)
    # what rings is as uncertain where it turns as where it is fast
    rate = maximum_filter1d(rate, round(RINGS_S / step_s) | 1, axis=1)
    at_rest = np.sqrt(camera**2 + np.array(REPEATABILITY)[:, None] ** 2)
    levels = levels_of(seen[2])
    start_s = min(float(pressure.time_s[0]), float(time_s[0]))
    curve = driving_pressure(quieted(pressure, run.command), run.command)
    return Observation(
        run,
        time_s,
        seen,
        at_rest,
        rate,
        levels,
        crossings(time_s, seen[2], levels),
        sampled(curve, np.array([start_s, max(float(pressure.time_s[-1]), start_s + step_s)])),
        start_s,
        float(time_s[-1]),
        vented(pressure, run.command),
    )
