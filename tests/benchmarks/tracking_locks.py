"""Wrong locks in 10,000 painted frames of difficult cases: python -m tests.benchmarks.tracking_locks."""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from straw.tracking.board import Board
from straw.tracking.follow import NOT_DUE
from straw.tracking.pose import world_from_tip
from straw.tracking.track import track
from tests.benchmarks.figures import missed, publish, write_option
from tests.benchmarks.tracking_clips import BOARD, LENS, REST, SETUPS, blind, errors, painted, snaps

WRONG = np.array((1000.0, 1000.0, 100.0))  # um, um, mrad: a slip by one square is 4800 um or more
FPS = 240_000 / 1001
AT = (960, 560)  # where the board is in the end-on picture, px


def glare(index, luma):
    """A lamp's reflection that moves over the board."""
    u, v = AT[0] + 90 * math.sin(index / 37), AT[1] + 80 * math.cos(index / 23)
    spot = np.zeros((300, 300), np.float32)
    cv2.circle(spot, (150, 150), 34, 255, -1)
    spot = cv2.GaussianBlur(spot, (0, 0), 9)
    part = luma[int(v) - 150 : int(v) + 150, int(u) - 150 : int(u) + 150]
    part[:] = np.minimum(part + spot, 255)


def hand(index, luma):
    """A bar that passes over the board, up to all of it."""
    if index > 12:
        left = int(AT[0] - 420 + (index * 3) % 840)
        luma[AT[1] - 250 : AT[1] + 250, left : left + 110] = 90


def curtain(index, luma):
    """White paper over a half, then nearly all, then all of the board: the rest is partial, or nothing."""
    if index > 12:
        edge = AT[0] + 110 - int(110 * (1 - math.cos(index / 60)))
        luma[AT[1] - 250 : AT[1] + 250, edge : AT[0] + 300] = 215


def flashes(index, luma):
    """A flash, a dark frame, and stretches without a picture."""
    if index % 90 in (40, 41):
        luma[:] = 255
    elif index % 90 in (70, 71, 72, 73):
        luma[:] = 16


def noise(index, luma):
    """A tenth of the light, and the corresponding noise."""
    dim = luma * 0.25 + 20 + np.random.default_rng(index).normal(0, 6, luma.shape)
    luma[:] = np.clip(dim, 0, 255)


def near(camera, pixels):
    """The same camera, its lens's axis moved in the picture: the board nearer to an edge."""
    return replace(camera, lens=replace(LENS, cx=LENS.cx + pixels[0], cy=LENS.cy + pixels[1]))


def decoy(y_m, turn=0.0):
    place = world_from_tip(REST[0], REST[1], REST[2] + turn)
    place[:3, 3] += (0.0, y_m, 0.0)
    return BOARD, place


END_ON = SETUPS["end-on, 25 deg aside"]
CASES = {
    "snaps": (END_ON, {}),
    "snaps, side view": (SETUPS["side view"], {}),
    "blur to 0.7 square": (END_ON, {"exposure_s": 1 / 250}),
    "glare": (END_ON, {"retouch": glare}),
    "a hand passes": (END_ON, {"retouch": hand}),
    "paper over half to all of it": (END_ON, {"retouch": curtain}),
    "flashes and darkness": (END_ON, {"retouch": flashes}),
    "dim and noisy": (END_ON, {"retouch": noise}),
    "half out of the picture": (near(END_ON, (-930, 0)), {}),
    "a second board beside it": (END_ON, {"decoys": (decoy(0.055),)}),
    "a second board, larger and tilted": (END_ON, {"decoys": ((Board(8, 0.06), decoy(-0.08, 0.5)[1]),)}),
}


def main() -> int:
    """Print the result of each case; 1 if there is a wrong lock."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--frames", type=int, default=10_000)
    write_option(options)
    args = options.parse_args()
    each = math.ceil(args.frames / len(CASES))
    total = wrong = 0
    print(f"{'case':<36}{'frames':>7}{'valid':>7}{'wrong':>6}   largest error (um, um, mrad)  tracked in")
    with tempfile.TemporaryDirectory() as folder:
        for seed, (name, (camera, how)) in enumerate(CASES.items()):
            motion = snaps(seed)
            path = painted(Path(folder) / "clip.mp4", camera, motion, each / FPS, seed=seed, **how)
            start = time.perf_counter()
            given = camera if "half out" in name else blind(camera)
            near_px = AT if "second" in name else None
            found = track(path, given, BOARD, rest_pose=None if given is camera else REST, near_px=near_px)
            error = np.abs(errors(found, motion)[0])
            bad = int((error > WRONG).any(axis=1).sum())
            total, wrong = total + len(found.trace), wrong + bad
            largest = "  ".join(f"{value:7.1f}" for value in error.max(axis=0))
            valid = int(found.trace.valid.sum())
            print(f"{name:<36}{len(found.trace):7}{valid:7}{bad:6}   {largest}   {time.perf_counter() - start:.1f} s")
            for reason, count in found.invalid.items():
                if reason != NOT_DUE:
                    print(f"{'':<36}{count:7}  {reason}")
            path.unlink()
    print(f"{wrong} wrong locks in {total} frames")
    publish("tracking_locks", {"wrong": missed(f"{wrong} of {total:,}", wrong == 0)}, args.write)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
