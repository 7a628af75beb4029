"""Wall time of straw track against decoding alone, in one run: python -m tests.benchmarks.tracking_speed.

The first search for the board and a clip's constants take some 0.3 s however long it is; with `--times 5` the painted
clip is tracked five times over as one file, without being encoded again.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

import av
import numpy as np

from straw.replay.film.track import track_to_file
from straw.tracking.video import VideoReader, ahead
from tests.benchmarks.figures import missed, publish, write_option
from tests.benchmarks.tracking_clips import REST, SETUPS, blind, painted, snaps

ROUNDS = 9  # a busy host changes a machine's speed by a tenth from one round to the next
PRESET = {"libx264": "veryfast", "libx265": "ultrafast"}


def decode(path: Path) -> None:
    """Decode every frame and do nothing with it."""
    with VideoReader(path) as video:
        for _ in ahead(video.frames()):
            pass


def track(path: Path, folder: Path, camera) -> None:
    """From the video to the finished recording."""
    output = folder / "tip.mcap"
    found = track_to_file(path, blind(camera), REST, output, None, 0.0)
    found.record.remove()
    output.unlink()


def joined(clip: Path, times: int) -> Path:
    """A file with the packets of a clip several times over."""
    path = clip.with_name(f"{clip.stem}-{times}.mp4")
    start = 0
    with av.open(str(path), "w") as file:
        for _ in range(times):
            with av.open(str(clip)) as part:
                stream = part.streams.video[0]
                if not file.streams.video:
                    file.add_stream_from_template(stream)
                packets = [packet for packet in part.demux(stream) if packet.dts is not None]
                for packet in packets:
                    packet.pts, packet.dts, packet.stream = (
                        packet.pts + start,
                        packet.dts + start,
                        file.streams.video[0],
                    )
                    file.mux(packet)
                start = max(packet.pts + packet.duration for packet in packets)
    return path


def cost(work, *args) -> np.ndarray:
    """Wall and CPU seconds of a call."""
    start, cpu = time.perf_counter(), time.process_time()
    work(*args)
    return np.array((time.perf_counter() - start, time.process_time() - cpu))


def main() -> int:
    """Print both times by codec, each track's beside the decoding before and after it; 1 if a median is over 1.15."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seconds", type=float, default=8.0)
    options.add_argument("--times", type=int, default=1, help="how often the clip is tracked as one file (1)")
    options.add_argument("--keep", type=Path, help="folder to keep the painted clips in")
    write_option(options)
    args = options.parse_args()
    if args.write and args.times > 1:
        sys.exit("--write states the figures of one clip: leave out --times")
    seconds, figures = args.seconds, {}
    camera = SETUPS["end-on, 25 deg aside"]
    slow = False
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        clips = args.keep or folder
        warm = painted(clips / "warm.mp4", camera, snaps(1), 0.4)
        track(warm, folder, camera)  # compiled code is loaded once
        for codec in PRESET:
            # "veryfast" codes as cameras do (CABAC, deblocking); "ultrafast" decodes three times faster than a GoPro's
            path = painted(clips / f"{codec}.mp4", camera, snaps(30), seconds, codec=codec, preset=PRESET[codec])
            path = joined(path, args.times) if args.times > 1 else path
            frames = round(seconds * 240_000 / 1001) * args.times
            megabits = path.stat().st_size * 8e-6 / seconds / args.times
            print(f"{codec} {megabits:.0f} Mbit/s, {frames} frames; a frame in ms (wall, CPU):")
            ratios, before = [], 1e3 * cost(decode, path) / frames
            for _ in range(ROUNDS):
                whole, after = 1e3 * cost(track, path, folder, camera) / frames, 1e3 * cost(decode, path) / frames
                alone = (before + after) / 2
                ratios.append(whole / alone)
                before = after
                print(
                    f"  decode {alone[0]:6.2f} {alone[1]:6.2f}   track {whole[0]:6.2f} {whole[1]:6.2f}"
                    f"   ratio {ratios[-1][0]:.3f} {ratios[-1][1]:.3f}   {1e3 / whole[0]:.0f} frames/s"
                )
            wall, cpu = np.median(ratios, axis=0)
            slow = slow or wall > 1.15
            walls = [float(ratio[0]) for ratio in ratios]
            figures[codec] = f"{missed(f'{wall:.2f}', wall <= 1.1)} ({min(walls):.2f} to {max(walls):.2f})"
            print(f"  median ratio {wall:.3f} (wall), {cpu:.3f} (CPU); peak memory {peak_mb():.0f} MB")
    publish("tracking_speed", figures, args.write)
    return int(slow)


def peak_mb() -> float:
    """Peak memory of this process."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    sys.exit(main())
