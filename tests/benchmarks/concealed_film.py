"""Concealed cases through a camera: the motion is painted as seen by the demo's GoPro, and tracked."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from straw.replay.demo.film import film, lens_alone
from straw.rig.run import Run
from straw.tracking.board import Board
from straw.tracking.track import track
from tests.apparatus.campaign import Made, record


def filmed(made: list[Made], seed: int, name: str) -> tuple[Run, ...]:
    """The runs as tracked from video; the camera is the same for all, its pose found in the first run.

    Faults of the apparatus's own camera (clock, scale, roll, offset) are painted into the video, so that they are
    unknown to the tracker.
    """
    camera, runs = lens_alone(), []
    stands = tuple(float(v) for v in made[0].motion.at(np.zeros(1))[0])
    for one in made:

        def shown(time_s: np.ndarray, one: Made = one) -> tuple[np.ndarray, ...]:
            stamp_s = np.clip(np.atleast_1d(time_s), 0.0, None)
            tip = one.instrument.film(one.motion, stamp_s.ravel()).reshape(*stamp_s.shape, 3)
            return tuple(np.moveaxis(tip, -1, 0))

        with tempfile.TemporaryDirectory() as folder:
            video = Path(folder) / f"{one.plan.run_id}.mp4"
            film(video, shown, stands, one.plan.seconds, seed + one.index)
            known = camera.world_from_camera is not None
            rest = None if known else tuple(float(v[0]) for v in shown(np.zeros(1)))
            tracked = track(video, camera, Board(), rest_pose=rest)
        camera = tracked.camera
        runs.append(replace(record(one, seed, name), tip=tracked.trace))
    return tuple(runs)
