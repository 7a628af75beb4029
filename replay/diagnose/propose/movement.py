"""Features of the tip's motion against a prediction: times, lags, snaps, ringing, and effects of a camera."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from straw.replay.diagnose.propose.seen import RATE_HZ

Floats = NDArray[np.float64]

#: One unit of X and Z (lengths of the straw), and of Phi; and a small amount of each.
UNIT, LITTLE = np.array([0.1, 0.1, 0.2]), np.array([1e-3, 1e-3, 3e-3])
#: Shares of the path at which times are taken; unit of lateness, s.
SHARES, LATE_S = (0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98), 5e-3
#: Longest lag searched, s; edges of the bands in which ringing is measured, Hz.
LAG_S, BANDS_HZ = 0.25, (0.5, 1.5, 3.0, 5.0, 8.0, 12.0, 18.0, 28.0)
#: Number of snaps used, their least distance and width, s.
SNAPS, APART_S, AROUND_S = 3, 0.12, 0.25


def squashed(x: Floats | float, unit: Floats | float) -> Floats:
    """Linear for small amounts, logarithmic for large ones."""
    return np.arcsinh(np.asarray(x) / unit)


def _way(x: Floats) -> Floats:
    """The tip's path length, (n,), without noise."""
    moves = np.diff(gaussian_filter1d(x, 1.0, axis=1), axis=1) / UNIT[:, None]
    speed = np.sqrt(np.sum(moves**2, axis=0))
    come = np.cumsum(np.clip(speed - 2 * np.median(speed) - 2e-3, 0, None))
    return np.asarray(np.concatenate([[0.0], come]) + 1e-9 * np.arange(x.shape[1]))


def times(tip: Floats, told: Floats) -> Floats:
    """Times of shares of the path, their lateness against the prediction, and the largest speed."""
    out = []
    ways = [_way(tip), _way(told)]
    at = [np.interp(np.array(SHARES) * way[-1], way, np.arange(len(way)) / RATE_HZ) for way in ways]
    out.append(squashed(at[0] - at[1], LATE_S))
    out.append(at[0])
    # the same share of the prediction's whole path, for runs in which only some of the snaps happen
    same = np.interp(np.array(SHARES) * ways[1][-1], ways[0], np.arange(len(ways[0])) / RATE_HZ)
    out.append(squashed(same - at[1], LATE_S))
    totals = np.array([way[-1] for way in ways])
    fastest = [np.abs(np.diff(gaussian_filter1d(x, 1.0, axis=1), axis=1)).max(axis=1) / UNIT for x in (tip, told)]
    out.append(np.log(totals + 1e-2))
    out.append(np.log((totals[:1] + 1e-2) / (totals[1:] + 1e-2)))
    out.append(np.log(fastest[0] + 1e-2))
    out.append(np.log((fastest[0] + 1e-2) / (fastest[1] + 1e-2)))
    return np.concatenate(out)


def lags(tip: Floats, told: Floats) -> Floats:
    """The shift in time that aligns the prediction with the tip: in all, and in both halves of the path; and the
    remaining residual."""
    speeds = [np.diff(gaussian_filter1d(x, 1.0, axis=1), axis=1) / UNIT[:, None] for x in (tip, told)]
    n, most = speeds[0].shape[1], int(LAG_S * RATE_HZ)
    middle = int(np.searchsorted(np.cumsum(np.abs(speeds[1]).sum(axis=0)), 0.5 * np.abs(speeds[1]).sum()))
    out, late = [], []
    for part in (slice(0, n), slice(0, middle + most), slice(max(middle - most, 0), n)):
        a, b = speeds[0][:, part], speeds[1][:, part]
        size = 1 << int(2 * a.shape[1] - 1).bit_length()
        both = np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size).sum(axis=0)
        shifts = np.concatenate([both[-most:], both[: most + 1]])
        power = float(np.sqrt(np.sum(a**2) * np.sum(b**2))) + 1e-6
        k = int(np.clip(shifts.argmax(), 1, 2 * most - 1))
        left, mid, right = shifts[k - 1 : k + 2]
        curve = left - 2 * mid + right
        best = k - most + (0.5 * (left - right) / curve if curve < 0 else 0.0)
        late.append(best)
        out += [float(squashed(best / RATE_HZ, LATE_S)), mid / power, shifts[most] / power]
    at = np.arange(tip.shape[1])
    shifted = np.stack([np.interp(at - late[0], at, x) for x in told])
    left = np.sqrt(np.mean((tip - shifted) ** 2, axis=1))
    before = np.sqrt(np.mean((tip - told) ** 2, axis=1))
    return np.concatenate([out, squashed(left, LITTLE / 3), np.log((left + LITTLE / 9) / (before + LITTLE / 9))])


