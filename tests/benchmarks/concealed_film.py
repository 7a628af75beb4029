"""Concealed cases through a camera: what moved is painted as the demo's GoPro sees it, and tracked again."""

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
    """The runs as the tracker reads them from video; one tripod for all, its place found in the first run.

    What the apparatus's own camera does wrong (clock, scale, roll, offset) is painted as it shows, so that the tracker
    cannot know of it.
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
