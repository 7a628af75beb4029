"""Faults of camera, clock and gauge: the contract's measurement faults, applied to a straw's motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
#: Half of the change of a reading, Pa, that turns its direction from one to the other: a hundredth of 1 bar, the full
#: scale of a usual controller; the gauges of `../shared/recordings` scatter by 30 Pa.
TURNS_PA = 1000.0
#: A curve as pairs (where, value), rising; empty for zero.
Curve = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Instrument:
    """Faults of the apparatus; all zero is a faultless one.

    A camera with a late clock stamps t + ``clock_offset_s`` + ``clock_drift`` t. A gauge shows
    (1 + ``gauge_gain``) p + ``gauge_offset_pa``. The camera's picture is turned by ``camera_roll_rad`` in the sense of
    growing Phi, stretched by 1 + ``length_scale``, and the tip is taken ``tip_offset_m`` too far along its axis.
    Faults without a law are curves: the gauge's excess over its reading (Pa), over the run's time and over the
    direction in which the reading moved last (`last_direction`); the lateness of the camera's stamps over the stamp
    (s); the excess of X, of Z (m) and of the roll (rad) over X, as of a lens or a board askew or a clamp that gives
    way; and over the run's time that of X, of Z and of the roll, as of a camera that slips or sinks in its mount, and
    of the tip's offset (m), as of a board that slips along the tip.
    """

    clock_offset_s: float = 0.0
    clock_drift: float = 0.0
    length_scale: float = 0.0
    camera_roll_rad: float = 0.0
    tip_offset_m: float = 0.0
    gauge_offset_pa: float = 0.0
    gauge_gain: float = 0.0
    gauge_curve_pa: Curve = ()
    gauge_wander_pa: Curve = ()
    gauge_memory_pa: Curve = ()
    clock_curve_s: Curve = ()
    camera_x_m: Curve = ()
    camera_z_m: Curve = ()
    camera_roll_curve_rad: Curve = ()
    camera_x_wander_m: Curve = ()
    camera_z_wander_m: Curve = ()
    camera_roll_wander_rad: Curve = ()
    tip_offset_wander_m: Curve = ()

    @classmethod
    def of(cls, faults: Mapping[str, float]) -> Self:
        """An instrument with faults by name; a curve's point is ``NAME@WHERE``."""
        curves: dict[str, list[tuple[float, float]]] = {}
        plain = {}
        for name, value in faults.items():
            name, point, where = name.partition("@")
            if point:
                curves.setdefault(name, []).append((float(where), value))
            else:
                plain[name] = value
        return cls(**plain, **{name: tuple(sorted(points)) for name, points in curves.items()})  # type: ignore[arg-type]

    def true_time(self, stamped_s: Floats) -> Floats:
        """When something happened (s since the run's zero) that the camera stamped (n,)."""
        return (stamped_s - self.clock_offset_s - _at(self.clock_curve_s, stamped_s)) / (1 + self.clock_drift)

    def stamped(self, true_s: Floats) -> Floats:
        """The camera's stamps (n,) of true times; the curve of lateness is taken at the stamp without it."""
        stamped_s = true_s * (1 + self.clock_drift) + self.clock_offset_s
        return stamped_s + _at(self.clock_curve_s, stamped_s)

    def true_pressure(self, shown_pa: Floats, time_s: Floats) -> Floats:
        """Pressure (Pa) where the gauge shows (n,) at times (n,) of its run."""
        wrong = self.gauge_offset_pa + _at(self.gauge_curve_pa, shown_pa) + _at(self.gauge_wander_pa, time_s)
        if self.gauge_memory_pa:
            wrong = wrong + _at(self.gauge_memory_pa, last_direction(shown_pa))
        return (shown_pa - wrong) / (1 + self.gauge_gain)

    def shown_pressure(self, true_pa: float) -> float:
        """The gauge's reading (Pa) at a pressure (Pa)."""
        return (1 + self.gauge_gain) * true_pa + self.gauge_offset_pa

    def seen(self, pose: Floats, time_s: Floats) -> Floats:
        """Tip X, Z, Phi as tracked, (3, n), of a tip at X, Z (m), Phi (rad), (3, n), at times (n,) of its run."""
        x, z, phi = pose
        off_m = self._off_m(time_s)
        x, z = x + off_m * np.sin(phi), z + off_m * np.cos(phi)
        roll, c, s = self._turned(x, time_s)
        x, z = c * x + s * z, c * z - s * x
        return np.stack(
            [
                x + _at(self.camera_x_m, x) + _at(self.camera_x_wander_m, time_s),
                z + _at(self.camera_z_m, x) + _at(self.camera_z_wander_m, time_s),
                phi + roll,
            ]
        )

    def seen_tangent(self, pose: Floats, d_pose: Floats, time_s: Floats) -> Floats:
        """Derivative of `seen`, (3, n, columns), along derivatives of the pose, (3, n, columns)."""
        (x, z, phi), (dx, dz, dphi), off_m = pose[:, :, None], d_pose, self._off_m(time_s[:, None])
        x, z = x + off_m * np.sin(phi), z + off_m * np.cos(phi)
        dx, dz = dx + off_m * np.cos(phi) * dphi, dz - off_m * np.sin(phi) * dphi
        (_, c, s), d_roll = self._turned(x, time_s[:, None]), _slope(self.camera_roll_curve_rad, x) * dx
        x, z, dx, dz = c * x + s * z, c * z - s * x, c * dx + s * dz, c * dz - s * dx
        dx, dz = dx + z * d_roll, dz - x * d_roll
        return np.stack([dx + _slope(self.camera_x_m, x) * dx, dz + _slope(self.camera_z_m, x) * dx, dphi + d_roll])

    def _off_m(self, time_s: Floats) -> Floats | float:
        """How much too far along its axis the tip is taken, m."""
        return self.tip_offset_m + _at(self.tip_offset_wander_m, time_s)

    def _turned(self, x: Floats, time_s: Floats) -> tuple[Floats | float, Floats | float, Floats | float]:
        """The picture's roll, rad, and scale times its cosine and sine."""
        roll = self.camera_roll_rad + _at(self.camera_roll_curve_rad, x) + _at(self.camera_roll_wander_rad, time_s)
        scale = 1 + self.length_scale
        return roll, scale * np.cos(roll), scale * np.sin(roll)