def camera(tip: Floats, told: Floats) -> Floats:
    """Robust regression of the residual on the effects of a rolled, scaled, displaced or late camera."""
    off, (x, z, phi) = tip - told, told
    speed = np.gradient(told, axis=1) * RATE_HZ
    when = np.linspace(0, 1, tip.shape[1])
    zero, one = np.zeros_like(x), np.ones_like(x)
    turned, displaced = np.stack([z, -x, one]), np.stack([np.sin(phi), np.cos(phi), zero])
    causes = [np.stack([x, z, zero]), turned, displaced, -speed, -speed * when]
    columns = np.stack([(shown / LITTLE[:, None]).ravel() for shown in causes], axis=1)
    y = (off / LITTLE[:, None]).ravel()
    found, weight = np.zeros(len(causes)), np.ones_like(y)
    for _ in range(6):
        normal = columns.T @ (columns * weight[:, None]) + np.diag([1e2, 1e2, 1e2, 1e4, 1e4])
        found = np.linalg.solve(normal, columns.T @ (weight * y))
        left = np.abs(y - columns @ found)
        weight = 1 / np.maximum(left / (np.median(left) + 1e-3), 1.0)
    before, after = np.median(np.abs(y)), np.median(np.abs(y - columns @ found))
    units = np.array([1e-3, 1e-3, 2e-3, LATE_S, LATE_S])
    return np.concatenate(
        [squashed(found, units), squashed(np.array([before, after]), 0.1), [np.log((after + 1e-2) / (before + 1e-2))]]
    )


def ringing(tip: Floats, told: Floats) -> Floats:
    """Motion of the tip, the prediction and their difference in each band of frequencies."""
    hertz = np.fft.rfftfreq(tip.shape[1] - 1, 1 / RATE_HZ)
    out = []
    for x in (tip, told, tip - told):
        speed = np.diff(x, axis=1) / UNIT[:, None] * np.hanning(x.shape[1] - 1)
        power = np.abs(np.fft.rfft(speed, axis=1)) ** 2 / tip.shape[1]
        for low, high in itertools.pairwise(BANDS_HZ):
            out.append(np.log(power[:, (hertz >= low) & (hertz < high)].mean(axis=1) + 1e-6) / 3)
    return np.concatenate(out)


def snaps(tip: Floats, told: Floats) -> Floats:
    """The prediction's strongest snaps: time, speed, width; and lateness, speed and width of the tip's own."""
    speeds = [np.sqrt(np.sum((np.diff(gaussian_filter1d(x, 1.0, axis=1), axis=1) / UNIT[:, None]) ** 2, axis=0))
              for x in (tip, told)]  # fmt: skip
    found, left = [], [speed.copy() for speed in speeds]
    peaks: list[list[tuple[int, float, float]]] = [[], []]
    for which, speed in enumerate(left):
        for _ in range(SNAPS):
            at = int(speed.argmax())
            near = slice(max(at - round(AROUND_S * RATE_HZ), 0), at + round(AROUND_S * RATE_HZ))
            way = float(speeds[which][near].sum())
            peaks[which].append((at, float(speeds[which][at]), way))
            apart = round(APART_S * RATE_HZ)
            speed[max(at - apart, 0) : at + apart] = 0.0
    for at, fast, way in peaks[1]:
        mine = min(peaks[0], key=lambda one: abs(one[0] - at))
        late = (mine[0] - at) / RATE_HZ
        found += [at / RATE_HZ / 4, np.log(fast + 1e-3), np.log(way / (fast + 1e-3) + 1e-2)]
        found += [float(squashed(late, LATE_S)), np.log((mine[1] + 1e-3) / (fast + 1e-3))]
        found += [np.log((mine[2] + 1e-2) / (way + 1e-2))]
    ordered = [sorted(one[0] for one in some) for some in peaks]
    found += [float(squashed((a - b) / RATE_HZ, LATE_S)) for a, b in zip(*ordered, strict=True)]
    # the share of the strongest shows whether cells snap one by one or together
    found += [np.log((some[1][1] + 1e-3) / (some[0][1] + 1e-3)) for some in peaks]
    return np.array(found, dtype=np.float64)
