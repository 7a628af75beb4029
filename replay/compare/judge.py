"""Figures of merit of a run: snaps, ring-down, end pose; each judged against its uncertainty."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.frustum_table import frustum_of
from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.replay.metrics.merit import own_figures, uncertainties
from straw.replay.metrics.noise import independent
from straw.replay.metrics.ringdown import LONGEST_S, RingDown, ring_down
from straw.replay.metrics.snaps import Pair, Snap, match, named, snaps_of
from straw.replay.metrics.validation import Quantity
from straw.tracking.trace import TipTrace

Floats = NDArray[np.float64]

#: A cell has snapped when the tip has turned by this share of a bent cell's angle.
OF_BENT = 1 / 3
#: The end pose is the mean over the last of the record, as far as it is still.
END_S = 0.25
UNITS = {"x_m": "m", "z_m": "m", "phi_rad": "rad"}


@dataclass(frozen=True)
class Motion:
    """A tip's motion (n,) at valid samples, with its snaps and ring-down; sigma by channel, NaN where unknown.

    ``pressure_pa`` (n,): the gauge pressure that drove it; NaN where unknown.
    """

    time_s: Floats
    pose: Mapping[str, Floats]
    sigma: Mapping[str, Floats]
    snaps: tuple[Snap, ...]
    ring: RingDown | None
    pressure_pa: Floats

    @property
    def x_m(self) -> Floats:
        """(n,) m."""
        return self.pose["x_m"]

    @property
    def z_m(self) -> Floats:
        """(n,) m."""
        return self.pose["z_m"]

    @property
    def phi_rad(self) -> Floats:
        """(n,) rad."""
        return self.pose["phi_rad"]


def limit_of(straw: StrawParameters) -> float:
    """Turn of the tip (rad) that counts as a snap; infinite for a straw without bent states."""
    bent = [e.phi_rad for e in frustum_of(straw).equilibria() if e.stable and e.phi_rad > 0]
    return OF_BENT * min(bent) if bent else math.inf


def measured_motion(tip: TipTrace, limit_rad: float, pressure_pa: Floats) -> Motion:
    """The measured tip; ``pressure_pa`` (n,) at its valid samples."""
    pose = {name: getattr(tip, name)[tip.valid] for name in UNITS}
    sigma = {name: getattr(tip, f"sigma_{name}")[tip.valid] for name in UNITS}
    return _seen(tip.time_s[tip.valid], pose, sigma, limit_rad, pressure_pa)


def predicted_motion(p: Prediction, at: TipTrace, limit_rad: float, pressure_pa: Floats) -> Motion:
    """The predicted tip at the measurement's valid samples, with the cell of each snap."""
    pose = {name: getattr(p, name)[-len(at) :][at.valid] for name in UNITS}
    exact = {name: np.zeros(len(values)) for name, values in pose.items()}
    seen = _seen(at.time_s[at.valid], pose, exact, limit_rad, pressure_pa)
    return replace(seen, snaps=tuple(replace(snap, cell=_cell(p, snap)) for snap in seen.snaps))


def _cell(p: Prediction, snap: Snap) -> int:
    """The cell that bends most in a snap."""
    during = (p.time_s >= snap.start_s) & ~(p.time_s > snap.end_s)
    return int(np.argmax(np.abs(p.frustum_phi_rad[during, :, 1]).max(axis=0, initial=0.0))) + 1


def _seen(
    time_s: Floats, pose: Mapping[str, Floats], sigma: Mapping[str, Floats], limit_rad: float, pressure_pa: Floats
) -> Motion:
    snaps = snaps_of(time_s, pose["x_m"], pose["z_m"], pose["phi_rad"], limit_rad)
    ring = None
    if snaps:
        free = (time_s > snaps[-1].end_s) & (time_s < snaps[-1].end_s + LONGEST_S)
        ring = ring_down(time_s[free], pose["phi_rad"][free])
    return Motion(time_s, pose, sigma, tuple(snaps), ring, pressure_pa)


def pairs_of(measured: Motion, predicted: Motion) -> list[Pair]:
    """Snaps of both, paired; measured ones are assigned to cells by the hinge of the tip's swing."""
    return match(named(list(measured.snaps), list(predicted.snaps)), list(predicted.snaps))


