"""Squared differences by blocks of samples: cross-validated errors without refitting.

Without some blocks, a fit that is linear near its end would end one Gauss-Newton step away; the misfit of these blocks
there is their prediction error (Stone 1974; for blocks of dependent data: Burman, Chow and Nolan 1994).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.systems.function.recording import HeldOut, Recorded

Floats = NDArray[np.float64]

#: Blocks of a campaign, at least and at most, and folds they are assigned to in turn.
FEWEST_BLOCKS, MOST_BLOCKS, FOLDS = 12, 60, 6
#: So many recordings are predicted from each other: of fewer, one alone may not determine the base's constants.
FEWEST_RECORDINGS = 3
#: Held-out samples count as lying after the fitted ones where this share of them does.
AFTER = 0.9


@dataclass(frozen=True, eq=False)
class Blocks:
    """Gram matrices of a campaign's blocks, channel by channel: r'r (c, b), J'r (c, b, k), J'J (c, b, k, k); samples of
    all channels (b,), and each block's fold.

    A fold is predicted from all other blocks, or, where ``onwards``, from all earlier ones.
    """

    squares: Floats
    g: Floats
    H: Floats
    count: Floats
    fold: NDArray[np.int64]  # -1: never predicted
    onwards: bool


def how_held(fitted: Sequence[Recorded], recordings: Sequence[Recorded]) -> HeldOut:
    """How held-out samples of all recordings lie beside the fitted ones of some."""
    whole = any(one.held.any() and not one.fitted.any() for one in recordings)
    if whole and len(fitted) >= FEWEST_RECORDINGS:
        return HeldOut("recordings", MOST_BLOCKS)
    held = after = stretches = 0
    for one in recordings:
        if one.fitted.any() and one.held.any():
            held += int(one.held.sum())
            after += int(np.sum(one.held & (one.time_s > one.time_s[one.fitted].max())))
            stretches += int(np.sum(np.diff(np.append(0, one.held.astype(int))) == 1))
    if held and after > AFTER * held:
        return HeldOut("after", MOST_BLOCKS)
    as_long = sum(int(one.fitted.sum()) for one in recordings) * stretches / held if held else 0
    return HeldOut("between", int(np.clip(as_long, FEWEST_BLOCKS, MOST_BLOCKS)))


def how_asked(campaign: Campaign) -> HeldOut:
    """How a campaign's recordings, from which held-out samples were taken away, must predict them."""
    runs: Sequence[Any] = campaign.observations
    asked: HeldOut = runs[0].asked
    return asked


def bounds(campaign: Campaign, *, fine: bool = False) -> list[tuple[NDArray[np.int64], int]]:
    """Rows (channels, samples) and fold of each block: recordings cut in time, all channels of an interval together.

    A law must predict held-out samples, so folds are arranged like held-out and fitted samples, in blocks as long as
    held-out stretches (in shorter ones lasting errors are predicted by their neighbours); ``fine`` ones are short.
    """
    fitted = [np.flatnonzero(one.fitted) for one in campaign.observations]  # type: ignore[attr-defined]
    total, how = sum(map(len, fitted)), how_asked(campaign)
    out, number, recording = [], 0, 0
    for one, rows, part in zip(campaign.observations, fitted, campaign.slices(), strict=True):
        if not len(rows):
            continue
        many = max(
            6 if how.lies == "after" else 1,
            min(len(rows), round((MOST_BLOCKS if fine else how.blocks) * len(rows) / total)),
        )
        channels, n = one.seen.shape
        for k, piece in enumerate(np.array_split(rows, many)):
            at = np.array([part.start + c * n + piece for c in range(channels)])
            thirds = 3 * k // many - 1
            out.append((at, {"recordings": recording % FOLDS, "after": thirds, "between": number % FOLDS}[how.lies]))
            number += 1
        recording += 1
    return out


def blocks(campaign: Campaign, residual: Floats, slopes: Floats, *, fine: bool = False) -> Blocks:
    """Of residuals (m,) and their Jacobian (m, k) at a fit."""
    cut = bounds(campaign, fine=fine)
    by_channel = list(zip(*(rows for rows, _ in cut), strict=True))
    squares = np.array([[float(residual[rows] @ residual[rows]) for rows in own] for own in by_channel])
    g = np.array([[slopes[rows].T @ residual[rows] for rows in own] for own in by_channel])
    H = np.array([[slopes[rows].T @ slopes[rows] for rows in own] for own in by_channel])
    fold, count = np.array([fold for _, fold in cut]), np.array([rows.size for rows, _ in cut])
    return Blocks(squares, g, H, count, fold, how_asked(campaign).lies == "after")


def predicted(
    of: Blocks, unknowns: Sequence[Unknown], u: Floats, smooth: Floats | None = None
) -> tuple[Floats, Floats]:
    """Squared error of each channel in each block, predicted without its fold's (c, b), and the step from u with all
    blocks (k,)."""
    sd = np.array([k.sd for k in unknowns])
    mean = np.array([k.mean for k in unknowns])
    prior, pull = np.diag(1 / sd**2), (u - mean) / sd**2
    if smooth is not None:
        prior, pull = prior + smooth.T @ smooth, pull + smooth.T @ (smooth @ u)
    H_of, g_of = of.H.sum(axis=0), of.g.sum(axis=0)
    H, g = H_of.sum(axis=0), g_of.sum(axis=0)
    out = np.zeros(of.squares.shape)
    for fold in range(int(of.fold.max()) + 1):
        here = of.fold == fold
        out_of = of.fold >= fold if of.onwards else here
        step = _solved(H - H_of[out_of].sum(axis=0) + prior, g - g_of[out_of].sum(axis=0) + pull)
        bent = np.einsum("i,cbij,j->cb", step, of.H[:, here], step)
        out[:, here] = of.squares[:, here] + 2 * of.g[:, here] @ step + bent
    return np.maximum(out, 0.0), _solved(H + prior, g + pull)


def _solved(H: Floats, g: Floats) -> Floats:
    """Minus the solution, where H may nearly be singular."""
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    return np.asarray(-np.linalg.lstsq(H / np.outer(scale, scale), g / scale, rcond=1e-10)[0] / scale)


def independent(campaign: Campaign, residual: Floats) -> float:
    """The effective number of independent residuals: n over the integrated autocorrelation (Sokal 1997)."""
    total = 0.0
    for rows, _ in bounds(campaign, fine=True):
        r = residual[rows].ravel()
        n = len(r)
        power = float(r @ r)
        if n < 4 or power == 0:
            total += n
            continue
        time, k = 1.0, 1
        while k < n // 2 and k < 4 * time:
            rho = float(r[:-k] @ r[k:]) / power
            if rho <= 0:
                break
            time += 2 * rho
            k += 1
        total += n / time
    return total
