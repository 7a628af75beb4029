"""The channel's effective radius from filling tests (section 3.1 and Fig. S1 of the paper)."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from straw.model.errors import ModelError

Floats = NDArray[np.float64]

COLUMNS = ("volume_m3", "pressure_difference_pa", "filling_time_s")
CONFIDENCE = 0.95


@dataclass(frozen=True)
class FillingTests:
    """A table of filling tests: arrays (tests,), all above zero."""

    volume_m3: Floats
    pressure_difference_pa: Floats
    filling_time_s: Floats

    @property
    def flow_m3_per_s(self) -> Floats:
        """Mean flow of each test: the paper's dV/dt = V / t_f."""
        return self.volume_m3 / self.filling_time_s


@dataclass(frozen=True)
class ChannelRadius:
    """r_ch with its 95 % interval, and how well the tests agree with the law.

    ``scatter`` is the relative standard deviation of the flows about the law. ``exponent`` is that of the flow in the
    pressure difference, left free: 1/2 for Bernoulli's law, 1 if friction along the walls (Poiseuille) ruled.
    """

    r_ch_m: float
    low_m: float
    high_m: float
    scatter: float
    exponent: float
    exponent_sigma: float
    tests: int


def read_filling_tests(path: Path) -> FillingTests:
    """Filling tests from a CSV with columns volume_m3, pressure_difference_pa, filling_time_s; # starts a comment."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise ModelError(f"{path}: cannot read the filling tests: {reason}") from None
    numbered = [(i, line) for i, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
    header = [name.strip() for name in numbered[0][1].split(",")] if numbered else []
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise ModelError(f"{path}: no column {missing[0]}; the first line names the columns {', '.join(COLUMNS)}")
    rows = []
    for (number, _), row in zip(numbered[1:], csv.DictReader((line for _, line in numbered[1:]), header), strict=True):
        try:
            values = [float(row[name] or "") for name in COLUMNS]
        except (TypeError, ValueError):
            raise ModelError(f"{path}: line {number}: not three numbers; correct or remove the line") from None
        if not all(math.isfinite(value) and value > 0 for value in values):
            raise ModelError(f"{path}: line {number}: volume, pressure difference and time must be above zero")
        rows.append(values)
    return FillingTests(*np.array(rows, dtype=np.float64).reshape(-1, len(COLUMNS)).T)


def channel_radius(tests: FillingTests, rho_kg_per_m3: float = 1000.0) -> ChannelRadius:
    """r_ch from equation 2 read for a vessel: V / t_f = pi r_ch^2 sqrt(2 dp / rho).

    Least squares on the logarithm of the flow, in which a scatter that is a share of the flow (times read by eye,
    leaks, a pressure known to a percent) weighs each test alike; Student's t for the interval of the mean.
    Raises ModelError for fewer than three tests.
    """
    n = len(tests.volume_m3)
    if n < 3:
        raise ModelError(f"filling tests: {n} of them say nothing about their scatter; give three at least")
    flow, pressure = np.log(tests.flow_m3_per_s), np.log(tests.pressure_difference_pa)
    log_r = (flow - np.log(math.pi * np.sqrt(2 * tests.pressure_difference_pa / rho_kg_per_m3))) / 2
    mean, sigma = float(log_r.mean()), float(log_r.std(ddof=1))
    half = float(student.ppf((1 + CONFIDENCE) / 2, n - 1)) * sigma / math.sqrt(n)
    exponent = exponent_sigma = math.nan
    spread = pressure - pressure.mean()
    if float(spread @ spread) > 1e-6:
        exponent = float(spread @ flow / (spread @ spread))
        rest = flow - flow.mean() - exponent * spread
        exponent_sigma = math.sqrt(float(rest @ rest) / (n - 2) / float(spread @ spread))
    return ChannelRadius(
        math.exp(mean), math.exp(mean - half), math.exp(mean + half), 2 * sigma, exponent, exponent_sigma, n
    )