def last_direction(shown_pa: Floats) -> Floats:
    """In which direction a reading (n,), Pa, moved last: 1 up, -1 down; kept at rest, between them in a turn.

    The lag of a play operator behind its input, in its half width (Krasnosel'skii and Pokrovskii, Systems with
    Hysteresis, 1989, section 2).
    """
    return _last_direction(np.ascontiguousarray(shown_pa, dtype=np.float64).tobytes())


@lru_cache(maxsize=128)
def _last_direction(shown_pa: bytes) -> Floats:
    """`last_direction` of float64s; a search asks for that of the same few readings again and again."""
    shown = np.frombuffer(shown_pa)
    out, last = np.empty(len(shown)), float(shown[0])
    for n, value in enumerate(shown.tolist()):
        last = min(max(last, value - TURNS_PA), value + TURNS_PA)
        out[n] = (value - last) / TURNS_PA
    out.flags.writeable = False
    return out


def _at(curve: Curve, x: Floats) -> Floats | float:
    """Values of a curve at x (n,), its ends' beyond them."""
    return np.interp(x, *np.transpose(curve)) if curve else 0.0


def _slope(curve: Curve, x: Floats) -> Floats | float:
    """Slopes of a curve at x, zero beyond its ends."""
    if not curve:
        return 0.0
    where, values = np.transpose(curve)
    slopes = np.concatenate([[0.0], np.diff(values) / np.diff(where), [0.0]])
    return np.asarray(slopes[np.searchsorted(where, x)])
