"""Assessment of a model's error: E against the validation uncertainty, following ASME V&V 20-2009."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.metrics.noise import independent

Floats = NDArray[np.float64]

#: Coverage factor: the model's own error is in E +- K u_val with about 95 % confidence.
K = 2.0

UNRESOLVED = "cannot be resolved"
RESOLVED = "off"
UNKNOWN = "no statement"


@dataclass(frozen=True)
class Quantity:
    """One figure of merit in measurement and prediction (unit in ``unit``), and the uncertainties of the comparison.

    ``u_data``: the measurement's standard uncertainty; ``u_num``: the integration's error; ``u_input``: the effect of
    the inputs' uncertainties (pressure, constants) on the prediction.
    """

    name: str
    unit: str
    measured: float
    predicted: float
    u_data: float
    u_num: float
    u_input: float

    @property
    def error(self) -> float:
        """E = prediction - measurement."""
        return self.predicted - self.measured

    @property
    def u_val(self) -> float:
        """Validation uncertainty: root of the sum of squares of the three."""
        return math.sqrt(self.u_data**2 + self.u_num**2 + self.u_input**2)

    @property
    def verdict(self) -> str:
        """An error within K u_val does not assess the model: "cannot be resolved", which is not "validated"."""
        if not (math.isfinite(self.error) and math.isfinite(self.u_val)):
            return UNKNOWN
        return UNRESOLVED if abs(self.error) <= K * self.u_val else RESOLVED

    @property
    def words(self) -> str:
        """The verdict in words."""
        if self.verdict == RESOLVED:
            return f"the model is off by {self.error:.3g} ± {K * self.u_val:.2g} {self.unit}"
        if self.verdict == UNRESOLVED:
            return f"the model's error is below what can be resolved, {K * self.u_val:.2g} {self.unit}"
        missing = [
            who for who, v in (("measurement", self.measured), ("prediction", self.predicted)) if not math.isfinite(v)
        ]
        if missing:
            return f"not in the {' nor in the '.join(missing)}"
        unknown = "the measurement's sigma is unknown"
        return unknown if not math.isfinite(self.u_data) else "within the inputs' uncertainty it may not happen at all"


def signal_verdict(error: Floats, u_val: Floats) -> str:
    """The verdict on a whole signal: mean square of E / u_val against what noise of the same correlation gives."""
    scaled = error / u_val
    if not np.all(np.isfinite(scaled)):
        return UNKNOWN
    scatter = float(np.sqrt(2 / independent(scaled, squares=True)))
    return UNRESOLVED if float(np.mean(scaled**2)) <= 1 + K * scatter else RESOLVED
