"""Which share of their errors' variance frames show by their jumps: python -m tests.benchmarks.tracking_jumps.

    python -m tests.benchmarks.tracking_jumps --kinds "HEVC, dim" --clips 6 --keep /work/bench/hevc

Of clips by the independent painter, kept for calibration only: for each, the squares of the jumps over what is stated
of them, and the mean squared error over the stated variance in the same frames, both without a gain. The first over the
second, over all clips, is ``straw.tracking.jumps.SHOWN``.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from straw.tracking import jumps, poser
from straw.tracking.views import Views
from tests.benchmarks.tracking_painted import KINDS, errors, file_of, misprint_of, painted, tracked

FIRST = 600  # seeds that no figure of README.md is from


def main() -> int:
    """Print a line for each clip, then the share."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--clips", type=int, default=2, help="of each kind")
    ask.add_argument("--first", type=int, default=FIRST, help="seed of the first clip")
    ask.add_argument("--kinds", nargs="+", default=list(KINDS), choices=list(KINDS))
    ask.add_argument("--keep", type=Path, help="folder to keep the painted clips in")
    args = ask.parse_args()
    found = []
    print(f"{'squares over stated, of':<44}{'frames':>7}{'jumps':>7}{'errors':>8}")
    with tempfile.TemporaryDirectory() as made:
        for name in args.kinds:
            for seed in range(args.first, args.first + args.clips):
                misprint_um = misprint_of(seed)
                path = file_of(args.keep or Path(made), name, seed, misprint_um)
                scene = painted(path, KINDS[name], seed, 1e-6 * misprint_um)
                count, shown, true = compared(path, scene)
                print(f"{f'{seed} {name}':<44}{count:7}{shown:7.2f}{true:8.2f}", flush=True)
                found.append((shown, true))
    shown, true = np.mean(found, axis=0)
    print(f"all {len(found)} clips: jumps {shown:.2f}, errors {true:.2f}, share {shown / true:.2f}")
    return 0


def compared(path: Path, scene) -> tuple[int, float, float]:
    """Number of frames that a clip is judged by, and squares over what is stated: of their jumps, of their errors."""
    told: dict[str, Any] = {}
    learn = poser.Poser.learn

    def watched(self: poser.Poser, views: Views, swift: Views, askew_px: float = 0.0) -> None:
        told["frames"] = swift.frame
        learn(self, views, swift, askew_px)

    def without_gain(jump, covariance) -> float:
        told["shown"] = jumps.of_stated(jump, covariance)
        return 1.0

    with mock.patch.object(poser.Poser, "learn", watched), mock.patch.object(poser, "gain_of", without_gain):
        track = tracked(path, scene)
    judged = np.isin(track.trace.frame[track.trace.valid], told["frames"])
    ratio = errors(track, scene)[1][judged]
    return len(ratio), told["shown"], float((ratio**2).mean())


if __name__ == "__main__":
    sys.exit(main())
