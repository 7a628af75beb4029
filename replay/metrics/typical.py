"""Motions for checking a figure of merit without a recording: a fold that rings, and a tip at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from straw.replay.compare.judge import Motion


def typical_motions() -> dict[str, Motion]:
    """By name, at 240 frames/s; the fold turns the tip by 0.35 rad for 0.12 s, comes back and rings at 14 Hz."""
    from straw.replay.compare.judge import measured_motion
    from straw.tracking.trace import TipTrace

    time_s = np.arange(480) / 240
    since = time_s - 0.62
    ring = np.where(since > 0, 0.05 * np.exp(-8 * since) * np.sin(2 * np.pi * 14 * since), 0.0)
    turn = np.where((time_s > 0.5) & (since < 0), 0.35 * np.sin(np.pi * (time_s - 0.5) / 0.12), -ring)
    step_pa = -25e3 * (1 - np.exp(-np.clip(time_s - 0.3, 0, None) / 0.02))
    flat = np.zeros(len(time_s))
    sigma_m, sigma_rad = np.full(len(time_s), 3e-6), np.full(len(time_s), 3e-4)
    frames, valid = np.arange(len(time_s)), np.ones(len(time_s), dtype=bool)
    out = {}
    for name, phi, pressure_pa in (("folding", turn, step_pa), ("resting", flat, flat)):
        x_m = 0.022 - 0.004 * (time_s > 0.62) * (name == "folding") + 0.01 * phi
        trace = TipTrace(time_s, x_m, 0.02 * phi, 1.53 + phi, sigma_m, sigma_m, sigma_rad, valid, frames)
        out[name] = measured_motion(trace, 0.1, pressure_pa)
    return out
