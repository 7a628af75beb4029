"""The paper's two validation runs (section 3.3, Figs. 6 and 7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction, simulate

Floats = NDArray[np.float64]

#: Ten times the camera's rate, so that a snap is a curve.
RATE_HZ, DURATION_S = 2400.0, 6.0
RISE_PER_S = 50.0


@dataclass(frozen=True)
class ValidationRun:
    """A run of the paper: the straw with its refitted constants, the steady pressure and the cells it starts with."""

    name: str
    figure: int
    straw: StrawParameters
    steady_pa: float
    deployed: tuple[int, ...]
    snapping: tuple[int, ...]

    def pressure_pa(self, time_s: Floats) -> Floats:
        """The external pressure, p_ss (1 - exp(-50 t))."""
        return np.asarray(self.steady_pa * (1 - np.exp(-RISE_PER_S * time_s)))

    def simulate(self) -> Prediction:
        """The model's motion, 2400 times a second."""
        return simulate(self.straw, self.pressure_pa, np.arange(0, DURATION_S, 1 / RATE_HZ), self.deployed)


FOLDING = ValidationRun(
    "folding",
    6,
    StrawParameters(c_zeta_n_s_per_m=np.array(620.0), c_phi_n_m_s_per_rad=np.array(7e-4), r_ch_m=0.43e-3),
    -25e3,
    (1, 4),
    (1, 4),
)
DEPLOYMENT = ValidationRun(
    "deployment",
    7,
    StrawParameters(c_zeta_n_s_per_m=np.array(0.1), c_phi_n_m_s_per_rad=np.array(3e-3), r_ch_m=0.315e-3),
    35e3,
    (2, 3, 5, 6, 7, 8, 9),
    (1, 4),
)


def crossing_s(run: Prediction, cell: int) -> float:
    """First time at which a cell's even frustum passes through zeta = 0, s; NaN where it never does."""
    zeta = run.zeta_m[:, cell - 1, 1]
    after = np.flatnonzero(np.sign(zeta[1:]) != np.sign(zeta[:-1]))
    if not after.size:
        return float("nan")
    i = int(after[0])
    share = zeta[i] / (zeta[i] - zeta[i + 1])
    return float(run.time_s[i] + share * (run.time_s[i + 1] - run.time_s[i]))
