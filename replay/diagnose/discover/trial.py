"""One candidate fitted: a system with laws, all constants free, and its error of prediction.

Sigma follows the fit (tempering): a wrong model leaves far more than noise, and with the noise as sigma only its worst
samples would count. It ends at the fit's residual, or at the recordings' noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.discover.blocks import blocks, independent, predicted
from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.settings import FAILED_SIGMAS
from straw.replay.diagnose.systems.function.laws import Law
from straw.replay.diagnose.systems.function.least import least
from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.shapes import TABLE
from straw.replay.diagnose.systems.function.stack import Stacked, stacked
from straw.replay.diagnose.systems.function.system import FunctionSystem

Floats = NDArray[np.float64]

#: Rounds in which sigma follows the fit; evaluations of each; the least gain of a step as a share of the cost.
TEMPERED, ROUNDS, SHARE = 3, 12, 1e-3
#: The same for a law that is accepted.
LAST_ROUNDS, LAST_SHARE = 30, 1e-5
#: Sigma has converged where it changes by less than this share.
FOLLOWS = 0.1
#: Prior deviation of a table's point from the line between its neighbours, in units that change its place by its size.
ROUGH = 1.0
#: A channel is explained if its RMS is within this multiple of the noise.
TO_NOISE = 1.3
#: Least sigma, in the recordings' noise.
NOISE = 1.0


@dataclass(frozen=True, eq=False)
class Trial:
    """A fit of a system with laws.

    ``squared`` (channels,) is the mean squared difference where it was fitted, ``errors`` (channels, blocks) the
    cross-validated squared error in sigmas of ``unit`` (channels,), ``worth`` the effective number of independent
    samples.
    """

    campaign: Campaign
    fit: Fit
    squared: Floats
    errors: Floats
    unit: Floats
    worth: float
    noise: Floats  # the error of the recordings' noise alone, in the same sigmas, (channels,)
    ahead: Floats  # squared error, likewise, that undetermined constants make in recordings that are held out

    @property
    def system(self) -> FunctionSystem:
        """The system with its laws."""
        assert isinstance(self.campaign.system, FunctionSystem)
        return self.campaign.system

    @property
    def laws(self) -> tuple[Law, ...]:
        """Its laws."""
        return self.system.laws

    @property
    def error(self) -> Floats:
        """Cross-validated squared error of each block, (blocks,)."""
        return np.asarray(self.errors.sum(axis=0))

    @property
    def to_noise(self) -> bool:
        """Whether it explains every channel to its noise."""
        return bool(np.all(np.sqrt(self.squared) <= TO_NOISE * noise_in(self.campaign.observations)))

    @property
    def predicts(self) -> float:
        """Cross-validated squared error of all channels (`of_all`), at least that of noise, and of constants where
        these are held out."""
        return of_all(np.maximum(self.errors.sum(axis=1), self.noise) + self.ahead)

    def evidence(self, worth: float) -> float:
        """Schwarz's criterion on n independent samples, smaller is better: n log(mean square) + constants log n, each
        channel with a sigma of its own."""
        square = float(np.mean(np.log(np.maximum(self.squared / self.unit**2, 1e-300))))
        return worth * square + len(self.fit.u) * float(np.log(max(worth, 2.0)))

    @property
    def values(self) -> dict[str, float]:
        """All values by target."""
        return self.system.values(self.fit.unknowns, self.fit.u)


def of_all(squares: Floats) -> float:
    """Squared error of all channels from that of each, (channels,): their geometric mean times their number.

    Each channel has an unknown sigma of its own, so its likelihood goes by the logarithm of its error: what improves
    one channel is not hidden by the error that remains in another.
    """
    return float(len(squares) * np.exp(np.mean(np.log(np.maximum(squares, 1e-300)))))


def rough(unknowns: Sequence[Unknown], laws: Sequence[Law]) -> Floats | None:
    """Rows (k, unknowns) of the tables' roughness penalty; None without a table."""
    out = []
    for number, law in enumerate(laws):
        if law.shape != TABLE:
            continue
        at = [k for k, one in enumerate(unknowns) if one.target.startswith(f"law.{number}.value")]
        for a, b, c in zip(range(len(law.at) - 2), range(1, len(law.at) - 1), range(2, len(law.at)), strict=True):
            row = np.zeros(len(unknowns))
            share = (law.at[b] - law.at[a]) / (law.at[c] - law.at[a])
            row[at[a]], row[at[b]], row[at[c]] = share - 1, 1.0, -share
            out.append(row / ROUGH)
    return np.array(out) if out else None


