"""PressureLimits: what the straw and the operator allow, checked below every script that asks for pressure."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rig.errors import RigError


@dataclass(frozen=True)
class PressureLimits:
    """Gauge pressure range (Pa) and, if given, the largest rate of change (Pa/s); raises RigError when impossible."""

    min_pa: float
    max_pa: float
    max_rate_pa_s: float | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.min_pa) and math.isfinite(self.max_pa) and self.min_pa <= 0.0 <= self.max_pa):
            raise RigError(
                f"pressure limits {self.min_pa:g}..{self.max_pa:g} Pa must be finite and contain 0, the vented state"
            )
        rate = self.max_rate_pa_s
        if rate is not None and not (math.isfinite(rate) and rate > 0.0):
            raise RigError(f"pressure rate limit {rate:g} Pa/s must be finite and above 0; leave it out for no limit")

    def __str__(self) -> str:
        rate = "" if self.max_rate_pa_s is None else f", at most {self.max_rate_pa_s / 1e3:g} kPa/s"
        return f"{self.min_pa / 1e3:g}..{self.max_pa / 1e3:g} kPa{rate}"

    def and_also(self, other: PressureLimits) -> PressureLimits:
        """The limits that satisfy both: two limits can only ever narrow each other."""
        rates = [rate for rate in (self.max_rate_pa_s, other.max_rate_pa_s) if rate is not None]
        return PressureLimits(
            max(self.min_pa, other.min_pa), min(self.max_pa, other.max_pa), min(rates) if rates else None
        )

    def why_not(self, pressure_pa: float) -> str | None:
        """None when the pressure (Pa) may be commanded, else the reason in a few words."""
        if not math.isfinite(pressure_pa):
            return f"{pressure_pa} is not a pressure"
        if pressure_pa > self.max_pa:
            return f"{pressure_pa / 1e3:g} kPa is above the limit of {self.max_pa / 1e3:g} kPa"
        if pressure_pa < self.min_pa:
            return f"{pressure_pa / 1e3:g} kPa is below the limit of {self.min_pa / 1e3:g} kPa"
        return None


STRAW_LIMITS = PressureLimits(min_pa=-40e3, max_pa=60e3)
"""Used when nobody says otherwise: the paper's straw folds and deploys between -25 and +35 kPa; this leaves half as
much again and stays far below the regulator's 100 kPa."""
