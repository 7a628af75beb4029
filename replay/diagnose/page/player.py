"""Recordings for the replay page's player, with base and improved model."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.formed import Model
from straw.replay.diagnose.page.moment import parting
from straw.replay.diagnose.recording import Recording
from straw.replay.report.data import packed

Floats = NDArray[np.float64]

#: Number of recordings played: those held out first, then those in which the models differ most.
PLAYED = 3
#: Largest number of samples; longer recordings are thinned evenly.
MOST = 12000


def played(
    recordings: Sequence[Recording], before: Model, after: Model | None, heldout: Collection[str]
) -> list[dict[str, Any]]:
    """The player's data of a few recordings; without an improved model it is the base that is played."""
    rows = []
    for one in recordings:
        base = before.shows(one)
        better = after.shows(one) if after else None
        apart = (base - (one.seen if better is None else better)) / one.sigma()
        rows.append((one.name not in heldout, -float(np.nansum(apart**2)), one, base, better))
    rows.sort(key=lambda row: row[:2])
    return [_data(one, before, after, base, better) for *_, one, base, better in rows[:PLAYED]]


def _data(one: Recording, before: Model, after: Model | None, base: Floats, better: Floats | None) -> dict[str, Any]:
    channels = before.campaign.system.channels
    moment, window = parting(one.time_s, base, one.seen if better is None else better)
    signals = {}
    every = slice(None, None, -(-len(one.time_s) // MOST))
    for k, channel in enumerate(channels):
        scale = channel.shown_per_si
        signals[channel.name] = {
            "title": channel.symbol,
            "unit": channel.shown_unit,
            "factor": scale,
            "measured": packed(one.seen[k, every] * scale),
            "sigma": packed(one.sigma()[k, every] * scale),
            "predicted": packed((base if better is None else better)[k, every] * scale),
            "before": None if better is None else packed(base[k, every] * scale),
            "known": True,
            "metrics": None,
        }
    data: dict[str, Any] = {
        "id": one.name,
        "role": "",
        "who": "base model" if after is None else "improved model",
        "brief": True,
        "at": moment,
        "window": window,
        "events": [],
        "snaps": [[float(t), "measured"] for t in one.events_s[::2]],
        "snapping": [],
        "lost": [],
        "toml": "",
        "time": packed(one.time_s[every]),
        "signals": signals,
    }
    shown = _beside(one, after or before)
    if after and shown.get("shape"):
        data["shapeBefore"] = _beside(one, before)["shape"]
    return data | shown


def _beside(one: Recording, model: Model) -> dict[str, Any]:
    return model.campaign.system.shown().played(one, *model.parameters())
