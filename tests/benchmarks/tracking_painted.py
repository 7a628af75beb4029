"""Errors and sigmas by an independent painter, for every kind of clip: python -m tests.benchmarks.tracking_painted.

For each kind, the mean of the clips' squared errors over claimed variances, and its 95 % interval by a bootstrap of
whole clips, since a clip's errors of camera and board are common to all its frames.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from straw.tracking import variance
from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.lens import Lens
from straw.tracking.task import Track
from straw.tracking.track import track
from tests.benchmarks.figures import missed, publish, write_option
from tests.benchmarks.intervals import beside, shown
from tests.painting.film import encode, film
from tests.painting.motions import REST, full_turn, snaps
from tests.painting.scene import Scene, about, looking

SI = np.array((1e6, 1e6, 1e3))  # to um, um, mrad
SIDE = np.array(((1.0, 0, 0), (0, 0, -1.0), (0, 1.0, 0)))  # the board's y along the tip's axis, its face towards -Y
BEYOND = 6.0  # sigmas
CLIPS = 12
Retouch = Callable[[int, np.ndarray, np.random.Generator], np.ndarray]


def end_on(seed: int, azimuth: float, elevation: float, misprint_m: float) -> Scene:
    rng = np.random.default_rng(seed)
    place = looking(
        rng.normal((0.025, 0, 0), 0.002),
        rng.uniform(0.17, 0.23),
        *np.radians((azimuth, elevation)),
        rng.normal(0, 0.02),
    )
    askew = about(0, rng.normal(0, 0.015)) @ about(2, rng.normal(0, 0.015))
    looks = {"row_s": 5.57e-6, "exposure_s": rng.uniform(1 / 960, 1 / 480), "misprint_m": misprint_m, "seed": seed}
    return Scene(
        place,
        snaps(seed),
        mounted=askew,
        f=rng.uniform(850, 980),
        psf_px=rng.uniform(0.5, 0.8),
        noise=rng.uniform(1, 3),
        **looks,
    )


def side_on(seed: int, misprint_m: float, *, turning: bool = False) -> Scene:
    rng = np.random.default_rng(seed)
    target = (0.007, 0, 0) if turning else (0.015, 0, 0)
    place = looking(
        target,
        rng.uniform(0.17, 0.21),
        math.radians(-90) + rng.normal(0, 0.05),
        rng.normal(0, 0.05),
        rng.normal(0, 0.03),
    )
    askew = about(0, rng.normal(0, 0.01)) @ about(2, rng.normal(0, 0.01)) @ SIDE
    looks = {"exposure_s": rng.uniform(1 / 960, 1 / 480), "misprint_m": misprint_m, "seed": seed}
    return Scene(place, full_turn(seed) if turning else snaps(seed), mounted=askew, f=rng.uniform(850, 980), **looks)


def troubled(index: int, luma: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A moving reflection, and a finger that covers an edge of the board."""
    v, u = np.ogrid[: luma.shape[0], : luma.shape[1]]
    at = 640 + 90 * math.sin(index / 31), 360 + 70 * math.cos(index / 19)
    glow = 230 * np.exp(-((((u - at[0]) ** 2 + (v - at[1]) ** 2) / (2 * 13.0**2)) ** 2))
    luma = np.minimum(luma + glow, 255)
    tip = 565 + 50 * math.sin(index / 43)
    finger = (np.abs(v - 300) < 25) & (u < tip)
    return np.where(finger, 128 + rng.normal(0, 2, luma.shape), luma).astype(np.uint8)


@dataclasses.dataclass(frozen=True)
class Kind:
    """One kind of clip: its scene by seed and misprint, how it is coded, and what is painted over it."""

    scene: Callable[[int, float], Scene]
    coded: dict = dataclasses.field(default_factory=dict)
    retouch: Retouch | None = None
    seconds: float = 2.2


KINDS = {
    "side view": Kind(lambda seed, off: side_on(seed, off)),
    "25 deg aside": Kind(lambda seed, off: end_on(seed, 25 if seed % 2 else -25, 0, off)),
    "25 deg above": Kind(lambda seed, off: end_on(seed, 0, 25 if seed % 2 else -25, off)),
    "aside and above": Kind(lambda seed, off: end_on(seed, 20, 18, off)),
    "full turn": Kind(lambda seed, off: side_on(seed, off, turning=True)),
    "glare, finger, noise, 12 Mbit/s": Kind(
        lambda seed, off: dataclasses.replace(end_on(seed, 25, 5, off), noise=6.0, light=0.7),
        {"bitrate": 12e6, "b_frames": 2},
        troubled,
    ),
    "HEVC, dim": Kind(
        lambda seed, off: dataclasses.replace(end_on(seed, 25, 5, off), light=0.4, noise=4.0),
        {"codec": "libx265", "preset": "ultrafast"},
    ),
}


MISPRINTS_UM = (0.0, 20.0)
#: Names of the kinds in README.md.
NAMES = dict(zip(KINDS, ("side", "aside", "above", "both", "turn", "trouble", "hevc"), strict=True))


