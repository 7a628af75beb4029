"""Pictures that a converter repeated, in a re-encoded file: python -m tests.benchmarks.tracking_repeats.

Eight series of two or three repeats at random places, in fast snaps by the independent painter. Printed is how many
were refused, how many stayed valid beyond 6 sigma, and how many good frames were refused.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import av
import numpy as np

from straw.tracking.doubt import REPEATED
from tests.benchmarks.figures import missed, publish, write_option
from tests.benchmarks.tracking_painted import BEYOND, KINDS, file_of, misprint_of, painted, tracked
from tests.painting.film import encode

CLIPS = (("aside and above", 100, 1), ("25 deg above", 101, 2))  # kind, seed of the scene, seed of the places
RUNS, APART, FIRST = 8, 20, 50  # frames; before FIRST the board is at rest


def repeated(count: int, seed: int) -> np.ndarray:
    """Return which picture (count,) is shown in each frame."""
    rng, index, starts = np.random.default_rng(seed), np.arange(count), []
    while len(starts) < RUNS:
        start = int(rng.integers(FIRST, count - 10))
        if all(abs(start - other) > APART for other in starts):
            starts.append(start)
            index[start : start + int(rng.integers(2, 4))] = start - 1
    return index


def main() -> int:
    """Print a line for each clip; 1 when a repeated picture is valid and beyond 6 sigma."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--kind", choices=list(KINDS), help="one other clip: its kind, instead of the two of README.md")
    ask.add_argument("--seed", type=int, default=104, help="of its scene (104)")
    ask.add_argument("--places", type=int, default=11, help="seed of the places where pictures repeat (11)")
    ask.add_argument("--keep", type=Path, help="folder to keep the painted clips in")
    ask.add_argument("--b-frames", type=int, default=0, help="of the second encoding")
    write_option(ask)
    args = ask.parse_args()
    if args.kind and args.write:
        sys.exit("--write states the figures of the two clips of README.md: leave out --kind")
    wrong = repeats_shown = refused_others = others_shown = 0
    with tempfile.TemporaryDirectory() as made:
        folder = args.keep or Path(made)
        for kind, seed, places in [(args.kind, args.seed, args.places)] if args.kind else CLIPS:
            misprint_um = misprint_of(seed)
            path = file_of(folder, kind, seed, misprint_um)
            scene = painted(path, KINDS[kind], seed, 1e-6 * misprint_um)
            with av.open(str(path)) as video:
                pictures = [frame.to_ndarray(format="gray") for frame in video.decode(video=0)]
            index = repeated(len(pictures), places)
            again = encode(Path(made) / "again.mp4", (pictures[k] for k in index), bitrate=20e6, b_frames=args.b_frames)
            found = tracked(again, scene)
            trace, twice = found.trace, index != np.arange(len(index))
            error = np.column_stack((trace.x_m, trace.z_m, trace.phi_rad)) - scene.motion(trace.time_s)
            sigma = np.column_stack((trace.sigma_x_m, trace.sigma_z_m, trace.sigma_phi_rad))
            far = trace.valid & (np.abs(error) > BEYOND * np.nan_to_num(sigma)).any(axis=1)
            refused, wrong = found.said == REPEATED, wrong + int((far & twice).sum())
            repeats_shown, others_shown = repeats_shown + int(twice.sum()), others_shown + int((~twice).sum())
            refused_others += int((~trace.valid & ~twice).sum())
            repeats = (
                f"{(refused & twice).sum()} of {twice.sum()} repeats refused, {(far & twice).sum()} beyond 6 sigma"
            )
            others = (
                f"{(~trace.valid & ~twice).sum()} of {(~twice).sum()} others refused, {(far & ~twice).sum()} beyond"
            )
            print(f"{kind} {seed}: {repeats}; {others}", flush=True)
    figures = {
        "beyond": missed(f"{wrong} of {repeats_shown}", wrong == 0),
        "others": f"{refused_others} of {others_shown:,}",
    }
    publish("tracking_repeats", figures, args.write)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
