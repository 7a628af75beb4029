"""A board that was lost is reacquired within ten frames, once 60 % of it is in view and sharp."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest

from tests.benchmarks.tracking_painted import end_on, errors, side_on, tracked
from tests.painting.film import RATE, encode, film
from tests.painting.motions import snaps
from tests.painting.scene import Camera

HIDDEN = range(40, 49)  # frames in which it is hidden entirely, while it keeps moving
SOON = 10
#: What stays covered, in halves of the board: a hand from one side, from a corner, a finger across its middle.
COVERS = {
    "a side": ((-1.3, -1.3), (-0.2, 1.3)),
    "a corner": ((-1.3, -1.3), (0.2, 0.3)),
    "across": ((-0.25, -1.3), (0.5, 1.3)),
}


@pytest.fixture(scope="module", params=["end-on", "side view"])
def moving(request: pytest.FixtureRequest):
    """The camera before a board that snaps, in a small picture, and its pictures."""
    scene = end_on(7, 25, 0, 0.0) if request.param == "end-on" else side_on(7, 0.0)
    small = dataclasses.replace(scene, width=560, height=480, centre=(279.3, 238.8), f=620.0, exposure_s=1 / 960)
    small = dataclasses.replace(small, motion=snaps(7, size=0.8))
    return Camera(small), list(film(small, 0.42))


def covered(camera: Camera, picture: np.ndarray, index: int, low, high) -> np.ndarray:
    """Paint a grey patch over a rectangle of the board."""
    scene = camera.scene
    H = camera._boards(np.array([index / float(RATE) + scene.row_s * scene.height / 2]))[0]
    half = scene.side_m / 2
    ends = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    p = np.array([(half * x, half * y, 1.0) for x, y in ends]) @ H.T
    pixels = scene.f * p[:, :2] / p[:, 2:] + scene.centre
    return cv2.fillConvexPoly(picture.copy(), pixels.round().astype(np.int32), 118)


@pytest.mark.parametrize("cover", COVERS)
def test_a_board_that_stays_40_percent_covered_is_reacquired_within_ten_frames(moving, tmp_path, cover):
    camera, pictures = moving
    scene = camera.scene
    hidden = [covered(camera, pictures[k], k, (-1.5, -1.5), (1.5, 1.5)) for k in HIDDEN]
    later = [covered(camera, pictures[k], k, *COVERS[cover]) for k in range(HIDDEN.stop, len(pictures))]
    found = tracked(encode(tmp_path / "v.mp4", [*pictures[: HIDDEN.start], *hidden, *later], bitrate=12e6), scene)
    assert not found.trace.valid[HIDDEN].any()
    # the first picture, coded by half more coarsely than later ones, is refused on some machines beside "across"
    assert found.trace.valid[1 : HIDDEN.start].all()
    assert found.trace.valid[HIDDEN.stop + SOON :].all(), np.flatnonzero(~found.trace.valid)
    assert np.abs(errors(found, scene)[1]).max() < 6
