"""Camera and gauge: how they record a motion, with the faults that occur in a lab."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .straw import Motion

FINE_S = 5e-4  # time step of the true pressure
WARM_S = 1.5  # of a gauge that warms up
SINKS_S, SLIPS_S = 2.0, 1.7  # of a camera that sinks, and when it slips
FRAME_S, GAUGE_S = 1.0 / 240.0, 1.0 / 200.0
SIGMA = np.array([25e-6, 25e-6, 1.5e-3])
SIGMA_PA = 30.0
REST_LENGTHS = np.array([10e-3, 10e-3, 0.3])  # m, m, rad: length scale of the smooth residual
SLOW_SHARE, SLOW_FRAMES = 0.45, 15.0  # correlated share of the noise's variance, and its correlation time


@dataclass(frozen=True)
class Instrument:
    """Faults, all zero in a sound instrument. The camera stamps true time t as t + offset + drift t."""

    clock_offset_s: float = 0.0
    clock_drift: float = 0.0
    length_scale: float = 0.0
    camera_roll_rad: float = 0.0
    tip_offset_m: float = 0.0
    gauge_offset_pa: float = 0.0
    gauge_gain: float = 0.0
    gauge_floor_pa: float = -1e9
    gauge_ceiling_pa: float = 1e9
    gauge_play_pa: float = 0.0
    gauge_warms_pa: float = 0.0  # its zero drifts by so much while it warms up in each run
    camera_sinks_m: float = 0.0  # its picture drifts by so much along Z while the mount gives way in each run
    camera_slips_rad: float = 0.0  # it turns by so much in its mount in each run
    board_slips_m: float = 0.0  # it is pushed along the tip by so much at the same moment
    frame_bends_rad: float = 0.0  # the camera stands on it and turns by so much where X is 50 mm, linearly
    hiccup_at_s: float = 0.0
    hiccup_s: float = 0.0
    rest_sigmas: float = 0.0  # residual of lens, board and straw that no model describes: smooth over the pose
    rest_draw: int = 0

    def true_time(self, stamp_s: np.ndarray) -> np.ndarray:
        t = (stamp_s - self.clock_offset_s) / (1.0 + self.clock_drift)
        return t + self.hiccup_s * (t > self.hiccup_at_s)

    def film(self, motion: Motion, stamp_s: np.ndarray) -> np.ndarray:
        """Tip (n, 3) as tracked without noise at the camera's stamps."""
        time_s = self.true_time(stamp_s)
        x, z, phi = motion.at(time_s).T
        roll = self.camera_roll_rad + self.camera_slips_rad * (time_s > SLIPS_S) + self.frame_bends_rad * x / 50e-3
        off_m = self.tip_offset_m + self.board_slips_m * (time_s > SLIPS_S)
        x, z = x + off_m * np.sin(phi), z + off_m * np.cos(phi)
        x, z = x * (1.0 + self.length_scale), z * (1.0 + self.length_scale)
        s, c = np.sin(roll), np.cos(roll)
        seen = np.column_stack([c * x + s * z, c * z - s * x, phi + roll])
        seen[:, 1] -= self.camera_sinks_m * np.expm1(-time_s / SINKS_S)
        return seen + self._rest(seen) if self.rest_sigmas else seen

    def _rest(self, seen: np.ndarray) -> np.ndarray:
        """Two waves over the pose for each channel; their rms is as stated if all phases occur."""
        rng = np.random.default_rng(self.rest_draw)
        waves = rng.normal(size=(3, 2, 3)) / REST_LENGTHS
        angle = np.einsum("nk,cwk->ncw", seen, waves) + rng.uniform(0, 2 * np.pi, size=(3, 2))
        return self.rest_sigmas * SIGMA * np.sum(np.sin(angle), axis=2)

    def gauge(self, pressure_pa: np.ndarray) -> np.ndarray:
        """Readings without noise of a true pressure, FINE_S from sample to sample, that changes slowly."""
        warm = self.gauge_warms_pa * -np.expm1(-np.arange(len(pressure_pa)) * FINE_S / WARM_S)
        reading = np.clip(
            (1.0 + self.gauge_gain) * pressure_pa + self.gauge_offset_pa + warm,
            self.gauge_floor_pa,
            self.gauge_ceiling_pa,
        )
        if self.gauge_play_pa:  # backlash: the reading follows only when it is pushed
            out = reading[0]
            for i, value in enumerate(reading):
                out = reading[i] = min(max(out, value - self.gauge_play_pa), value + self.gauge_play_pa)
        return reading


def tracking_noise(frames: int, rng: np.random.Generator) -> np.ndarray:
    """Noise (frames, 3) of the stated sigma: a white and a correlated part (AR(1))."""
    a = np.exp(-1.0 / SLOW_FRAMES)
    slow = rng.normal(size=(frames, 3))
    for i in range(1, frames):
        slow[i] = a * slow[i - 1] + np.sqrt(1.0 - a * a) * slow[i]
    return SIGMA * (np.sqrt(1.0 - SLOW_SHARE) * rng.normal(size=(frames, 3)) + np.sqrt(SLOW_SHARE) * slow)


def kept_frames(frames: int, rng: np.random.Generator) -> np.ndarray:
    """Which frames are recorded: occasionally one is dropped, rarely several in a row."""
    kept = rng.random(frames) > 0.002
    if rng.random() < 0.2:
        start = int(rng.integers(frames))
        kept[start : start + int(rng.integers(2, 6))] = False
    kept[0] = True
    return kept
