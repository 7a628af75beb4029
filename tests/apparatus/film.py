"""Runs of the apparatus through a camera: what moved is painted as a GoPro sees it, and tracked again."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from rig.run import Run
from tracking.board import Board
from tracking.camera import Camera
from tracking.lens import shipped_lens
from tracking.synthetic import camera_looking_at, paint_video
from tracking.track import track

from .campaign import Made, record

LENS = "gopro_hero6_wide_1080p240"
DISTANCE_M, AZIMUTH_RAD, LINE_S = 0.212, math.radians(25), 3.7e-6


def filmed(made: list[Made], seed: int, name: str) -> tuple[Run, ...]:
    """The runs as the tracker reads them from video; one tripod for all, its place found in the first run.

    What the apparatus's own camera does wrong (clock, scale, roll, offset) is painted as it shows, so that the tracker
    cannot know of it.
    """
    camera, runs = Camera(shipped_lens(LENS)), []
    x_m, z_m, _ = made[0].motion.at(np.zeros(1))[0]
    place = camera_looking_at((x_m + camera.tip_offset_m, 0.0, z_m), DISTANCE_M, AZIMUTH_RAD, 0.0)
    painter = replace(camera, world_from_camera=place)
    for one in made:

        def shown(time_s: np.ndarray, one: Made = one) -> tuple[np.ndarray, ...]:
            stamp_s = np.clip(np.atleast_1d(time_s), 0.0, None)
            tip = one.instrument.film(one.motion, stamp_s.ravel()).reshape(*stamp_s.shape, 3)
            return tuple(np.moveaxis(tip, -1, 0))

        with tempfile.TemporaryDirectory() as folder:
            video = Path(folder) / "video.mp4"
            paint_video(video, painter, shown, one.plan.seconds, seed=seed + one.index, line_s=LINE_S)
            known = camera.world_from_camera is not None
            rest = None if known else tuple(float(v[0]) for v in shown(np.zeros(1)))
            tracked = track(video, camera, Board(), rest_pose=rest)
        camera = tracked.camera
        runs.append(replace(record(one, seed, name), tip=tracked.trace))
    return tuple(runs)
