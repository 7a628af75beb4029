"""The most informative experiment: protocols simulated by every surviving hypothesis, and their separation."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant
from straw.replay.diagnose.settings import SIMULATED_EVERY_S, TOLERANCE_M
from straw.replay.diagnose.systems.straw.constants import applied
from straw.replay.diagnose.systems.straw.menu import Choice, menu, written
from straw.replay.diagnose.systems.straw.of import straw_of
from straw.replay.diagnose.systems.straw.snaps import crossings, levels_of
from straw.rig.outlet import Outlet
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import protocol_from_toml

Floats = NDArray[np.float64]

#: Unit of the difference: m, m, rad, including differences between repeats; and the noise's correlation time, s.
SIGMA, LASTS_S = np.array([40e-6, 60e-6, 3e-3]), 0.1


@dataclass(frozen=True)
class Experiment:
    """A protocol that the rig can run as it is, and its reason."""

    protocol: str
    initial_deployed: str
    why: str
    expected_separation_sigma: float
    #: What each hypothesis predicts: its name, times (n,), s, and tip (3, n), SI.
    seen: tuple[tuple[str, Floats, Floats], ...] = field(default=(), compare=False, repr=False)

    def as_json(self) -> dict[str, Any]:
        """The contract's entry."""
        return {name: value for name, value in vars(self).items() if name != "seen"}


@dataclass(frozen=True, eq=False)
class Rated:
    """A protocol, the separation of each pair of hypotheses under it in sigmas (k, k), and the largest number of
    snaps."""

    protocol: PressureProtocol
    separation: Floats
    snaps: int

    def information(self, probability: Sequence[float]) -> float:
        """Lower bound of its expected information about the hypothesis, nats; ``probability`` (k,) before it.

        The bound of Kolchinsky and Tracey (Entropy 19, 361, 2017) for a mixture of normal distributions of one
        covariance, s sigma apart, whose Bhattacharyya distance is s^2 / 8: I >= -sum_i p_i ln sum_j p_j exp(-s_ij^2/8).
        """
        p = np.array(probability) / np.sum(probability)
        return float(-np.sum(p * np.log(np.exp(-(np.nan_to_num(self.separation) ** 2) / 8) @ p)))


def next_experiment(campaign: Campaign, survivors: Sequence[Contestant], *, explain: bool = True) -> Experiment | None:
    """Of the menu, that with the largest smallest separation of the survivors; None with fewer than two of them.

    ``explain``: whether they explain the runs, or are only the nearest of those that do not.
    """
    if len(survivors) < 2:
        return None
    choices = menu(straw_of(campaign).cells)
    best: tuple[float, Choice] | None = None
    for choice, one in zip(choices, rated(campaign, survivors, map(written, choices)), strict=True):
        gaps = one.separation[np.triu_indices(len(survivors), 1)] if one else np.array([np.nan])
        gap = float(np.min(gaps[np.isfinite(gaps)], initial=np.inf))
        if np.isfinite(gap) and (best is None or gap > best[0]):
            best = gap, choice
    if best is None:
        return None
    separation, choice = best
    names = [c.name.replace("_", " ") for c in survivors]
    if explain:
        why = f"{choice.why}; would tell {' from '.join(names)}"
    else:
        why = f"{choice.why}; what comes nearest, {' and '.join(names)}, differs most there"
    protocol = protocol_from_toml(written(choice), "an experiment")
    played = (_played(straw_of(campaign), c, protocol) for c in survivors)
    seen = tuple(
        (name, np.arange(tip.shape[1], dtype=np.float64) * SIMULATED_EVERY_S, tip)
        for name, tip in zip(names, played, strict=True)
        if tip is not None
    )
    return Experiment(written(choice), ",".join(map(str, choice.deployed)), why, separation, seen)


def rated(campaign: Campaign, survivors: Sequence[Contestant], protocols: Iterable[str]) -> list[Rated | None]:
    """Protocols (TOML) simulated by these hypotheses on the campaign's workers.

    None where fewer than two can simulate it; the separation of a pair of which one cannot is NaN.
    """
    read = [protocol_from_toml(text, "an experiment") for text in protocols]
    straw = straw_of(campaign)
    jobs = [[campaign.pool.submit(_played, straw, c, protocol) for c in survivors] for protocol in read]
    out: list[Rated | None] = []
    for protocol, row in zip(read, jobs, strict=True):
        seen = [job.result() for job in row]
        separation = np.zeros((len(seen), len(seen)))
        for i, k in itertools.combinations(range(len(seen)), 2):
            a, b = seen[i], seen[k]
            separation[i, k] = separation[k, i] = np.nan if a is None or b is None else _separation(a, b)
        snaps = max((_snaps(one) for one in seen if one is not None), default=0)
        played = sum(one is not None for one in seen)
        out.append(Rated(protocol, separation, snaps) if played > 1 else None)
    return out


def _played(base: StrawParameters, contestant: Contestant, protocol: PressureProtocol) -> Floats | None:
    """Tip (3, n) under a protocol by a hypothesis; None where it cannot be simulated."""
    straw, instrument = applied(base, contestant.fit.unknowns, contestant.fit.u)
    grid = np.arange(0.0, protocol.duration_s, SIMULATED_EVERY_S)
    outlet = Outlet(protocol)
    try:
        seen = simulate(
            straw,
            lambda t: instrument.true_pressure(outlet(t), t),
            grid,
            protocol.initial_deployed,
            tolerance_m=TOLERANCE_M,
        )
    except ModelError:
        return None
    pose = np.stack([seen.x_m, seen.z_m, seen.phi_rad])
    at = np.clip(instrument.true_time(grid), 0.0, grid[-1])
    return instrument.seen(np.stack([np.interp(at, grid, row) for row in pose]))


def _snaps(pose: Floats) -> int:
    """Number of snaps in a tip's motion (3, n)."""
    grid: Floats = np.arange(pose.shape[1], dtype=np.float64) * SIMULATED_EVERY_S
    return len(crossings(grid, pose[2], levels_of(pose[2]))[::2])


def _separation(a: Floats, b: Floats) -> float:
    """Separation of two predictions in sigmas, where an interval of the noise's correlation time counts once."""
    n = min(a.shape[1], b.shape[1])
    scaled = (a[:, :n] - b[:, :n]) / SIGMA[:, None]
    return float(np.sqrt(np.sum(scaled**2) * SIMULATED_EVERY_S / LASTS_S))
