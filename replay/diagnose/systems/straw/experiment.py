"""The next experiment: of a menu of protocols, the one under which the hypotheses that survive differ most."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.simulate import simulate
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant
from straw.replay.diagnose.settings import SIMULATED_EVERY_S, TOLERANCE_M
from straw.replay.diagnose.systems.straw.constants import applied
from straw.replay.diagnose.systems.straw.of import straw_of

Floats = NDArray[np.float64]

#: Noise the difference is measured in: m, m, rad, with what repeats differ by; and how long noise lasts, s.
SIGMA, LASTS_S = np.array([40e-6, 60e-6, 3e-3]), 0.1
#: What settles of a commanded step at once, s (paper: 97 % within 70 ms).
SETTLES_S = 0.02


@dataclass(frozen=True)
class Experiment:
    """A protocol the rig can run as it is, and why."""

    protocol: str
    initial_deployed: str
    why: str
    expected_separation_sigma: float

    def as_json(self) -> dict[str, Any]:
        """The contract's entry."""
        return dict(vars(self))


@dataclass(frozen=True)
class Choice:
    """An entry of the menu: holds of (kPa, s), cells deployed, and what it is good for."""

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


def next_experiment(campaign: Campaign, survivors: Sequence[Contestant], *, explain: bool = True) -> Experiment | None:
    """The choice with the largest smallest separation of the survivors; None with fewer than two of them.

    ``explain``: whether they explain the runs, or only come nearest of all that do not.
    """
    if len(survivors) < 2:
        return None
    best: tuple[float, Choice] | None = None
    for choice in menu(straw_of(campaign).cells):
        seen = [s for s in (_played(campaign, c, choice) for c in survivors) if s is not None]
        if len(seen) < 2:
            continue
        gaps = [_separation(a, b) for a, b in itertools.combinations(seen, 2)]
        if best is None or min(gaps) > best[0]:
            best = min(gaps), choice
    if best is None:
        return None
    separation, choice = best
    names = [c.name.replace("_", " ") for c in survivors]
    if explain:
        why = f"{choice.why}; would tell {' from '.join(names)}"
    else:
        why = f"{choice.why}; what comes nearest, {' and '.join(names)}, differs most there"
    return Experiment(_toml(choice), ",".join(map(str, choice.deployed)), why, separation)


def _played(campaign: Campaign, contestant: Contestant, choice: Choice) -> Floats | None:
    """Tip (3, n) under a choice as a hypothesis sees it; None where it cannot be played."""
    straw, instrument = applied(straw_of(campaign), contestant.fit.unknowns, contestant.fit.u)
    length = 0.5 + sum(seconds for _, seconds in choice.holds)
    grid = np.arange(0.0, length, SIMULATED_EVERY_S)
    begins = 0.5 + np.cumsum([0.0, *(seconds for _, seconds in choice.holds)])[:-1]

    def pressure(t: Floats) -> Floats:
        out, before = np.zeros_like(t), 0.0
        for begin, (kpa, _) in zip(begins, choice.holds, strict=True):
            out += (1e3 * kpa - before) * np.where(t > begin, 1 - np.exp(-np.clip(t - begin, 0, None) / SETTLES_S), 0)
            before = 1e3 * kpa
        return instrument.true_pressure(out, t)

    try:
        seen = simulate(straw, pressure, grid, choice.deployed, tolerance_m=TOLERANCE_M)
    except ModelError:
        return None
    pose = np.stack([seen.x_m, seen.z_m, seen.phi_rad])
    at = np.clip(instrument.true_time(grid), 0.0, grid[-1])
    return instrument.seen(np.stack([np.interp(at, grid, row) for row in pose]))


def _separation(a: Floats, b: Floats) -> float:
    """How many sigmas two predictions are apart, a stretch as long as noise lasts counting once."""
    n = min(a.shape[1], b.shape[1])
    scaled = (a[:, :n] - b[:, :n]) / SIGMA[:, None]
    return float(np.sqrt(np.sum(scaled**2) * SIMULATED_EVERY_S / LASTS_S))


def _toml(choice: Choice) -> str:
    lines = [
        f"# Proposed by straw diagnose: {choice.why}.",
        f'name = "{choice.name}"',
        'pressure_unit = "kPa"',
        f"initial_deployed = {list(choice.deployed)}",
        "",
        "[[prefix]]",
        "hold = 0",
        "for_s = 0.5",
    ]
    for kpa, seconds in choice.holds:
        lines += ["", "[[main]]", f"hold = {kpa:g}", f"for_s = {seconds:g}"]
    return "\n".join([*lines, "", "[[suffix]]", "hold = 0", "for_s = 0.5", ""])