def quantities(
    measured: Motion, predicted: Motion, numerical: Motion, inputs: Mapping[str, Motion], limit_rad: float = math.inf
) -> list[Quantity]:
    """Every figure of merit, the user's own last. ``numerical``: integrated finer; ``inputs``: each input moved by
    one sigma; ``limit_rad``: the turn that counts as a snap."""

    def again(noisy: Motion) -> Motion:
        return _seen(noisy.time_s, noisy.pose, noisy.sigma, limit_rad, noisy.pressure_pa)

    own = uncertainties(measured, again)

    def every(said: Motion) -> dict[str, tuple[str, float, float, float]]:
        of_ours = figures(measured, said)
        theirs = own_figures(measured, said, of_ours) if own else {}
        return of_ours | {name: (*told, own[name]) for name, told in theirs.items()}

    base, fine = every(predicted), every(numerical)
    moved = [every(motion) for motion in inputs.values()]

    def change(name: str, other: Mapping[str, tuple[str, float, float, float]]) -> float:
        return other[name][2] - base[name][2] if name in other else math.nan  # then it cannot be judged

    return [
        Quantity(name, unit, seen, said, u_data, abs(change(name, fine)), math.hypot(*(change(name, m) for m in moved)))
        for name, (unit, seen, said, u_data) in base.items()
    ]


def figures(measured: Motion, predicted: Motion) -> dict[str, tuple[str, float, float, float]]:
    """By name: unit, measured, predicted, the measurement's standard uncertainty."""
    nan = float("nan")
    out: dict[str, tuple[str, float, float, float]] = {}
    end = measured.time_s >= measured.time_s[-1] - END_S
    for channel, unit in UNITS.items():
        a, b, sigma = measured.pose[channel][end], predicted.pose[channel][end], measured.sigma[channel][end]
        u_data = float(np.sqrt(np.mean(sigma**2) / independent(a - b)))
        out[f"{channel.split('_')[0]} at the end"] = (unit, float(a.mean()), float(b.mean()), u_data)
    for number, pair in enumerate(pairs_of(measured, predicted), 1):
        a, b = pair.measured, pair.predicted
        cell = (b.cell if b else 0) or (a.cell if a else 0)
        label = f"snap {number}" + (f" (cell {cell})" if cell else "")
        u_data = math.hypot(a.sigma_s, b.sigma_s if b else 0.0) if a else nan
        out[f"{label} start"] = ("s", a.start_s if a else nan, b.start_s if b else nan, u_data)
        u_turn = float(np.median(measured.sigma["phi_rad"]))
        out[f"{label} turn"] = ("rad", a.turn_rad if a else nan, b.turn_rad if b else nan, u_turn)
        u_over = math.sqrt(2) * u_turn / abs(a.turn_rad) if a else nan
        out[f"{label} overshoot"] = ("1", a.overshoot if a else nan, b.overshoot if b else nan, u_over)
    if measured.snaps or predicted.snaps:
        a_ring, b_ring = measured.ring, predicted.ring
        for name, unit, field in (("frequency", "Hz", "frequency_hz"), ("decay", "1/s", "decay_per_s")):
            seen, said = (float(getattr(ring, field)) if ring else nan for ring in (a_ring, b_ring))
            sigma_field = field.replace("_", "_sigma_", 1)
            u_both = [float(getattr(ring, sigma_field)) for ring in (a_ring, b_ring) if ring]
            out[f"ring-down {name}"] = (unit, seen, said, math.hypot(*u_both) if u_both else nan)
    return out


def moved_inputs(straw: StrawParameters, uncertain: Mapping[str, float]) -> dict[str, StrawParameters]:
    """The straw with each uncertain constant moved by its standard uncertainty; ModelError for unknown names."""
    moved = {}
    for name, sigma in uncertain.items():
        if not hasattr(straw, name) or name in ("form", "cells", "terms"):
            raise ModelError(
                f"straw: {name} is not a constant with an uncertainty; see straw identify's output for names"
            )
        moved[name] = straw.replace(**{name: getattr(straw, name) + sigma})
    return moved
