"""Comparison with existing methods on the same files: python -m tests.benchmarks.tracking_versus.

Painted clips: this tracker; per-frame findChessboardCornersSB + PnP; and findChessboardCorners + cornerSubPix + PnP, as
OpenCV's samples do. Real pictures: found or not, residual of the best homography, time.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from straw.tracking.calibrate_views import sharpened
from straw.tracking.corners import find_boards
from straw.tracking.lens_fit import View
from straw.tracking.track import track
from straw.tracking.video import VideoReader
from tests.benchmarks.figures import publish, write_option
from tests.benchmarks.tracking_clips import BOARD, REST, SETUPS, SI, blind, errors, painted, rms, snaps
from tests.benchmarks.tracking_locks import glare, hand

REALDATA = Path(__file__).parents[3] / "shared" / "realdata"
EVERY = 12  # frames: the others take a tenth of a second each, or minutes
_FINE = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)


def by_sb(luma, shape):
    """Corners (n, 2) by the sector-based detector alone."""
    found, corners = cv2.findChessboardCornersSB(luma, shape, flags=cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY)
    return corners.reshape(-1, 2) if found else None


def by_classic(luma, shape):
    """Corners (n, 2) by the classic detector and cornerSubPix (11, 11), with the fast check that limits its time."""
    found, corners = cv2.findChessboardCorners(
        luma, shape, flags=cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    )
    return cv2.cornerSubPix(luma, corners, (11, 11), (-1, -1), _FINE).reshape(-1, 2) if found else None


def by_straw(luma, shape):
    """Corners (n, 2) of the first board of this shape, as straw calibrate takes them."""
    for grid in find_boards(luma):
        if sorted(grid.shape[:2]) == sorted(shape):
            return (
                sharpened(luma, grid)[0] if grid.shape[1] == shape[0] else sharpened(luma, grid.transpose(1, 0, 2))[0]
            )
    return None


def pnp_errors(camera, corners, truth) -> np.ndarray | None:
    """Error (3) in um, um, mrad of PnP on undistorted corners, the best of the board's four orientations."""
    lens = camera.lens
    rays = lens.rays(corners)
    best = None
    for turn in range(4):
        points = np.rot90(BOARD.corner_points_m().reshape(7, 7, 3), turn).reshape(-1, 3)
        for flip in (points, points.reshape(7, 7, 3).transpose(1, 0, 2).reshape(-1, 3)):
            found, rotation, shift = cv2.solvePnP(flip, rays, np.eye(3), None, flags=cv2.SOLVEPNP_ITERATIVE)
            if not found:
                continue
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(rotation)[0], shift.ravel()
            tip = camera.world_from_camera @ pose @ np.linalg.inv(camera.tip_from_board)
            error = (np.array((tip[0, 3], tip[2, 3], np.arctan2(tip[0, 2], tip[2, 2]))) - truth) * SI
            if tip[1, 1] > 0.8 and (best is None or np.linalg.norm(error) < np.linalg.norm(best)):
                best = error
    return best


def painted_clips(seconds: float) -> None:
    """Compare on painted clips: easy, blurred, with glare, covered."""
    camera = SETUPS["end-on, 25 deg aside"]
    cases = {"snaps": {}, "blurred": {"exposure_s": 1 / 250}, "glare": {"retouch": glare}, "a hand": {"retouch": hand}}
    print(
        f"{'painted clip':<12}{'method':<26}{'found':>12}{'X / um':>9}{'Z / um':>9}{'Phi / mrad':>12}{'ms/frame':>10}"
    )
    for seed, (name, how) in enumerate(cases.items(), 40):
        motion = snaps(seed)
        with tempfile.TemporaryDirectory() as folder:
            path = painted(Path(folder) / "clip.mp4", camera, motion, seconds, seed=seed, line_s=0.0, **how)
            start = time.perf_counter()
            found = track(path, blind(camera), BOARD, rest_pose=REST)
            took, n = time.perf_counter() - start, len(found.trace)
            error = rms(errors(found, motion)[0])
            line(name, "straw track", int(found.trace.valid.sum()), n, error, 1e3 * took / n)
            for label, method in (("SB + PnP", by_sb), ("classic + cornerSubPix + PnP", by_classic)):
                missed, asked, spent = [], 0, 0.0
                with VideoReader(path) as video:
                    for frame in video.frames():
                        if frame.index % EVERY:
                            continue
                        asked, start = asked + 1, time.perf_counter()
                        corners = method(np.ascontiguousarray(frame.luma), (7, 7))
                        spent += time.perf_counter() - start
                        truth = np.array([float(value) for value in motion(np.array(frame.time_s))])
                        one = None if corners is None else pnp_errors(camera, corners, truth)
                        missed += [] if one is None else [one]
                error = rms(np.array(missed)) if missed else np.full(3, np.nan)
                line(name, label, len(missed), asked, error, 1e3 * spent / asked)


