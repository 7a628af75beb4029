"""Shared by the tracking benchmarks: the paper's lens and set-ups, snap motion, and clips painted once."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.lens import shipped_lens
from straw.tracking.synthetic import camera_looking_at, paint_video
from straw.tracking.task import Track

REST = (0.0221, 0.0, 1.53)  # x_m, z_m, phi_rad of a deployed straw
LINE_S = 3.6e-6
STILL_S = 0.1
LENS = shipped_lens("gopro_hero6_wide_1080p240")
SETUPS = {
    "end-on, 25 deg aside": Camera(LENS, camera_looking_at((0.0251, 0, 0), 0.212, math.radians(25), 0.0)),
    "end-on, 25 deg above": Camera(LENS, camera_looking_at((0.0251, 0, 0), 0.212, 0.0, math.radians(25))),
    "side view": Camera(LENS, camera_looking_at((0.0151, 0, 0), 0.212, math.radians(-90), 0.0), mount="side"),
}
SI = np.array((1e6, 1e6, 1e3))  # to um, um, mrad


def snaps(seed: int) -> Callable:
    """Rest, then a snap of 15 to 25 ms every 0.3 s that rings at 15 to 25 Hz: up to 1 m/s and 30 rad/s."""
    rng = np.random.default_rng(seed)
    starts = STILL_S + 0.3 * np.arange(40) + rng.uniform(0, 0.05, 40)
    places = np.column_stack((rng.uniform(-8, 1, 40), rng.uniform(-4, 4, 40), rng.uniform(-200, 200, 40))) * 1e-3
    steps = np.diff(places, axis=0, prepend=0.0)
    rise_s, ring_hz, decay_s = rng.uniform(0.015, 0.025, 40), rng.uniform(15, 25, 40), rng.uniform(0.03, 0.08, 40)

    def tip(time_s):
        time_s = np.asarray(time_s, dtype=float)
        pose = [np.full(time_s.shape, value) for value in REST]
        for k in range(40):
            since = np.clip(time_s - starts[k], 0, None)
            p = np.clip(since / rise_s[k], 0, 1)
            rise = p**3 * (10 - 15 * p + 6 * p**2)
            ring = rise * (1 + 0.3 * np.exp(-since / decay_s[k]) * np.sin(2 * np.pi * ring_hz[k] * since))
            for i in range(3):
                pose[i] = pose[i] + steps[k, i] * ring
        return tuple(pose)

    return tip


def painted(path: Path, camera: Camera, motion: Callable, duration_s: float, **how) -> Path:
    """Paint a clip with rolling shutter, unless it exists already."""
    if not path.exists():
        paint_video(path, camera, motion, duration_s, **{"line_s": LINE_S, **how})
    return path


def blind(camera: Camera) -> Camera:
    """The same camera without its pose: what a user starts with."""
    return Camera(camera.lens, mount=camera.mount)


def errors(found: Track, motion: Callable) -> tuple[np.ndarray, np.ndarray]:
    """Tracked minus painted (n, 3) in um, um, mrad over valid frames, and the same in sigmas."""
    trace, valid = found.trace, found.trace.valid
    measured = np.column_stack((trace.x_m, trace.z_m, trace.phi_rad))[valid]
    sigma = np.column_stack((trace.sigma_x_m, trace.sigma_z_m, trace.sigma_phi_rad))[valid]
    error = measured - np.column_stack(motion(trace.time_s[valid]))
    return error * SI, error / sigma


def rms(values: np.ndarray) -> np.ndarray:
    """Root mean square over the first axis."""
    return np.sqrt((values**2).mean(axis=0))


BOARD = Board()
