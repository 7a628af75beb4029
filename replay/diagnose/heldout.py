"""Held-out runs: base, each cause as it is added, and the improved model, evaluated where none was fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, fitted
from straw.replay.diagnose.formed import Model
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.locate import Located
from straw.replay.diagnose.settings import ROUNDS, WORSE

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Held:
    """RMS by channel (SI) on runs that were not fitted: base model, improved model, and the recordings' noise.

    ``steps``: RMS of the base with the first cause, with the first two, ...; ``moves``: range of each channel there.
    ``lines``: predictions of base and improved model (SI, (channels, n) each) by held-out run.
    """

    train: tuple[str, ...]
    heldout: tuple[str, ...]
    chi2_before: float
    chi2_after: float
    before: dict[str, float]
    after: dict[str, float]
    floor: dict[str, float]
    moves: dict[str, float]
    steps: tuple[tuple[str, dict[str, float]], ...] = ()
    lines: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)

    @property
    def worse(self) -> list[str]:
        """Channels in which the improved model is further off than the base, by more than chance."""
        return self.worse_than(self.before)

    @property
    def better(self) -> bool:
        """Whether the improved model is nearer in at least one channel, by more than chance, and worse in none."""
        gains = [WORSE * self.after[name] < before for name, before in self.before.items()]
        return any(gains) and not self.worse

    def worse_than(self, rms: dict[str, float]) -> list[str]:
        """Channels in which it is further off than another model, of this RMS on the same runs, by more than chance."""
        return [
            name
            for name, after in self.after.items()
            if not after <= WORSE * max(rms[name], self.floor[name])  # also where it cannot be simulated
        ]

    def of_base(self) -> Held:
        """The same where nothing improves on the base."""
        lines = {name: (before, before) for name, (before, _) in self.lines.items()}
        return replace(self, chi2_after=self.chi2_before, after=self.before, steps=(), lines=lines)

    @property
    def remainder(self) -> dict[str, float]:
        """RMS above noise that the improved model leaves, by channel."""
        return self.above_noise(self.after)

    def above_noise(self, rms: dict[str, float]) -> dict[str, float]:
        """RMS above noise by channel, from the total RMS."""
        return {name: float(np.sqrt(self._above(name, value))) for name, value in rms.items()}

    def explained(self) -> list[dict[str, Any]]:
        """For each cause in order of being added: the share of the mean squared misfit above noise that it explains."""
        out, known = [], self.before
        for cause, rms in self.steps:
            share = {}
            for name, before in self.before.items():
                whole = self._above(name, before)
                gain = self._above(name, known[name]) - self._above(name, rms[name])
                share[name.split("_")[0]] = gain / whole if whole > 0 else 0.0
            out.append({"cause": cause, "share": share})
            known = rms
        return out

    def _above(self, name: str, rms: float) -> float:
        return max(0.0, rms**2 - self.floor[name] ** 2) if np.isfinite(rms) else float("inf")


def hold_out(
    campaign: Campaign, null: Fit, steps: Sequence[tuple[str, Model]], located: Sequence[Located]
) -> Held | None:
    """Base and improved models refitted without some runs, and their errors on those.

    ``steps``: models with the first cause, with the first two, ..., and the cause's name; the last is the improved
    model, without any it is the base. Held out are runs with misfit, of different kinds, at most a quarter of all; None
    with fewer than three runs.
    """
    names = [o.name for o in campaign.observations]
    if len(names) < 3:
        return None
    out = _chosen(campaign, located)
    train, rest = [n for n in names if n not in out], campaign.only(out)
    base = fitted(campaign.only(train), null.unknowns, null.u, rounds=ROUNDS)
    before = plain_rms(rest, null.unknowns, base.u)
    last, known, after = base, Model(rest, base), before
    shares = []
    for cause, model in steps:
        fit = model.fit
        last = fitted(model.campaign.only(train), fit.unknowns, fit.u, rounds=ROUNDS, smooth=model.smooth)
        known = Model(model.campaign.only(out), last)
        after = plain_rms(known.campaign, last.unknowns, last.u)
        shares.append((cause, after))
    return Held(
        tuple(train),
        tuple(out),
        float(np.mean(base.residual**2)),
        float(np.mean(last.residual**2)),
        before,
        after,
        noise_floor(rest),
        moves(rest),
        tuple(shares),
        {o.name: (Model(rest, base).shows(o), known.shows(o)) for o in rest.observations},
    )


def helpful(null: Fit, laws: Sequence[Any], located: Sequence[Located]) -> tuple[Any, Held] | None:
    """The law that makes held-out runs better than the base, and its errors there; None where none does.

    ``laws``: a system's ``missing``, those with more parts first; a part that makes those runs worse is left out.
    """
    found: tuple[Any, Held] | None = None
    for law in laws:
        if not law.tells:
            continue
        held = hold_out(law.curve.campaign, null, [(law.noun, law.model)], located)
        if held and held.better and (found is None or found[1].worse_than(held.after)):
            found = law, held
    return found


def _chosen(campaign: Campaign, located: Sequence[Located]) -> list[str]:
    """Names of the runs to hold out; not those with constants of their own, which no other run tells."""
    names = [o.name for o in campaign.observations if o.name not in campaign.own]
    blamed = [run for run in dict.fromkeys(one.run for one in located) if run in names] + list(reversed(names))
    configurations: list[Any] = []
    out: list[str] = []
    for name in blamed:
        configuration = next(o.kind for o in campaign.observations if o.name == name)
        if name not in out and configuration not in configurations and len(out) < max(1, len(names) // 4):
            out.append(name)
            configurations.append(configuration)
    return out


def _channels(campaign: Campaign) -> list[tuple[int, Any]]:
    return list(enumerate(campaign.system.channels))


def moves(campaign: Campaign) -> dict[str, float]:
    """The largest range of each channel in a run, SI."""
    return {c.name: max(float(np.ptp(o.seen[i])) for o in campaign.observations) for i, c in _channels(campaign)}


def noise_floor(campaign: Campaign) -> dict[str, float]:
    """The recordings' noise, RMS by channel, SI."""
    return {
        c.name: float(np.sqrt(np.mean(np.concatenate([o.floor()[i] ** 2 for o in campaign.observations]))))
        for i, c in _channels(campaign)
    }


def plain_rms(campaign: Campaign, unknowns: Sequence[Unknown], u: Floats) -> dict[str, float]:
    """Simulated less recorded, RMS by channel, SI; NaN where nothing can be simulated."""
    rows = [one for one in campaign.misfits(unknowns, [u])[0] if one is not None]
    return {
        c.name: float(np.sqrt(np.mean(np.concatenate([one.plain[i] for one in rows]) ** 2))) if rows else float("nan")
        for i, c in _channels(campaign)
    }