def line(name: str, label: str, found: int, asked: int, error: np.ndarray, ms: float) -> None:
    """Print one row."""
    x, z, phi = error
    print(f"{name:<12}{label:<29}{found:4} of {asked:<4}{x:8.1f}{z:9.1f}{phi:12.2f}{ms:10.1f}", flush=True)


def real_pictures(write: bool) -> bool:
    """Compare on every real picture; return whether no picture took this program over half a second of one core."""
    figures = {}
    pictures = [
        (path, cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)) for path in sorted(REALDATA.glob("*_chess9x6/*.jpg"))
    ]
    with VideoReader(next(REALDATA.glob("edihead*/*.mp4"))) as video:
        pictures += [(video.path, frame.luma.copy()) for frame in video.frames() if frame.index % 3 == 0]
    head = f"{'found':>12}{'residual / px':>15}{'mean ms':>10}{'slowest: CPU, wall ms':>24}"
    print(f"\n{'real pictures (9 x 6 corners)':<32}{head}")
    slowest = 0.0
    for label, method in (("straw", by_straw), ("SB", by_sb), ("classic + cornerSubPix", by_classic)):
        misses, times = [], []
        for _, luma in pictures:
            start, cpu = time.perf_counter(), time.process_time()
            corners = method(luma, (9, 6))
            times.append(1e3 * np.array((time.process_time() - cpu, time.perf_counter() - start)))
            misses += [] if corners is None else [misfit(corners)]
        found = f"{len(misses):4} of {len(pictures):<4}{np.median(misses):15.3f}"
        (mean, _), (cpu_ms, wall_ms) = np.mean(times, axis=0), np.max(times, axis=0)
        print(f"{label:<32}{found}{mean:10.0f}{cpu_ms:14.0f}{wall_ms:10.0f}", flush=True)
        slowest = slowest or float(cpu_ms)
        short = label.partition(" ")[0].lower()
        figures |= {f"{short}-found": f"{len(misses)}", f"{short}-px": f"{np.median(misses):.2f}"}
    publish("tracking_versus", figures | {"pictures": f"{len(pictures)}"}, write)
    return slowest < 500


def misfit(corners: np.ndarray) -> float:
    """Residual (px rms) of 54 corners to a homography with a radial term, the main part of lens distortion."""
    i, j = np.meshgrid(np.arange(9), np.arange(6))
    view = View(np.column_stack((i.ravel(), j.ravel(), np.zeros(54))), corners, "")
    plane, seen = view.points[:, :2].astype(np.float32), corners.astype(np.float32)
    terms = np.column_stack([plane[:, 0] ** a * plane[:, 1] ** b for a in range(4) for b in range(4 - a)])
    left = seen - terms @ np.linalg.lstsq(terms, seen, rcond=None)[0]  # a cubic: perspective and lens, over one board
    return float(np.sqrt((left**2).mean()))


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seconds", type=float, default=1.0, help="of each painted clip; 0: real pictures only")
    write_option(options)
    asked = options.parse_args()
    if asked.seconds > 0:
        painted_clips(asked.seconds)
    if not REALDATA.is_dir():
        sys.exit(f"the real pictures are not beside this checkout ({REALDATA})")
    sys.exit(not real_pictures(asked.write))
