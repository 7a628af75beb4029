"""Snaps of cells as the tip shows them: a cell that bends turns the tip until it is straight again.

Measurement and prediction are evaluated in the same way, so that what is missed is missed in both.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: A tip that stays within the limit for this time has returned; it is less than several periods of a ring-down.
QUIET_S = 0.12
#: Least turn of a snap, in standard deviations of the noise.
LEAST_SIGMA = 8.0
#: After a snap the tip rings; an overshoot occurs within this time.
RING_S = 0.3
#: Relative tolerance of a measured hinge against that of a cell's predicted snap.
HINGE = 0.15
#: Snaps of measurement and prediction further apart than this are not the same snap.
SAME_S = 0.5


@dataclass(frozen=True)
class Snap:
    """One passage through a bent state: start and end (s; NaN if it lasts), standard uncertainty, largest turn (rad).

    ``hinge_m``: distance from the tip to the cell that bent, from swing over turn. ``overshoot``: how
    far it turns the other way when it comes back, over ``turn_rad``. ``cell``: which one, 0 if unknown.
    """

    start_s: float
    end_s: float
    sigma_s: float
    turn_rad: float
    hinge_m: float
    overshoot: float
    cell: int = 0


@dataclass(frozen=True)
class Pair:
    """One snap in measurement and prediction; None where one of them lacks it."""

    measured: Snap | None
    predicted: Snap | None

    @property
    def late_s(self) -> float:
        """How late the predicted start is, s; NaN unless both snap."""
        if self.measured is None or self.predicted is None:
            return float("nan")
        return self.predicted.start_s - self.measured.start_s


def snaps_of(time_s: Floats, x_m: Floats, z_m: Floats, phi_rad: Floats, limit_rad: float) -> list[Snap]:
    """Snaps in a tip's motion (n,): excursions of Phi beyond ``limit_rad`` from where it rests around them."""
    noise_rad = float(np.median(np.abs(np.diff(phi_rad)))) / 0.954  # of one sample: 0.6745 sqrt 2
    limit_rad = max(limit_rad, LEAST_SIGMA * noise_rad)
    turned = phi_rad - np.median(phi_rad)
    outside = np.flatnonzero(np.abs(turned) > limit_rad)
    if not outside.size:
        return []
    gaps = np.flatnonzero(np.diff(time_s[outside]) > QUIET_S)
    first, last = np.append(outside[0], outside[gaps + 1]), np.append(outside[gaps], outside[-1])
    found = []
    for i, j in zip(first.tolist(), last.tolist(), strict=True):
        if i == 0:
            continue  # it had begun before the record
        start_s, sigma_s = _crossing(time_s, np.abs(turned), i - 1, limit_rad, noise_rad)
        seen_to_end = j < len(time_s) - 1
        end_s = _crossing(time_s, np.abs(turned), j, limit_rad, noise_rad)[0] if seen_to_end else float("nan")
        inside = slice(i - 1, j + 2)
        top = turned[inside][np.argmax(np.abs(turned[inside]))]
        after = (time_s > end_s) & (time_s < end_s + RING_S)
        back = -np.sign(top) * turned[after]
        overshoot = float(back.max(initial=0.0) / abs(top)) if seen_to_end else float("nan")
        hinge_m = _hinge(x_m[inside], z_m[inside], phi_rad[inside])
        found.append(Snap(start_s, end_s, sigma_s, float(top), hinge_m, overshoot))
    return found


def _crossing(time_s: Floats, turn: Floats, k: int, limit_rad: float, noise_rad: float) -> tuple[float, float]:
    """Where the turn passes the limit between samples k and k + 1 (s), with its standard uncertainty from the noise."""
    low, high, step_s = turn[k], turn[k + 1], time_s[k + 1] - time_s[k]
    share = float(np.clip((limit_rad - low) / (high - low), 0, 1)) if high != low else 0.5
    rate = abs(high - low) / step_s
    return float(time_s[k] + share * step_s), float(min(noise_rad / rate if rate > 0 else np.inf, step_s))


def _hinge(x_m: Floats, z_m: Floats, phi_rad: Floats) -> float:
    """Distance from the tip to a single hinge about which all beyond it turns: the swing is D (sin, cos) of Phi."""
    sine, cosine = np.sin(phi_rad), np.cos(phi_rad)
    swing = np.concatenate([sine - sine.mean(), cosine - cosine.mean()])
    moved = np.concatenate([x_m - x_m.mean(), z_m - z_m.mean()])
    turned = float(swing @ swing)
    return float(swing @ moved / turned) if turned > 0 else float("nan")


def named(measured: list[Snap], predicted: list[Snap]) -> list[Snap]:
    """Measured snaps with the cell, among those that the prediction snaps, whose hinge is nearest; 0 if none is near.

    Hinges are compared with hinges, not with the cells' places, as the whole straw deforms while one cell bends.
    """
    out = []
    for snap in measured:
        nearest = min(predicted, key=lambda p: abs(p.hinge_m / snap.hinge_m - 1), default=None)
        near = nearest is not None and abs(nearest.hinge_m / snap.hinge_m - 1) < HINGE
        out.append(replace(snap, cell=nearest.cell if nearest is not None and near else 0))
    return out


def match(measured: list[Snap], predicted: list[Snap]) -> list[Pair]:
    """Snaps paired in time, nearest first, none twice; in the order of time."""
    near = sorted(
        (abs(a.start_s - b.start_s), i, j)
        for (i, a), (j, b) in itertools.product(enumerate(measured), enumerate(predicted))
    )
    pairs: list[Pair] = []
    used: tuple[set[int], set[int]] = (set(), set())
    for apart_s, i, j in near:
        if apart_s <= SAME_S and i not in used[0] and j not in used[1]:
            pairs.append(Pair(measured[i], predicted[j]))
            used[0].add(i)
            used[1].add(j)
    pairs += [Pair(a, None) for i, a in enumerate(measured) if i not in used[0]]
    pairs += [Pair(None, b) for j, b in enumerate(predicted) if j not in used[1]]
    return sorted(pairs, key=lambda pair: min(s.start_s for s in (pair.measured, pair.predicted) if s))
