"""Wall time of straw track against decoding alone, in one run: python -m tests.benchmarks.tracking_speed [SECONDS]."""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path

from replay.commands.track import track_to_file
from tests.benchmarks.tracking_clips import REST, SETUPS, blind, painted, snaps
from tracking.video import VideoReader, ahead

PRESET = {"libx264": "veryfast", "libx265": "ultrafast"}


def decode_s(path: Path) -> float:
    """Seconds to decode every frame and look at none."""
    start = time.perf_counter()
    with VideoReader(path) as video:
        for _ in ahead(video.frames()):
            pass
    return time.perf_counter() - start


def track_s(path: Path, folder: Path, camera) -> float:
    """Seconds from the video to the finished recording."""
    start = time.perf_counter()
    output = folder / "tip.mcap"
    found = track_to_file(path, blind(camera), REST, output, None, 0.0)
    found.record.remove()
    took = time.perf_counter() - start
    output.unlink()
    return took


def main() -> int:
    """Print both times by codec, in turn, so that other work on the machine hits both; 1 when a ratio is over 1.15."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 8.0
    camera = SETUPS["end-on, 25 deg aside"]
    slow = False
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        warm = painted(folder / "warm.mp4", camera, snaps(1), 0.4)
        track_s(warm, folder, camera)  # compiled code loads once
        for codec in ("libx264", "libx265"):
            # "veryfast" codes as cameras do (CABAC, deblocking); "ultrafast" decodes three times faster than a GoPro's
            path = painted(folder / f"{codec}.mp4", camera, snaps(30), seconds, codec=codec, preset=PRESET[codec])
            frames, pairs = round(seconds * 240_000 / 1001), []
            for _ in range(3):
                before_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
                pairs.append((decode_s(path), track_s(path, folder, camera)))
            decode, track = (min(values) for values in zip(*pairs, strict=True))
            slow = slow or track > 1.15 * decode
            megabits = path.stat().st_size * 8e-6 / seconds
            grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - before_mb
            print(
                f"{codec} {megabits:.0f} Mbit/s, {frames} frames: decode {1e3 * decode / frames:.2f} ms a frame, "
                f"track {1e3 * track / frames:.2f} ms a frame ({frames / track:.0f} frames/s), "
                f"ratio {track / decode:.3f} (all: {', '.join(f'{t / d:.3f}' for d, t in pairs)}), "
                f"peak memory grew by {grown:.0f} MB in the last of three"
            )
    return int(slow)


if __name__ == "__main__":
    sys.exit(main())
