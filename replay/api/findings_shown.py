"""Findings as columns and as a picture: the posterior, and the held-out RMS before and after."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from straw.replay.api.shown import Rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def constants_table(parameters: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Rows:
    """Constants by cause, one a row; sigma is NaN where unknown."""
    rows = [(cause, name, one) for cause, constants in parameters.items() for name, one in constants.items()]
    return {
        "cause": np.array([cause for cause, _, _ in rows], dtype=str),
        "constant": np.array([name for _, name, _ in rows], dtype=str),
        "value": np.array([one["value"] for _, _, one in rows], dtype=np.float64),
        "sigma": np.array([one.get("sigma", np.nan) for _, _, one in rows], dtype=np.float64),
        "unit": np.array([one["unit"] for _, _, one in rows], dtype=str),
    }


def heldout_table(before: Mapping[str, float], after: Mapping[str, float], floor: Mapping[str, float]) -> Rows:
    """Held-out RMS by channel, in the channel's own unit."""
    return {
        "channel": np.array(list(before), dtype=str),
        "rms_before": np.array(list(before.values()), dtype=np.float64),
        "rms_after": np.array([after[name] for name in before], dtype=np.float64),
        "noise_floor": np.array([floor[name] for name in before], dtype=np.float64),
    }


def located_table(located: Iterable[Mapping[str, Any]]) -> Rows:
    """Stretches of recordings in which the base is off most, the largest share of the misfit first."""
    every = list(located)
    words = {name: np.array([one[name] for one in every], dtype=str) for name in ("run", "channel", "phase")}
    numbers = ("from_s", "to_s", "share_of_misfit")
    return words | {name: np.array([one[name] for one in every], dtype=np.float64) for name in numbers}


def verdict_figure(
    probability: Mapping[str, float], heldout: Rows, shown: Mapping[str, tuple[str, float, str]]
) -> Figure:
    """Probabilities as bars; beside them RMS held out, before and after, as multiples of the noise.

    ``shown``: by channel its short name, factor and display unit.
    """
    from matplotlib.figure import Figure  # slow to import

    channels = [str(name) for name in heldout["channel"]]
    figure = Figure(figsize=(7.0, 0.32 * len(probability) + 1.4), layout="constrained")
    every = figure.subplots(1, 2 if channels else 1, squeeze=False)[0]
    names = [name.replace("_", " ") for name in probability]
    every[0].barh(range(len(names)), list(probability.values()), color="#0072b2")
    every[0].set_yticks(range(len(names)), names)
    every[0].invert_yaxis()
    every[0].set_xlim(0, 1)
    every[0].set_xlabel("probability")
    if channels:
        noise, at = heldout["noise_floor"], np.arange(len(channels))
        for shift, column, label, colour in ((-0.2, "rms_before", "base", "#d55e00"), (0.2, "rms_after", "improved",
                                                                                      "#0072b2")):  # fmt: skip
            every[1].bar(at + shift, heldout[column] / noise, 0.36, label=label, color=colour)
        every[1].axhline(1.0, color="k", lw=0.8, ls=":")
        ticks = []
        for name, floor in zip(channels, noise, strict=True):
            short, factor, unit = shown[name]
            ticks.append(f"{short}\n({floor * factor:.2g} {unit})")
        every[1].set_xticks(at, ticks)
        every[1].set_yscale("log")
        every[1].set_ylabel("RMS held out / noise")
        every[1].legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return figure
