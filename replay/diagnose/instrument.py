"""What camera, clock and gauge may do to a run: the contract's measurement faults, applied to what a straw does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Instrument:
    """Faults of the apparatus; all zero is a faultless one.

    A camera with a late clock stamps t + ``clock_offset_s`` + ``clock_drift`` t. A gauge shows
    (1 + ``gauge_gain``) p + ``gauge_offset_pa``. The camera's picture is turned by ``camera_roll_rad`` in the sense of
    growing Phi, stretched by 1 + ``length_scale``, and the tip is taken ``tip_offset_m`` too far along its axis.
    """

    clock_offset_s: float = 0.0
    clock_drift: float = 0.0
    length_scale: float = 0.0
    camera_roll_rad: float = 0.0
    tip_offset_m: float = 0.0
    gauge_offset_pa: float = 0.0
    gauge_gain: float = 0.0

    def true_time(self, stamped_s: Floats) -> Floats:
        """When something happened (s since the run's zero) that the camera stamped (n,)."""
        return (stamped_s - self.clock_offset_s) / (1 + self.clock_drift)

    def true_pressure(self, shown_pa: Floats) -> Floats:
        """Pressure (Pa) where the gauge shows (n,)."""
        return (shown_pa - self.gauge_offset_pa) / (1 + self.gauge_gain)

    def shown_pressure(self, true_pa: float) -> float:
        """What the gauge shows (Pa) at a pressure (Pa)."""
        return (1 + self.gauge_gain) * true_pa + self.gauge_offset_pa

    def seen(self, pose: Floats) -> Floats:
        """Tip X, Z, Phi as tracked, (3, n), of a tip at X, Z (m), Phi (rad), (3, n)."""
        x, z, phi = pose
        x, z = x + self.tip_offset_m * np.sin(phi), z + self.tip_offset_m * np.cos(phi)
        c, s = np.cos(self.camera_roll_rad), np.sin(self.camera_roll_rad)
        scale = 1 + self.length_scale
        return np.stack([scale * (c * x + s * z), scale * (c * z - s * x), phi + self.camera_roll_rad])
