"""Lamp: finds a light that blinks in a known rhythm somewhere in a video, and when it changed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from straw.tracking.errors import TrackingError
from straw.tracking.video import Frame

Floats = NDArray[np.float64]

BLOCK_PX = 24  # an LED is a few pixels wide, and its glow some more
LEAST_CORRELATION = 0.7  # with the rhythm; below it nothing is taken for the lamp; noise alone stays under 0.5
SLOW_S = 0.3  # slower changes belong to the scene, not the lamp
DRIFT = 1e-3  # camera clocks run apart by 50 parts in a million, bad ones by a few hundred


@dataclass(frozen=True)
class Blocks:
    """Mean luma of every square of ``BLOCK_PX`` in every frame (n, rows, columns), at frame times (n,) in s."""

    time_s: Floats
    luma: NDArray[np.uint8]


@dataclass(frozen=True)
class Blinks:
    """Where a lamp was seen, and when it changed (s on the video's clock), one time for each change requested.

    NaN where a change was not seen; ``sigma_s`` is a frame's own uncertainty; ``correlation`` is that with the rhythm.
    """

    row_px: int
    column_px: int
    time_s: Floats
    sigma_s: float
    correlation: float


def blocks_of(frames: Iterable[Frame]) -> Blocks:
    """Read a video down to its blocks: a minute of 1080p240 is 50 MB."""
    times, lumas = [], []
    for frame in frames:
        height, width = (side // BLOCK_PX for side in frame.luma.shape)
        whole = frame.luma[: height * BLOCK_PX, : width * BLOCK_PX]
        lumas.append(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA))
        times.append(frame.time_s)
    if len(times) < 10:
        raise TrackingError(f"a video of {len(times)} frames is too short to look for a blinking light in")
    return Blocks(np.array(times), np.array(lumas, dtype=np.uint8))


def find_blinks(blocks: Blocks, bursts: Sequence[Sequence[float]]) -> Blinks:
    """The lamp whose light follows ``bursts``: for each burst the times (s, host clock) of its changes, on first.

    The same block has to show every burst, at the right distance from each other give or take ``DRIFT``. Raises
    TrackingError when nothing in the picture does.
    """
    frame_s = float(np.median(np.diff(blocks.time_s)))
    grid_s = np.arange(blocks.time_s[0], blocks.time_s[-1] + frame_s / 2, frame_s)
    nearest = np.clip(np.searchsorted(blocks.time_s, grid_s - frame_s / 2), 0, len(blocks.time_s) - 1)
    n, rows, columns = blocks.luma.shape
    series = blocks.luma.reshape(n, rows * columns)[nearest]
    margin = round(SLOW_S / 2 / frame_s)
    starts = [burst[0] for burst in bursts]
    lively = np.flatnonzero(np.ptp(series, axis=0) >= 3)  # of 256 levels: a block that never changes is no lamp
    best, place, lag = 0.0, -1, -1
    for some in np.array_split(lively, max(len(lively) // 256, 1)):
        if len(some):
            score, at, k = _best(_quick(series[:, some], 2 * margin + 1), grid_s, bursts, starts, frame_s)
            if score > best:
                best, place, lag = score, int(some[at]), k
    if best < LEAST_CORRELATION:
        raise TrackingError(
            "no light in the picture follows the burst "
            f"(correlation {best:.2f} at most, {LEAST_CORRELATION} required); is the LED in view?"
        )
    light = _light(blocks, place // columns, place % columns)
    offset_s = grid_s[min(lag + margin, len(grid_s) - 1)] - starts[0]
    seen = [_changes(blocks.time_s, light, np.asarray(burst) + offset_s) for burst in bursts]
    middle = BLOCK_PX // 2
    return Blinks(
        row_px=place // columns * BLOCK_PX + middle,
        column_px=place % columns * BLOCK_PX + middle,
        time_s=np.concatenate(seen),
        sigma_s=frame_s / np.sqrt(12.0),
        correlation=best,
    )


def _best(
    series: Floats, grid_s: Floats, bursts: Sequence[Sequence[float]], starts: Sequence[float], frame_s: float
) -> tuple[float, int, int]:
    """Highest mean correlation over all bursts, the column it is in, and the frame at which the first burst starts."""
    total: Floats | None = None
    for burst, start_s in zip(bursts, starts, strict=True):
        correlation = _correlation(series, _template(burst, frame_s, round(SLOW_S / 2 / frame_s)))
        away = round((start_s - starts[0]) / frame_s)
        slack = 2 + int(DRIFT * abs(away))
        padded = np.full((len(grid_s), series.shape[1]), -1.0)
        padded[: len(correlation)] = correlation
        here = np.full_like(padded, -1.0)
        for shift in range(away - slack, away + slack + 1) if away else (0,):
            moved = padded[max(shift, 0) : len(grid_s) + min(shift, 0)]
            target = here[: len(moved)] if shift >= 0 else here[-len(moved) :]
            np.maximum(target, moved, out=target)
        total = here if total is None else total + here
    assert total is not None
    k, at = np.unravel_index(int(np.argmax(total)), total.shape)
    return float(total[k, at]) / len(bursts), int(at), int(k)


def _template(burst: Sequence[float], frame_s: float, margin: int) -> Floats:
    """The rhythm frame by frame, with a dark margin (frames) on both sides."""
    changes = np.asarray(burst) - burst[0]
    frames = int(changes[-1] / frame_s) + 2 * margin
    time_s = (np.arange(frames) - margin + 0.5) * frame_s
    return _quick((np.searchsorted(changes, time_s, side="right") % 2)[:, None], 2 * margin + 1)[:, 0]


def _quick(series: NDArray[Any], width: int) -> Floats:
    """Columns without changes slower than ``width`` frames."""
    from scipy.ndimage import uniform_filter1d

    values = np.asarray(series, dtype=np.float64)
    return np.asarray(values - uniform_filter1d(values, width, axis=0, mode="nearest"))


def _correlation(series: Floats, template: Floats) -> Floats:
    """Correlation coefficient of each column with the template at every lag, (lags, columns)."""
    from scipy.signal import fftconvolve

    length = len(template)
    if length > len(series):
        return np.full((1, series.shape[1]), -1.0)
    centred = template - template.mean()
    product = fftconvolve(series, centred[::-1, None], mode="valid", axes=0)
    sums = np.cumsum(np.vstack([np.zeros(series.shape[1]), series]), axis=0)
    squares = np.cumsum(np.vstack([np.zeros(series.shape[1]), series**2]), axis=0)
    mean = (sums[length:] - sums[:-length]) / length
    variance = (squares[length:] - squares[:-length]) / length - mean**2
    return np.asarray(product / (np.sqrt(np.maximum(variance, 0.05)) * length * np.std(template)))


def _light(blocks: Blocks, row: int, column: int) -> Floats:
    """Light of a block and its neighbours, for a lamp on an edge lies in several."""
    around = blocks.luma[:, max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
    return np.asarray(around.reshape(len(around), -1).sum(axis=1), dtype=np.float64)


def _changes(time_s: Floats, light: Floats, expected_s: Floats) -> Floats:
    """When the light crossed half-way near each expected time; a frame exposed during a change gives the fraction.

    Half-way is between the levels shortly before and shortly after, as the scene behind a lamp may grow darker too.
    """
    frame_s = float(np.median(np.diff(time_s)))
    reach_s = 0.45 * float(np.min(np.diff(expected_s)))
    found = np.full(len(expected_s), np.nan)
    for k, at_s in enumerate(expected_s):
        away_s = time_s - at_s
        before = (away_s >= -reach_s) & (away_s < -1.5 * frame_s)
        after = (away_s <= reach_s) & (away_s > 1.5 * frame_s)
        near = np.flatnonzero(np.abs(away_s) <= 2.5 * frame_s)
        if not (np.any(before) and np.any(after)):
            continue
        half = (np.median(light[before]) + np.median(light[after])) / 2
        sign = 1.0 if k % 2 == 0 else -1.0  # on first, then off
        for i in near[:-1]:
            a, b = sign * (light[i] - half), sign * (light[i + 1] - half)
            if a < 0 <= b:
                found[k] = time_s[i] + (time_s[i + 1] - time_s[i]) * a / (a - b)
                break
    return found