def misprint_of(seed: int, each_um: Sequence[float] = MISPRINTS_UM) -> float:
    """Misprint of a clip's board, um: in turn, two clips each, as cameras differ by the seed's parity."""
    return each_um[seed // 2 % len(each_um)]


def file_of(folder: Path, name: str, seed: int, misprint_um: float) -> Path:
    """Name a clip's file by its kind, seed and misprint."""
    return folder / f"{''.join(c if c.isalnum() else '-' for c in name)}-{seed}-{misprint_um:.0f}.mp4"


def painted(path: Path, kind: Kind, seed: int, misprint_m: float) -> Scene:
    """Film a clip of a kind, unless it exists already; return its scene."""
    scene, rng = kind.scene(seed, misprint_m), np.random.default_rng(seed)
    if not path.exists():
        pictures = film(scene, kind.seconds)
        if kind.retouch:
            pictures = (kind.retouch(k, luma, rng) for k, luma in enumerate(pictures))
        part = path.with_suffix(".part.mp4")
        encode(part, pictures, **kind.coded).rename(path)
    return scene


def tracked(path: Path, scene: Scene, rest=REST) -> Track:
    """Track a clip as a user would: only the lens, the mount and the rest pose are known."""
    lens = Lens("brown_conrady", scene.width, scene.height, scene.f, scene.f, *scene.centre, scene.brown)
    mount = "side" if abs(scene.mounted[1, 2]) > 0.5 else "face"
    return track(path, Camera(lens, mount=mount), Board(*scene.squares[:1], scene.side_m), rest_pose=rest)


def errors(found: Track, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Tracked minus painted (n, 3), SI, over valid frames, and the same in sigmas."""
    trace, valid = found.trace, found.trace.valid
    measured = np.column_stack((trace.x_m, trace.z_m, trace.phi_rad))[valid]
    sigma = np.column_stack((trace.sigma_x_m, trace.sigma_z_m, trace.sigma_phi_rad))[valid]
    error = measured - scene.motion(trace.time_s[valid])
    error[:, 2] = (error[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return error, error / sigma


def main() -> int:
    """Print a line for each clip and each kind; 1 when a kind has more wrong frames than 1 in 10,000."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--clips", type=int, default=CLIPS, help="of each kind")
    ask.add_argument("--misprints", type=float, nargs="+", default=[*MISPRINTS_UM], help="um; in turn, two clips each")
    ask.add_argument("--first", type=int, default=100, help="seed of the first clip")
    ask.add_argument("--kinds", nargs="+", default=list(KINDS), choices=list(KINDS))
    ask.add_argument("--like", type=float, nargs=2, help="slow and fast, of straw.tracking.variance.MOTION_LIKE")
    ask.add_argument("--shift", type=float, default=variance.SHIFT, help="in place of straw.tracking.variance.SHIFT")
    ask.add_argument("--keep", type=Path, help="folder to keep the painted clips in")
    write_option(ask)
    args = ask.parse_args()
    variance.SHIFT, variance.MOTION_LIKE[:2] = args.shift, args.like or variance.MOTION_LIKE[:2]
    figures: dict[str, str] = {}
    print(
        f"{'':<44}{'frames':>7}{'valid':>7}{'> 6 s':>6}   {'error, um, um, mrad':<24}{'squared error / variance':<24}"
    )
    far = {True: [0, 0], False: [0, 0]}  # frames beyond, and all: of the clips with disturbances, of the others
    by_misprint: dict[float, list[np.ndarray]] = {each: [] for each in args.misprints}
    with tempfile.TemporaryDirectory() as made:
        folder = args.keep or Path(made)
        for name in args.kinds:
            by_clip: list[np.ndarray] = []
            for seed in range(args.first, args.first + args.clips):
                misprint_um = misprint_of(seed, args.misprints)
                path = file_of(folder, name, seed, misprint_um)
                scene = painted(path, KINDS[name], seed, 1e-6 * misprint_um)
                start = time.perf_counter()
                found = tracked(path, scene)
                error, ratio = errors(found, scene)
                label = f"{seed} {name}{', misprinted' if misprint_um else ''}"
                _say(label, len(found.trace), error, ratio, f"{time.perf_counter() - start:.1f} s")
                by_clip.append((ratio**2).mean(axis=0))
                by_misprint[misprint_um].append(by_clip[-1])
                far[name.startswith("glare")][0] += int((np.abs(ratio) > BEYOND).any(axis=1).sum())
                far[name.startswith("glare")][1] += len(ratio)
                if not args.keep:
                    path.unlink()
            squared = np.mean(by_clip, axis=0)
            mean = "{:.2f}, {:.2f}, {:.2f}".format(*squared)
            print(f"{name}, {len(by_clip)} clips: {mean}; 95 % {shown(by_clip)}", flush=True)
            figures[f"{NAMES[name]}-clips"] = str(len(by_clip))
            for channel, value, interval in zip(("x", "z", "phi"), squared, beside(by_clip), strict=True):
                figures[f"{NAMES[name]}-{channel}"] = missed(f"{value:.2f}", 0.7 <= value <= 1.3) + interval
    for misprint_um, by_clip in by_misprint.items():
        if by_clip:
            mean = "{:.2f}, {:.2f}, {:.2f}".format(*np.mean(by_clip, axis=0))
            print(f"misprinted by {misprint_um:g} um, {len(by_clip)} clips: {mean}; 95 % {shown(by_clip)}")
    wrong, total = (far[True][k] + far[False][k] for k in (0, 1))
    print(f"{wrong} of {total} valid frames beyond {BEYOND:g} sigma")
    for name, (beyond, frames) in (("trouble", far[True]), ("others", far[False])):
        figures[f"beyond-{name}"] = missed(f"{beyond} of {frames:,}", beyond <= frames / 10_000)
    publish("tracking_painted", figures, args.write)
    return int(wrong > total / 10_000)


def _say(label: str, frames: int, error: np.ndarray, ratio: np.ndarray, more: str = "") -> None:
    far = int((np.abs(ratio) > BEYOND).any(axis=1).sum())
    um = "{:7.1f} {:7.1f} {:7.2f}".format(*np.sqrt((error**2).mean(axis=0)) * SI)
    square = "{:7.2f} {:7.2f} {:7.2f}".format(*(ratio**2).mean(axis=0))
    print(f"{label:<44}{frames:7}{len(error):7}{far:6}   {um}  {square}  {more}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
