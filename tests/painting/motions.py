"""Motions to paint: snaps that ring, and a full turn; all infinitely smooth."""

from __future__ import annotations

import numpy as np

from tests.painting.scene import Motion

REST = (0.0221, 0.0, 1.53)
STILL_S = 0.12


def snaps(seed: int, rest: tuple[float, float, float] = REST, size: float = 1.0) -> Motion:
    """Rest, then every quarter of a second a step of up to ``size`` 8 mm, 0.2 rad that takes 10 ms and rings."""
    rng = np.random.default_rng(seed)
    starts = STILL_S + 0.06 + 0.25 * np.arange(60) + rng.uniform(0, 0.1, 60)
    places = size * rng.uniform((-8e-3, -4e-3, -0.2), (1e-3, 4e-3, 0.2), (60, 3))
    steps = np.diff(places, axis=0, prepend=0.0)
    tau, ring, decay = rng.uniform(4e-3, 8e-3, 60), rng.uniform(40, 80, 60), rng.uniform(0.03, 0.08, 60)

    def motion(time_s):
        since = np.asarray(time_s, float)[..., None] - starts
        gone = 0.5 * (1 + np.tanh(since / tau))
        shape = gone * (
            1
            + 0.25
            * np.exp(-np.abs(since) / decay)
            * np.sin(ring * since) ** 2
            * np.sign(since)
            * np.tanh(np.abs(since) / 0.01) ** 3
        )
        return shape @ steps + rest

    return motion


def full_turn(seed: int, rest: tuple[float, float, float] = REST, seconds: float = 2.0) -> Motion:
    """Rest, then phi by 2 pi while the tip goes round a circle of 15 mm."""
    way = 1 if seed % 2 else -1

    def motion(time_s):
        p = np.clip((np.asarray(time_s, float) - STILL_S) / seconds, 0, 1)
        turn = way * 2 * np.pi * (p - np.sin(2 * np.pi * p) / (2 * np.pi))
        return np.stack(
            (rest[0] + 0.015 * (np.cos(turn) - 1), rest[2 - 1] + 0.015 * np.sin(turn), rest[2] + turn), axis=-1
        )

    return motion
