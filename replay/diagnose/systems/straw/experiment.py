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
from straw.replay.diagnose.systems.straw.separation import STIFF, separation, snap_scatter, snap_times
from straw.rig.outlet import Outlet
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import protocol_from_toml

Floats = NDArray[np.float64]


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

    None where fewer than two can simulate it, or where repeats of the first's straw may snap or not; the separation of
    a pair of which one cannot simulate it is NaN.
    """
    read = [protocol_from_toml(text, "an experiment") for text in protocols]
    straw = straw_of(campaign)
    stiff = straw.replace(E_pa=np.asarray(straw.E_pa) * STIFF)
    jobs = [
        [
            *(campaign.pool.submit(_played, straw, c, protocol) for c in survivors),
            campaign.pool.submit(_played, stiff, survivors[0], protocol),
        ]
        for protocol in read
    ]
    return [
        _rated(protocol, [job.result() for job in row[:-1]], row[-1].result())
        for protocol, row in zip(read, jobs, strict=True)
    ]


def _rated(protocol: PressureProtocol, seen: Sequence[Floats | None], stiff: Floats | None) -> Rated | None:
    """From the tips (3, n) that hypotheses predict, and that of the first's with stiffer walls."""
    played = [one for one in seen if one is not None]
    first = seen[0]
    scatter_s = np.zeros(0) if first is None or stiff is None else snap_scatter(first, stiff)
    if len(played) < 2 or scatter_s is None:
        return None
    apart = np.zeros((len(seen), len(seen)))
    for i, k in itertools.combinations(range(len(seen)), 2):
        a, b = seen[i], seen[k]
        apart[i, k] = apart[k, i] = np.nan if a is None or b is None else separation(a, b, scatter_s)
    return Rated(protocol, apart, max(len(snap_times(one)[::2]) for one in played))


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
    return instrument.seen(np.stack([np.interp(at, grid, row) for row in pose]), at)
