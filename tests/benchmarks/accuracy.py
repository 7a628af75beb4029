"""Errors of a validation run's solution against the reference, in the quantities for which an accuracy is required."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from straw.model.simulate import Prediction, simulate
from straw.model.straw import seen
from straw.replay.paper.runs import DURATION_S, ValidationRun

Floats = NDArray[np.float64]

REFERENCE = Path(__file__).resolve().parents[3] / "shared" / "reference"
FILES = {"folding": "fold.csv", "deployment": "deploy.csv"}
#: RMS of X, Z (m) and Phi (rad), and the time of the snaps (s).
WANTED = (10e-6, 10e-6, 0.3e-3, 1e-3)
#: Output at 240 Hz.
TIME_S = np.arange(round(DURATION_S * 240)) / 240


@dataclass(frozen=True)
class Solution:
    """Tip (3, n) and the even frusta of the cells that snap (cells, n), m, at TIME_S without its first time."""

    tip: Floats
    zeta_m: Floats

    @classmethod
    def of_coordinates(cls, run: ValidationRun, q: Floats) -> Self:
        """From coordinates (1 + n, coordinates) of the truncated form."""
        x_m, z_m, phi_rad, _ = seen(run.straw.constants(), np.ascontiguousarray(q))
        return cls(np.array([x_m, z_m, phi_rad])[:, 1:], q[1:, [cell - 1 for cell in run.snapping]].T)

    @classmethod
    def of_prediction(cls, run: ValidationRun, p: Prediction) -> Self:
        """From the model's simulation."""
        return cls(np.array([p.x_m, p.z_m, p.phi_rad])[:, 1:], p.zeta_m[1:, [cell - 1 for cell in run.snapping], 1].T)

    def crossing_s(self, row: int) -> float:
        """First time at which a frustum passes through zeta = 0, s; infinite where it never does."""
        time_s, zeta = TIME_S[1:], self.zeta_m[row]
        after = np.flatnonzero(np.sign(zeta[1:]) != np.sign(zeta[:-1]))
        if not after.size:
            return float("inf")
        i = int(after[0])
        return float(time_s[i] + zeta[i] / (zeta[i] - zeta[i + 1]) * (time_s[i + 1] - time_s[i]))

    def errors(self, truth: Solution) -> tuple[float, float, float, float]:
        """RMS of X, Z (m), Phi (rad) and the worst snap's time (s)."""
        x, z, phi = np.sqrt(np.mean((self.tip - truth.tip) ** 2, axis=1))
        late = max(abs(self.crossing_s(row) - truth.crossing_s(row)) for row in range(len(self.zeta_m)))
        return float(x), float(z), float(phi), late


@cache
def reference(name: str) -> Solution | None:
    """The given solution, where the folder exists."""
    path = REFERENCE / FILES[name]
    if not path.is_file():
        return None
    table = np.genfromtxt(path, delimiter=",", names=True)
    return Solution(
        np.array([table[k] for k in ("x_m", "z_m", "phi_rad")]), np.array([table[f"zeta_{i}_2_m"] for i in (1, 4)])
    )


def truth(run: ValidationRun) -> Solution:
    """The given solution, or the model's own at a hundredth of the tolerance where the folder is missing."""
    return reference(run.name) or Solution.of_prediction(
        run, simulate(run.straw, run.pressure_pa, TIME_S, run.deployed, tolerance_m=1e-8)
    )


def good(errors: tuple[float, ...]) -> bool:
    """Whether all errors are within the required accuracy."""
    return all(error <= wanted for error, wanted in zip(errors, WANTED, strict=True))


def shown(errors: tuple[float, ...]) -> str:
    """Errors in customary units, as wide as ERRORS_HEAD."""
    x, z, phi, late = errors
    return f"{x * 1e6:>9.2f}{z * 1e6:>9.2f}{phi * 1e3:>11.3f}{late * 1e3:>10.3f}"


ERRORS_HEAD = f"{'X / um':>9}{'Z / um':>9}{'Phi / mrad':>11}{'snap / ms':>10}"
