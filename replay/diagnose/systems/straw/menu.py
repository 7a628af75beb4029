"""Protocols that may be proposed: a menu of proven kinds, and random and varied ones within the rig's limits."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from straw.rig.limits import STRAW_LIMITS, PressureLimits

#: Levels are whole multiples of this, kPa, and times of this, s, for readability and the controller's resolution.
LEVEL_KPA, TIME_S = 0.5, 0.1
#: Range of a hold's duration, s: a snap is over after some 0.3 s, and a straw comes to rest in some two.
SHORTEST_S, LONGEST_S = 0.3, 6.0
#: Size of a variation, as one standard deviation of a logarithm.
VARIES = 0.2


@dataclass(frozen=True)
class Choice:
    """An entry of the menu: holds of (kPa, s), cells deployed, and its purpose."""

    name: str
    deployed: tuple[int, ...]
    holds: tuple[tuple[float, float], ...]
    why: str


def menu(cells: int) -> list[Choice]:
    """Protocols worth trying: three rates, dwells below the threshold, both directions, elastic pulses."""
    every = tuple(range(1, cells + 1))
    most = tuple(c for c in every if c not in (1, 4))
    out = []
    for kpa in (26.0, 30.0, 40.0):
        out.append(
            Choice(f"deploy-{kpa:.0f}kPa", most, ((kpa, 4.0),), "deployment at another pressure: speed of snaps")
        )
    out.append(Choice("dwell-below", most, ((20.0, 3.0), (35.0, 3.0)), "a dwell below the threshold, then deployment"))
    out.append(Choice("deploy-all", (), ((30.0, 6.0),), "every cell deploys, from the folded state"))
    for kpa in (-16.0, -22.0, -30.0):
        out.append(Choice(f"fold{kpa:.0f}kPa", (1, 4), ((kpa, 4.0),), "folding at another suction: speed of snaps"))
    out.append(Choice("dwell-above", (1, 4), ((-10.0, 3.0), (-25.0, 3.0)), "a dwell above the threshold, then folding"))
    pulses = tuple((p, 0.3) for p in (12.0, -9.0, 12.0, -9.0, 12.0, 0.0))
    out.append(Choice("pulses", every, pulses, "no snap: elasticity, the line and the gauge alone"))
    out.append(Choice("pulses-folded", (1,), pulses, "no snap with most cells folded: the folded state alone"))
    steps = tuple((p, 0.6) for p in (4.0, 8.0, 12.0, 8.0, 4.0, 0.0, -4.0, -8.0, -4.0, 0.0))
    out.append(Choice("stairs", every, steps, "small steps: gain and offset of gauge and length"))
    return [c for c in out if all(cell <= cells for cell in c.deployed)]


def drawn(rng: np.random.Generator, cells: int, limits: PressureLimits = STRAW_LIMITS) -> Choice:
    """One to three holds at any pressures within the limits, for any times, from any configuration."""
    count = int(rng.integers(1, 4))
    levels = rng.uniform(limits.min_pa / 1e3, limits.max_pa / 1e3, count)
    times = np.exp(rng.uniform(np.log(SHORTEST_S), np.log(LONGEST_S), count))
    share = rng.choice([0.0, 0.2, 0.8, 1.0])
    deployed = tuple(int(c) for c in np.flatnonzero(rng.random(cells) < share) + 1)
    return _neat(Choice("", deployed, tuple(zip(levels, times, strict=True)), "designed"), limits)


def varied(choice: Choice, rng: np.random.Generator, limits: PressureLimits = STRAW_LIMITS) -> Choice:
    """A variation with other levels and times nearby."""
    factors = np.exp(VARIES * rng.normal(size=(len(choice.holds), 2)))
    holds = tuple((kpa * f, s * g) for (kpa, s), (f, g) in zip(choice.holds, factors, strict=True))
    return _neat(replace(choice, holds=holds), limits)


def _neat(choice: Choice, limits: PressureLimits) -> Choice:
    """With round numbers within the limits, and a descriptive name."""
    low, high = np.ceil(limits.min_pa / 1e3 / LEVEL_KPA), np.floor(limits.max_pa / 1e3 / LEVEL_KPA)
    holds = tuple(
        (
            float(np.clip(round(kpa / LEVEL_KPA), low, high)) * LEVEL_KPA,
            round(max(TIME_S, round(float(np.clip(s, SHORTEST_S, LONGEST_S)) / TIME_S) * TIME_S), 3),
        )
        for kpa, s in choice.holds
    )
    name = "designed" + "".join(f"{kpa:+g}" for kpa, _ in holds) + "kPa"
    return replace(choice, name=name, holds=holds)


def allowed(choice: Choice, limits: PressureLimits) -> bool:
    """Whether every level is within the limits."""
    return not any(limits.why_not(1e3 * kpa) for kpa, _ in choice.holds)


def written(choice: Choice, limits: PressureLimits = STRAW_LIMITS) -> str:
    """The protocol as TOML; where the limits hold a rate, every step is a ramp at nine tenths of it."""
    lines = [
        f"# Proposed by straw: {choice.why}.",
        f'name = "{choice.name}"',
        'pressure_unit = "kPa"',
        f"initial_deployed = {list(choice.deployed)}",
        "",
        "[[prefix]]",
        "hold = 0",
        "for_s = 0.5",
    ]
    before = 0.0
    for kpa, seconds in choice.holds:
        lines += [*_ramp("main", before, kpa, limits), "", "[[main]]", f"hold = {kpa:g}", f"for_s = {seconds:g}"]
        before = kpa
    lines += [*_ramp("suffix", before, 0.0, limits), "", "[[suffix]]", "hold = 0", "for_s = 0.5", ""]
    return "\n".join(lines)


def _ramp(section: str, before: float, after: float, limits: PressureLimits) -> list[str]:
    rate = limits.max_rate_pa_s
    if rate is None or before == after:
        return []
    # a tenth slower than allowed
    seconds = abs(after - before) / (0.9 * rate / 1e3)
    return ["", f"[[{section}]]", f"ramp = [{before:g}, {after:g}]", f"for_s = {seconds:.6g}"]
