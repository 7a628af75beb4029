"""Features of a run: its inputs, the gauge at vent, levels, creep, its course, its movement."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from straw.replay.diagnose.propose.movement import LITTLE, UNIT, camera, lags, ringing, snaps, squashed, times
from straw.replay.diagnose.propose.seen import RATE_HZ, Seen

Floats = NDArray[np.float64]

#: Unit of a pressure, Pa: straws snap at some 10 to 30 kPa.
PRESSURE_PA = 2e4
#: Windows of the residual's course.
WINDOWS = 10
#: Unit of a gauge's error, Pa.
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
        times(tip, told),
        lags(tip, told),
        camera(tip, told),
        ringing(tip, told),
        _creep(tip, told, seen),
        _course(tip, told, seen),
        snaps(tip, told),
    ]
    return np.concatenate(parts)


def _setting(seen: Seen) -> Floats:
    """The nominal straw, its start configuration, and its inputs."""
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
        squashed(np.abs(np.diff(p)).max(), 0.1), np.abs(np.diff(p)).sum(),
    ]  # fmt: skip
    return np.array([*given, *cells], dtype=np.float64)


def _gauge(seen: Seen) -> Floats:
    """The gauge's reading at vent, and against the command on plateaus: offset and gain."""
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
        return np.array([1.0, float(vented.any()), squashed(at_vent, READING_PA), 0.0, 0.0, 0.0])
    wrong, x = np.array(read) - np.array(said), np.array(said) / PRESSURE_PA
    gain = float(np.sum((wrong - wrong.mean()) * (x - x.mean())) / (np.sum((x - x.mean()) ** 2) + 1e-2))
    return np.array([1.0, float(vented.any()), *squashed(np.array([at_vent, wrong[0], wrong[-1], gain]), READING_PA)])


def _spans(at_s: Floats, end_s: float) -> list[tuple[float, float]]:
    edges = [*np.clip(at_s, 0.0, end_s), end_s]
    return list(itertools.pairwise(edges))


def _levels(tip: Floats, told: Floats, seen: Seen) -> Floats:
    """The tip before the first change and at the end, and the prediction's error in between."""
    off = tip - told
    first = max(int(0.12 * RATE_HZ), 2)
    last = slice(-max(int(0.25 * RATE_HZ), 2), None)
    little = LITTLE / 3
    return np.concatenate(
        [
            squashed(off[:, :first].mean(axis=1), little),
            squashed(off[:, last].mean(axis=1), little),
            tip[:, last].mean(axis=1) / UNIT - tip[:, :first].mean(axis=1) / UNIT,
            told[:, last].mean(axis=1) / UNIT - told[:, :first].mean(axis=1) / UNIT,
            tip[:, :first].mean(axis=1) / UNIT,
            squashed(np.sqrt(np.mean(off**2, axis=1)), little),
            squashed(np.median(off, axis=1), little),
            squashed(off.max(axis=1), little),
            squashed(off.min(axis=1), little),
            off.argmax(axis=1) / off.shape[1],
            off.argmin(axis=1) / off.shape[1],
        ]
    )


def _creep(tip: Floats, told: Floats, seen: Seen) -> Floats:
    """The tip's speed towards the end of each plateau of the pressure; the first, the last, the largest."""
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
    d = squashed(np.stack(drifts), LITTLE * 3)  # (plateaus, 2, 3)
    off = d[:, 0] - d[:, 1]
    return np.concatenate(
        [d[-1, 0], off[-1], off[0], off[np.abs(off).argmax(axis=0), range(3)], off.mean(axis=0), d[:, 0].mean(axis=0)]
    )


def _course(tip: Floats, told: Floats, seen: Seen) -> Floats:
    """The residual, and the ratio of motion to prediction, from the first change of pressure on."""
    change = np.flatnonzero(np.abs(np.diff(seen.pressure_pa)) > 0.02 * np.ptp(seen.pressure_pa) + 1.0)
    first = int(change[0]) if len(change) else 0
    edges = np.linspace(min(first, tip.shape[1] - 2 * WINDOWS), tip.shape[1], WINDOWS + 1).astype(np.int64)
    out = []
    moves = [np.abs(np.diff(gaussian_filter1d(x, 1.0, axis=1), axis=1, append=x[:, -1:])) for x in (tip, told)]
    for a, b in itertools.pairwise(edges):
        out.append(squashed((tip - told)[:, a:b].mean(axis=1), LITTLE))
        each = [m[:, a:b].mean(axis=1) * RATE_HZ / UNIT + 5e-2 for m in moves]
        out.append(np.log(each[0] / each[1]))
    return np.concatenate(out)
