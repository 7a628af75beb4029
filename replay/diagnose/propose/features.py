"""What a run looks like in numbers: levels, times, lags, snaps, ringing, creep, its course, the gauge at vent."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from replay.diagnose.propose.seen import RATE_HZ, Seen

Floats = NDArray[np.float64]

#: One unit of X and Z (lengths of the straw), and of Phi, in what a kernel sees; and of what is little of each.
UNIT, LITTLE = np.array([0.1, 0.1, 0.2]), np.array([1e-3, 1e-3, 3e-3])
PRESSURE_PA = 2e4
#: Shares of the way at which times are taken; what is late by this counts as one, s.
SHARES, LATE_S = (0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98), 5e-3
#: Longest lag looked for, s; edges of the bands in which ringing is measured, Hz.
LAG_S, BANDS_HZ = 0.25, (0.5, 1.5, 3.0, 5.0, 8.0, 12.0, 18.0, 28.0)
#: Windows in which the course of what is off is told, and snaps that are looked at, so far apart and so wide, s.
WINDOWS, SNAPS, APART_S, AROUND_S = 10, 3, 0.12, 0.25
#: Errors of a gauge that count as one, Pa.
READING_PA = 50.0


def features(runs: Sequence[Seen]) -> Floats:
    """Numbers of each run, (runs, features); all finite."""
    out = np.stack([_of_run(run) for run in runs])
    return np.nan_to_num(np.clip(out, -30, 30), nan=0.0)


def _of_run(seen: Seen) -> Floats:
    length_m = float(np.sum(seen.straw.zeta0_m[:, 0] - seen.straw.zeta0_m[:, 1]))
    scale = np.array([length_m, length_m, 1.0])[:, None]
    tip, told = seen.tip / scale, seen.predicted / scale
    parts = [
        _setting(seen),
        _gauge(seen),
        _levels(tip, told, seen),
        _times(tip, told, seen),
        _lags(tip, told),
        _camera(tip, told),
        _ringing(tip, told),
        _creep(tip, told, seen),
        _course(tip, told, seen),
        _snaps(tip, told),
    ]
    return np.concatenate(parts)


def _squashed(x: Floats | float, unit: Floats | float) -> Floats:
    """Linear for what is little, logarithmic for what is much."""
    return np.arcsinh(np.asarray(x) / unit)


def _setting(seen: Seen) -> Floats:
    """The nominal straw, the configuration it starts from, and what is done to it."""
    s = seen.straw
    cells = np.zeros(12)
    where = (np.array(seen.deployed, dtype=np.float64) - 0.5) / s.cells
    cells[np.unique(np.clip(where * 9, 0, 8).astype(np.int64))] = 1.0
    cells[9:] = len(where) / s.cells, where.mean() if len(where) else 0.0, len(where) == 0
    p = seen.pressure_pa / PRESSURE_PA
    given = [
        np.log(s.r_ch_m / 0.4e-3), np.log(s.c_zeta_n_s_per_m.mean() / 20.0),
        np.log(s.c_phi_n_m_s_per_rad.mean() / 2e-3),
        np.log(s.E_pa.mean() / 0.92e9), np.log(s.h_m.mean() / 0.508e-3),
        np.log(s.zeta0_m[:, 0].mean() / 3.78e-3), np.log(-s.zeta0_m[:, 1].mean() / 2.28e-3),
        s.cells / 9.0, float(s.form == "full"),
        np.log1p(seen.cycle), len(p) / RATE_HZ / 4.0, p.max(), p.min(), p[-1], p.mean(),
        _squashed(np.abs(np.diff(p)).max(), 0.1), np.abs(np.diff(p)).sum(),
    ]  # fmt: skip
    return np.array([*given, *cells], dtype=np.float64)


def _gauge(seen: Seen) -> Floats:
    """What the gauge reads at vent, and beside the command on plateaus: offset and gain."""
    if seen.command is None:
        return np.zeros(6)
    at_s, told_pa = seen.command
    first_s = at_s[1] if len(at_s) > 1 else np.inf
    time_s = (np.arange(len(seen.pressure_pa)) + 0.5) / RATE_HZ
    vented = (time_s < first_s) & (told_pa[0] == 0)
    read, said = [], []
    for (start_s, end_s), command in zip(_spans(at_s, time_s[-1]), told_pa, strict=True):
        settled = (time_s > end_s - 0.3 * (end_s - start_s)) & (time_s < end_s - 1 / RATE_HZ)
        if end_s - start_s > 0.25 and settled.any():
            read.append(float(seen.pressure_pa[settled].mean()))
            said.append(float(command))
    at_vent = float(seen.pressure_pa[vented].mean()) if vented.any() else 0.0
    if not read:
        return np.array([1.0, float(vented.any()), _squashed(at_vent, READING_PA), 0.0, 0.0, 0.0])
    wrong, x = np.array(read) - np.array(said), np.array(said) / PRESSURE_PA
    gain = float(np.sum((wrong - wrong.mean()) * (x - x.mean())) / (np.sum((x - x.mean()) ** 2) + 1e-2))
    return np.array([1.0, float(vented.any()), *_squashed(np.array([at_vent, wrong[0], wrong[-1], gain]), READING_PA)])


def _spans(at_s: Floats, end_s: float) -> list[tuple[float, float]]:
    edges = [*np.clip(at_s, 0.0, end_s), end_s]
    return list(itertools.pairwise(edges))


def _levels(tip: Floats, told: Floats, seen: Seen) -> Floats:
    """Where the tip is before anything happens and at the end, and how far the prediction is off in between."""
    off = tip - told
    first = max(int(0.12 * RATE_HZ), 2)
    last = slice(-max(int(0.25 * RATE_HZ), 2), None)
    little = LITTLE / 3
    return np.concatenate(
        [
            _squashed(off[:, :first].mean(axis=1), little),
            _squashed(off[:, last].mean(axis=1), little),
            tip[:, last].mean(axis=1) / UNIT - tip[:, :first].mean(axis=1) / UNIT,
            told[:, last].mean(axis=1) / UNIT - told[:, :first].mean(axis=1) / UNIT,
            tip[:, :first].mean(axis=1) / UNIT,
            _squashed(np.sqrt(np.mean(off**2, axis=1)), little),
            _squashed(np.median(off, axis=1), little),
            _squashed(off.max(axis=1), little),
            _squashed(off.min(axis=1), little),
            off.argmax(axis=1) / off.shape[1],
            off.argmin(axis=1) / off.shape[1],
        ]
    )


def _way(x: Floats) -> Floats:
    """How far the tip has come, (n,), without what is noise."""
    moves = np.diff(gaussian_filter1d(x, 1.0, axis=1), axis=1) / UNIT[:, None]
    speed = np.sqrt(np.sum(moves**2, axis=0))
    come = np.cumsum(np.clip(speed - 2 * np.median(speed) - 2e-3, 0, None))
    return np.asarray(np.concatenate([[0.0], come]) + 1e-9 * np.arange(x.shape[1]))


def _times(tip: Floats, told: Floats, seen: Seen) -> Floats:
    """When shares of the way are done, how much later than predicted, and how fast the tip is at most."""
    out = []
    ways = [_way(tip), _way(told)]
    at = [np.interp(np.array(SHARES) * way[-1], way, np.arange(len(way)) / RATE_HZ) for way in ways]
    out.append(_squashed(at[0] - at[1], LATE_S))
    out.append(at[0])
    # the same share of what the prediction does in all: where only some of the snaps happen
    same = np.interp(np.array(SHARES) * ways[1][-1], ways[0], np.arange(len(ways[0])) / RATE_HZ)
    out.append(_squashed(same - at[1], LATE_S))
    totals = np.array([way[-1] for way in ways])
    fastest = [np.abs(np.diff(gaussian_filter1d(x, 1.0, axis=1), axis=1)).max(axis=1) / UNIT for x in (tip, told)]
    out.append(np.log(totals + 1e-2))
    out.append(np.log((totals[:1] + 1e-2) / (totals[1:] + 1e-2)))
    out.append(np.log(fastest[0] + 1e-2))
    out.append(np.log((fastest[0] + 1e-2) / (fastest[1] + 1e-2)))
    return np.concatenate(out)


def _lags(tip: Floats, told: Floats) -> Floats:
    """By how much the prediction has to be shifted to move with the tip: in all, and in both halves of the way; and
    what then is still off."""
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
        out += [float(_squashed(best / RATE_HZ, LATE_S)), mid / power, shifts[most] / power]
    at = np.arange(tip.shape[1])
    shifted = np.stack([np.interp(at - late[0], at, x) for x in told])
    left = np.sqrt(np.mean((tip - shifted) ** 2, axis=1))
    before = np.sqrt(np.mean((tip - told) ** 2, axis=1))
    return np.concatenate([out, _squashed(left, LITTLE / 3), np.log((left + LITTLE / 9) / (before + LITTLE / 9))])


def _camera(tip: Floats, told: Floats) -> Floats:
    """Robust regression of what is off on what a camera that is turned, stretched, displaced or late would show."""
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
        [_squashed(found, units), _squashed(np.array([before, after]), 0.1), [np.log((after + 1e-2) / (before + 1e-2))]]
    )


def _ringing(tip: Floats, told: Floats) -> Floats:
    """How much the tip moves in each band of frequencies, and how much the prediction and their difference do."""
    hertz = np.fft.rfftfreq(tip.shape[1] - 1, 1 / RATE_HZ)
    out = []
    for x in (tip, told, tip - told):
        speed = np.diff(x, axis=1) / UNIT[:, None] * np.hanning(x.shape[1] - 1)
        power = np.abs(np.fft.rfft(speed, axis=1)) ** 2 / tip.shape[1]
        for low, high in itertools.pairwise(BANDS_HZ):
            out.append(np.log(power[:, (hertz >= low) & (hertz < high)].mean(axis=1) + 1e-6) / 3)
    return np.concatenate(out)


def _creep(tip: Floats, told: Floats, seen: Seen) -> Floats:
    """How fast the tip still moves towards the end of each plateau of the pressure; the first, the last, the most."""
    change = np.abs(np.diff(seen.pressure_pa)) > 0.02 * np.ptp(seen.pressure_pa) + 1.0
    edges = np.concatenate([[0], np.flatnonzero(change) + 1, [tip.shape[1]]])
    drifts = []
    for a, b in itertools.pairwise(edges):
        if b - a >= 0.35 * RATE_HZ:
            part = slice(a + 2 * (b - a) // 3, b)
            t = np.arange(part.stop - part.start) / RATE_HZ
            t = t - t.mean()
            drifts.append(np.stack([(x[:, part] @ t) / (t @ t) for x in (tip, told)]))
    if not drifts:
        return np.zeros(18)
    d = _squashed(np.stack(drifts), LITTLE * 3)  # (plateaus, 2, 3)
    off = d[:, 0] - d[:, 1]
    return np.concatenate(
        [d[-1, 0], off[-1], off[0], off[np.abs(off).argmax(axis=0), range(3)], off.mean(axis=0), d[:, 0].mean(axis=0)]
    )


def _course(tip: Floats, told: Floats, seen: Seen) -> Floats:
    """What is off, and how much more or less the tip moves than predicted, from the first change of pressure on."""
    change = np.flatnonzero(np.abs(np.diff(seen.pressure_pa)) > 0.02 * np.ptp(seen.pressure_pa) + 1.0)
    first = int(change[0]) if len(change) else 0
    edges = np.linspace(min(first, tip.shape[1] - 2 * WINDOWS), tip.shape[1], WINDOWS + 1).astype(np.int64)
    out = []
    moves = [np.abs(np.diff(gaussian_filter1d(x, 1.0, axis=1), axis=1, append=x[:, -1:])) for x in (tip, told)]
    for a, b in itertools.pairwise(edges):
        out.append(_squashed((tip - told)[:, a:b].mean(axis=1), LITTLE))
        each = [m[:, a:b].mean(axis=1) * RATE_HZ / UNIT + 5e-2 for m in moves]
        out.append(np.log(each[0] / each[1]))
    return np.concatenate(out)


def _snaps(tip: Floats, told: Floats) -> Floats:
    """The prediction's strongest snaps: when, how fast, how wide; and how late, fast and wide the tip's own are."""
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
        found += [float(_squashed(late, LATE_S)), np.log((mine[1] + 1e-3) / (fast + 1e-3))]
        found += [np.log((mine[2] + 1e-2) / (way + 1e-2))]
    ordered = [sorted(one[0] for one in some) for some in peaks]
    found += [float(_squashed((a - b) / RATE_HZ, LATE_S)) for a, b in zip(*ordered, strict=True)]
    # the share of the strongest in all says whether cells snap one by one or together
    found += [np.log((some[1][1] + 1e-3) / (some[0][1] + 1e-3)) for some in peaks]
    return np.array(found, dtype=np.float64)
