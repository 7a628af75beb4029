"""PressureLimits: what the straw and the operator allow; RateLimiter: how far one channel may go from where it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

from straw.rig.errors import RigError


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
        """The limits that satisfy both: combining limits can only narrow them."""
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
"""The default: the paper's straw folds and deploys between -25 and +35 kPa; this leaves half as
much again and stays far below the regulator's 100 kPa."""


# after a long hold a rate limit must not allow one long jump: unused change accumulates for this long only
SAVED_S = 0.25


class RateLimiter:
    """How far a limit in Pa/s lets one channel go from where it may be; times in s on any one clock.

    Over any time T the commanded pressure travels no more than ``rate * (T + 0.25 s)`` and one step of the instrument,
    however often it is commanded (a token bucket that fills at the rate). A set that was not acknowledged may or may
    not have arrived, so until the next one both values are taken into account.
    """

    def __init__(self, step_pa: float) -> None:
        self.step_pa = step_pa
        # the last acknowledged command, and those that may have arrived since
        self.places_pa: tuple[float, ...] = (0.0,)
        self._credit_pa = math.inf
        self._at_s = -math.inf

    def why_not(self, pressure_pa: float, rate_pa_s: float | None, now_s: float) -> str | None:
        """None when this pressure may be commanded now, else the reason; counts as commanded when allowed."""
        farthest_pa = max(self.places_pa, key=lambda place: abs(pressure_pa - place))
        change_pa = abs(pressure_pa - farthest_pa)
        if rate_pa_s is not None:
            # One step of the instrument is always affordable, or rounding alone could break a slow ramp.
            full_pa = rate_pa_s * SAVED_S + self.step_pa
            credit_pa = min(self._credit_pa + rate_pa_s * (now_s - self._at_s), full_pa) if change_pa else full_pa
            if change_pa > credit_pa * (1 + 1e-9):
                return (
                    f"{farthest_pa / 1e3:g} to {pressure_pa / 1e3:g} kPa at once breaks the limit of "
                    f"{rate_pa_s / 1e3:g} kPa/s"
                )
            if change_pa:
                self._credit_pa, self._at_s = credit_pa - change_pa, now_s
        self.places_pa = (*self.places_pa, pressure_pa)
        return None

    def arrived(self, pressure_pa: float) -> None:
        """The instrument acknowledged this pressure, a vent included, which no rate holds back."""
        self.places_pa = (pressure_pa,)
