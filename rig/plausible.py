"""Expectation: the range that a channel can read next, for wires without checksum and lost links that read as 0."""

from __future__ import annotations

from straw.rig.limits import PressureLimits
from straw.rig.reading import Answer

MARGIN_PA = 2e3  # margin for noise, drift, a straw that snaps against the controller
OVERSHOOT = 0.1  # share of the commanded change


class Expectation:
    """A healthy controller reads a value between its last reading and its commands since, within a margin.

    A single reading outside that range is rejected. Two in a row that agree are accepted, as supplies can fail; but
    never a sudden exact 0, which is how a lost link reads.
    """

    def __init__(self) -> None:
        self._within: tuple[float, ...] = ()  # empty: any reading is plausible
        self._doubted_pa: float | None = None

    def forget(self) -> None:
        """Accept any next reading: the link was reopened."""
        self._within, self._doubted_pa = (), None

    def told(self, pressure_pa: float) -> None:
        """Note a pressure that was commanded, or may have been."""
        if self._within:
            self._within = (*self._within, pressure_pa)

    def why_not(self, pressure_pa: float, in_force_pa: tuple[float, ...]) -> str | None:
        """None when the reading is plausible, and then the next one starts from it; else why it is rejected."""
        low, high = min(self._within, default=pressure_pa), max(self._within, default=pressure_pa)
        margin_pa = MARGIN_PA + OVERSHOOT * (high - low)
        if not low - margin_pa <= pressure_pa <= high + margin_pa:
            seen_before = self._doubted_pa is not None and abs(self._doubted_pa - pressure_pa) <= margin_pa
            self._doubted_pa = pressure_pa
            if pressure_pa == 0.0:
                return "reads exactly 0 all at once, as a lost link does"
            if not seen_before:
                return f"reads {pressure_pa / 1e3:g} kPa where only {low / 1e3:g} to {high / 1e3:g} kPa can be"
        self._within, self._doubted_pa = (pressure_pa, *in_force_pa), None
        return None

    def why_refused(
        self, channel: int, answer: Answer, span: PressureLimits, in_force_pa: tuple[float, ...]
    ) -> str | None:
        """Why an instrument's answer is not used for a channel; None when it is, as ``why_not``.

        ``span`` is the instrument's own range, which readings pass by a twentieth at most.
        """
        if channel not in answer.pressure_pa:
            return f"channel {channel} is not in its reply {answer.raw!r}; check the channel number"
        pressure_pa, slack_pa = answer.pressure_pa[channel], 0.05 * (span.max_pa - span.min_pa)
        if not span.min_pa - slack_pa <= pressure_pa <= span.max_pa + slack_pa:
            return f"reads {pressure_pa / 1e3:g} kPa ({answer.raw!r}), beyond its own range; not used"
        reason = self.why_not(pressure_pa, in_force_pa)
        return f"{reason} ({answer.raw!r}); not used" if reason else None