def squares(campaign: Campaign, fit: Fit) -> Floats:
    """Mean squared difference where it was fitted, (channels,), in the channels' units."""
    system = campaign.system
    assert isinstance(system, FunctionSystem)
    total, count = np.zeros(len(system.channels)), np.zeros(len(system.channels))
    for one, part in zip(campaign.observations, campaign.slices(), strict=True):
        assert isinstance(one, Recorded)
        shape = one.seen.shape
        r = fit.residual[part][:-1].reshape(shape) * np.array(system.sigma or one.noise)[:, None]
        total += np.sum(r**2, axis=1)
        count += np.sum(one.fitted & np.isfinite(one.seen), axis=1)
    return np.asarray(total / np.maximum(count, 1))


def sigma_of(campaign: Campaign, squared: Floats) -> tuple[float, ...]:
    """Sigma after a fit with this residual, (channels,)."""
    noise = noise_in(campaign.observations)
    return tuple(float(x) for x in np.maximum(np.sqrt(squared), NOISE * noise))


def noise_in(recordings: Sequence[Any]) -> Floats:
    """Noise of a channel of recordings, (channels,): the median of theirs."""
    return np.asarray(np.median([one.noise for one in recordings], axis=0))


def tried(
    campaign: Campaign,
    unknowns: Sequence[Unknown],
    u: Floats,
    unit: Floats,
    tempered: int = TEMPERED,
    *,
    rounds: int = ROUNDS,
    share: float = SHARE,
) -> Trial:
    """A fit from u, sigma following it, and its predicted error in sigmas of ``unit`` (channels,)."""
    system = campaign.system
    assert isinstance(system, FunctionSystem)
    smooth = rough(unknowns, system.laws)
    squared = np.array(system.sigma) ** 2
    for k in range(max(tempered, 1)):
        fit = least(campaign, unknowns, u, rounds=rounds, share=share, smooth=smooth)
        squared = squares(campaign, fit)
        sigma = sigma_of(campaign, squared)
        u = fit.u
        if k == tempered - 1 or np.all(np.abs(np.log(np.array(sigma) / np.array(system.sigma))) < FOLLOWS):
            break
        system = replace(system, sigma=sigma)
        campaign = campaign.with_system(system)
    return weighed(campaign, fit, squared, smooth, unit)


def weighed(campaign: Campaign, fit: Fit, squared: Floats, smooth: Floats | None, unit: Floats) -> Trial:
    """A fit with its predicted error."""
    system = campaign.system
    assert isinstance(system, FunctionSystem)
    own = blocks(campaign, fit.residual, fit.slopes)
    errors, _ = predicted(own, fit.unknowns, fit.u, smooth)
    errors = errors * ((np.array(system.sigma) / unit) ** 2)[:, None]
    asked = float(np.sum(own.count[own.fold >= 0])) / len(unit)
    noise = asked * (NOISE * noise_in(campaign.observations) / unit) ** 2
    worth = independent(campaign, fit.residual)
    trial = Trial(campaign, fit, squared, errors, unit, worth, noise, np.zeros(len(unit)))
    return replace(trial, ahead=asked * spread_ahead(trial))


def covariance_of(trial: Trial) -> Floats:
    """Covariance of u, widened by misfit beyond sigma and by dependent samples."""
    fit = trial.fit
    w = weights(fit.residual)
    count = max(int(np.count_nonzero(fit.residual)), 1)
    left = float(np.sum(w * fit.residual**2)) / count
    spread = max(1.0, left) * max(1.0, count / trial.worth)
    prior = np.diag([1 / k.sd**2 for k in fit.unknowns])
    return np.asarray(np.linalg.pinv((fit.slopes * w[:, None]).T @ fit.slopes / spread + prior))


def spread_ahead(trial: Trial) -> Floats:
    """Variance of the prediction of recordings that are held out, from their inputs alone, in the trial's unit,
    (channels,): large where these go where the fitted ones leave a constant or a law undetermined."""
    campaign, system = trial.campaign, trial.system
    assert isinstance(campaign, Stacked)
    many = len(trial.unit)
    if not campaign.ahead or not len(trial.fit.u):
        return np.zeros(many)
    stack, given = stacked(system, campaign.ahead), system.encoding(trial.fit.unknowns)
    shown, starts, known = stack.profiled(system, given, given.at(trial.fit.u), fresh=True)
    every = replace(known, fitted=np.ones_like(known.fitted), seen=np.zeros_like(known.seen))
    columns = every.varied(system, given, trial.fit.u, shown, starts)
    if not np.isfinite(columns).all():
        return np.full(many, FAILED_SIGMAS**2)
    variance = np.einsum("mk,kj,mj->m", columns, covariance_of(trial), columns)
    channel = np.concatenate([np.append(np.repeat(np.arange(many), len(o.time_s)), -1) for o in campaign.ahead])
    scale = (np.array(system.sigma) / trial.unit) ** 2
    return np.array([scale[k] * np.sum(variance[channel == k]) for k in range(many)]) / len(known.t)
