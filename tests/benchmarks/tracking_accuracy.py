"""Accuracy on painted snaps, against free per-frame PnP: python -m tests.benchmarks.tracking_accuracy.

For several clips of a set-up, the mean square in sigmas has a 95 % interval by a bootstrap of whole clips.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from straw.tracking.camera import Camera
from straw.tracking.pose import free_pose, world_from_tip
from straw.tracking.task import Track
from straw.tracking.track import track
from tests.benchmarks.figures import missed as bold
from tests.benchmarks.figures import publish, write_option
from tests.benchmarks.intervals import beside, shown
from tests.benchmarks.tracking_clips import BOARD, LINE_S, REST, SETUPS, SI, blind, errors, painted, rms, snaps

CHANNELS = ("x", "z", "phi")  # as in the names of figures in README.md


def free_errors(found: Track, camera, motion) -> np.ndarray:
    """Errors (n, 3) in um, um, mrad of a free pose for each frame, from the same corners, with the true camera pose."""
    to_board = np.linalg.inv(camera.tip_from_board)
    points, missed = BOARD.corner_points_m(), []
    for k, row in enumerate(found.record.rows(0, len(found.trace))):
        if row["seen"] and k % 3 == 0:
            used = row["used"].ravel()
            pose, _ = free_pose(camera.lens, points[used], row["grid"].reshape(-1, 2)[used].astype(float))
            tip = camera.world_from_camera @ pose @ to_board
            phi = np.arctan2(tip[0, 2], tip[2, 2])
            truth = np.array([float(value) for value in motion(np.array(found.trace.time_s[k]))])
            missed.append((np.array((tip[0, 3], tip[2, 3], phi)) - truth) * SI)
    return np.array(missed)


def allowed(camera) -> np.ndarray:
    """Ratio (3,) of the sigmas of X, Z, Phi with six free unknowns to those with three, for independent corner errors.

    For a camera in the plane of motion the picture is mirror-symmetric about it: motions in and out of the plane change
    the picture in even and odd ways, so that they are uncorrelated and the ratio is one for every estimator. The
    constraint gains accuracy where the camera stands aside.
    """
    points = BOARD.corner_points_m() @ camera.tip_from_board[:3, :3].T + camera.tip_from_board[:3, 3]
    to_camera, rest = np.linalg.inv(camera.world_from_camera), world_from_tip(*REST)

    def seen(change):
        turn = Rotation.from_rotvec(change[3:]).as_matrix()
        world = points @ rest[:3, :3].T @ turn.T + rest[:3, 3] + change[:3]
        return camera.lens.project(world @ to_camera[:3, :3].T + to_camera[:3, 3]).ravel()

    steps = 1e-6 * np.eye(6)
    J = np.column_stack([(seen(step) - seen(-step)) / 2e-6 for step in steps])
    plane = [0, 2, 4]
    free, planar = np.linalg.inv(J.T @ J), np.linalg.inv(J[:, plane].T @ J[:, plane])
    return np.sqrt(np.diag(free)[plane] / np.diag(planar))


def main() -> int:
    """Print errors in um, um, mrad and in sigmas for each set-up."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seconds", type=float, default=4.0)
    options.add_argument("--clips", type=int, default=1, help="of each set-up")
    write_option(options)
    args = options.parse_args()
    figures: dict[str, str] = {}
    print(f"{'':<24}{'X / um':>10}{'Z / um':>10}{'Phi / mrad':>12}")
    with tempfile.TemporaryDirectory() as folder:
        for first, (name, camera) in enumerate(SETUPS.items(), 20):
            clips = [one(Path(folder), name, camera, first + 10 * k, args.seconds) for k in range(args.clips)]
            squares = [clip["mean square in sigmas"] for clip in clips]
            square = np.mean(squares, axis=0)
            if len(clips) > 1:
                mean = "{:.2f}, {:.2f}, {:.2f}".format(*square)
                print(f"{name}, {len(clips)} clips: mean square in sigmas {mean}; 95 % {shown(squares)}", flush=True)
            key = {"end-on, 25 deg aside": "aside", "side view": "side"}.get(name, "above")
            error, free = (np.sqrt(np.mean([c[what] ** 2 for c in clips], axis=0)) for what in ("RMS", "free PnP, RMS"))
            for channel, value, mean, interval in zip(CHANNELS, error, square, beside(squares), strict=True):
                figures[f"{key}-{channel}"] = f"{value:.2f} mrad" if channel == "phi" else f"{value:.1f} µm"
                figures[f"{key}-squared-{channel}"] = bold(f"{mean:.2f}", 0.7 <= mean <= 1.3) + interval
            figures[f"{key}-clips"] = str(len(clips))
            if key == "aside":
                figures |= {f"free-{c}": f"{t:.2g}" for c, t in zip(CHANNELS, free / error, strict=True)}
    publish("tracking_accuracy", figures, args.write)
    return 0


def one(folder: Path, name: str, camera: Camera, seed: int, duration_s: float) -> dict[str, np.ndarray]:
    """Paint a clip, track it, print the errors; return what is printed, each (3,) for X, Z and Phi, by its name."""
    motion = snaps(seed)
    path = painted(folder / "clip.mp4", camera, motion, duration_s, seed=seed)
    found = track(path, blind(camera), BOARD, rest_pose=REST, record=folder / "record")
    error, ratio = errors(found, motion)
    free = free_errors(found, camera, motion)
    found.record.remove()
    path.unlink()
    found_here = {
        "RMS": rms(error),
        "random": error.std(axis=0),
        "systematic": np.abs(error.mean(axis=0)),
        "free PnP, RMS": rms(free),
        "free PnP / this": rms(free) / rms(error),
        "  that geometry allows": allowed(camera),
        "mean square in sigmas": (ratio**2).mean(axis=0),
    }
    valid = int(found.trace.valid.sum())
    line = f"{1e6 * found.camera.line_s:.3f} +- {1e6 * found.line_sigma_s:.3f} us, painted {1e6 * LINE_S:.3f}"
    print(f"{name}, motion {seed}: {valid} of {len(found.trace)} frames valid; row time {line}")
    for what, values in found_here.items():
        x, z, phi = values
        print(f"  {what:<22}{x:10.2f}{z:10.2f}{phi:12.3f}", flush=True)
    return found_here


if __name__ == "__main__":
    sys.exit(main())
