"""The track's sigmas against its errors, over random cameras and motions: python -m tests.benchmarks.tracking_sigmas.

    python -m tests.benchmarks.tracking_sigmas --clips 16 --first 40

Each clip has its own camera (pose, row time), board glued askew, rest pose and size of motion, and is coded in one of
two ways, of which the second leaves larger errors at the same bitrate. Printed is the mean squared error over the
claimed variance, by the camera's position and by coding. Variances are estimated in each clip
(straw.tracking.variance); the codec's usual lag (straw.tracking.noise) was estimated from clips 0 to 39 in the first
coding and 0 to 7 in the second.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from straw.tracking.camera import Camera
from straw.tracking.synthetic import camera_looking_at
from straw.tracking.track import track
from tests.benchmarks.figures import missed, publish, write_option
from tests.benchmarks.intervals import beside, shown
from tests.benchmarks.tracking_clips import BOARD, LENS, REST, blind, errors, painted, snaps

#: Least and largest azimuth and elevation in degrees; the side of the plane of motion is random.
STANDS = {
    "end-on, aside": ((15, 40), (-3, 3)),
    "end-on, above": ((-3, 3), (15, 40)),
    "side view": ((80, 100), (-8, 8)),
    "aside and above": ((12, 30), (12, 30)),
}
#: Names of the camera positions in README.md.
NAMES = dict(zip(STANDS, ("aside", "above", "side", "both"), strict=True))
PRESETS = ("ultrafast", "veryfast")  # x264's: without and with the tools that cameras' encoders have


def scene(clip: int) -> dict:
    """Camera, rest pose, motion and row time of a clip."""
    rng = np.random.default_rng(1000 + clip)
    name = list(STANDS)[clip % len(STANDS)]
    azimuth, elevation = (math.radians(rng.uniform(*span)) for span in STANDS[name])
    side = -1 if name == "side view" else rng.choice((-1, 1))
    target = rng.uniform((0.015, -0.002, -0.003), (0.026, 0.002, 0.003))
    place = camera_looking_at(target, rng.uniform(0.17, 0.26), side * azimuth, elevation)
    place[:3, :3] @= Rotation.from_euler("z", rng.uniform(-3, 3), degrees=True).as_matrix()
    turn = tuple(rng.normal(0, 0.008, 2))
    camera = Camera(LENS, place, mount="side" if name == "side view" else "face", board_turn_rad=turn)
    rest = np.array(REST) + rng.uniform((-0.006, -0.002, -0.15), (0.001, 0.002, 0.15))
    base, size = snaps(1000 + clip), rng.uniform(0.2, 1.0)

    def motion(time_s):
        return tuple(at + size * (np.asarray(p) - zero) for at, p, zero in zip(rest, base(time_s), REST, strict=True))

    return {"name": name, "camera": camera, "rest": tuple(rest), "motion": motion, "line_s": rng.uniform(2.5e-6, 4e-6)}


def preset(clip: int) -> str:
    """How a clip is coded."""
    return PRESETS[clip // len(STANDS) % len(PRESETS)]


def main() -> None:
    """Print mean squares in sigmas of each clip and of each kind."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--clips", type=int, default=16)
    ask.add_argument("--first", type=int, default=40, help="number of the first clip")
    ask.add_argument("--seconds", type=float, default=2.5)
    write_option(ask)
    args = ask.parse_args()
    squares: dict[str, list[np.ndarray]] = {name: [] for name in (*STANDS, *PRESETS)}
    print(f"{'mean square in sigmas of':<36}{'X':>8}{'Z':>8}{'Phi':>8}")
    with tempfile.TemporaryDirectory() as folder:
        for clip in range(args.first, args.first + args.clips):
            made = scene(clip)
            camera, motion = made["camera"], made["motion"]
            how = {"seed": clip, "line_s": made["line_s"], "preset": preset(clip)}
            path = painted(Path(folder) / "clip.mp4", camera, motion, args.seconds, **how)
            found = track(path, blind(camera), BOARD, rest_pose=made["rest"], record=Path(folder) / "record")
            _, ratio = errors(found, motion)
            found.record.remove()
            path.unlink()
            for name in (made["name"], preset(clip)):
                squares[name].append((ratio**2).mean(axis=0))
            _say(f"{clip} {made['name']}, {preset(clip)}", (ratio**2).mean(axis=0))
    figures = {}
    for name, found in squares.items():
        if found:
            mean, key = np.mean(found, axis=0), NAMES.get(name, name)
            _say(f"all {name}", mean, f"  95 % {shown(found)}")
            figures[f"{key}-clips"] = str(len(found))
            for channel, value, interval in zip(("x", "z", "phi"), mean, beside(found), strict=True):
                figures[f"{key}-{channel}"] = missed(f"{value:.2f}", 0.7 <= value <= 1.3) + interval
    publish("tracking_sigmas", figures, args.write)


def _say(what: str, square: np.ndarray, more: str = "") -> None:
    x, z, phi = square
    print(f"{what:<36}{x:8.2f}{z:8.2f}{phi:8.2f}{more}", flush=True)


if __name__ == "__main__":
    main()
