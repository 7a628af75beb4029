"""TipTrace: the tip's X, Z and Phi over time, each sample with its sigma and a validity flag."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.tracking.errors import TrackingError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class TipTrace:
    """Tip pose against time; every array has shape (n,).

    World frame: origin at the middle of the straw's base, X horizontal, Z up; the tip axis is (sin phi, cos phi) in
    (X, Z). A sample with ``valid`` False carries no information: its pose is NaN. Unknown sigmas are NaN.
    """

    time_s: Floats
    x_m: Floats
    z_m: Floats
    phi_rad: Floats
    sigma_x_m: Floats
    sigma_z_m: Floats
    sigma_phi_rad: Floats
    valid: NDArray[np.bool_]
    frame: NDArray[np.int64]

    def __post_init__(self) -> None:
        n = len(self.time_s)
        for name in ("x_m", "z_m", "phi_rad", "sigma_x_m", "sigma_z_m", "sigma_phi_rad", "valid", "frame"):
            if getattr(self, name).shape != (n,):
                raise TrackingError(f"TipTrace.{name} has shape {getattr(self, name).shape}, expected ({n},) as time_s")
        if n > 1 and not np.all(np.diff(self.time_s) > 0):
            raise TrackingError(
                "TipTrace.time_s must increase strictly: sort the samples and drop repeated times first"
            )

    def __len__(self) -> int:
        return len(self.time_s)
