"""Effect of a live page on the control loop: jitter with and without it, alternating within one run.

The page's server, the model beside the run and a client that takes every update run throughout; the loop feeds them
in every other interval of two seconds. A period is the time between two readings by the controller's clock.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from straw.model.parameters import StrawParameters
from straw.replay.commands.rig_run import drive, emulation
from straw.replay.live.feed import Live
from straw.rig.guarded import GuardedController
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.reading import Reading
from straw.rig.run_read import read_run
from tests.benchmarks.figures import publish, write_option

TURN_S, RATE_HZ = 2.0, 100.0
PROTOCOL = """
name = "live"
pressure_unit = "kPa"
initial_deployed = [1, 4]
[[main]]
sine = {{ amplitude = 5, frequency_hz = 0.5 }}
for_s = {duration}
"""
#: Another process as client: counts updates and the seconds in which they came.
CLIENT = """
import json, sys, time
from websockets.sync.client import connect
n, first = 0, None
with connect(sys.argv[1].replace("http://", "ws://").replace("/?", "/feed?")) as feed:
    for text in feed:
        if json.loads(text).get("rows"):
            n, first, last = n + 1, first or time.monotonic(), time.monotonic()
print(n, last - first)
"""


class AlternatingFeed(Live):
    """A feed that is silent in every other interval."""

    def heard(self, now_s: float, readings: Sequence[Reading], told_pa: Mapping[int, float]) -> None:
        """Feed in even intervals."""
        if int(now_s / TURN_S) % 2 == 0:
            super().heard(now_s, readings, told_pa)


def main() -> None:
    """Print median, 99 % and largest deviation of the period, with and without, and the updates a second."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--seconds", type=float, default=40.0)
    write_option(asked)
    args = asked.parse_args()
    seconds, figures = args.seconds, {}
    straw, protocol = StrawParameters(), protocol_from_toml(PROTOCOL.format(duration=seconds), "live")
    with tempfile.TemporaryDirectory() as folder, AlternatingFeed(straw, protocol) as live:
        client = subprocess.Popen([sys.executable, "-c", CLIENT, live.url], stdout=subprocess.PIPE, text=True)
        path = Path(folder) / "run.mcap"
        with emulation(straw, protocol.initial_deployed, "ob1-mk4") as emulated:
            drive(GuardedController("ob1-mk4", emulated.url), protocol, path, straw.cells, RATE_HZ, live=live)
        live._send({"end": True})
        updates, over_s = client.communicate(timeout=20)[0].split()
        run = read_run(path)
    assert run.pressure is not None
    time_s = run.pressure.time_s
    period_s, turn = np.diff(time_s), (time_s[:-1] / TURN_S).astype(int)
    # not at the boundary of two intervals
    inside = np.abs(time_s[:-1] / TURN_S - np.round(time_s[:-1] / TURN_S)) > 0.05
    for name, which in (("with", turn % 2 == 0), ("without", turn % 2 == 1)):
        off_ms = 1e3 * np.abs(period_s[which & inside] - 1 / RATE_HZ)
        shown = ", ".join(f"{value:.3f}" for value in (np.median(off_ms), np.quantile(off_ms, 0.99), off_ms.max()))
        figures |= {f"{name}-median": f"{np.median(off_ms):.1f}", f"{name}-99": f"{np.quantile(off_ms, 0.99):.1f}"}
        print(f"{name:<8} {len(off_ms)} periods of 10 ms; off by (median, 99 %, largest) {shown} ms")
    print(f"{float(updates) / (float(over_s) / 2):.1f} updates a second while fed")
    publish("live", figures, args.write)


if __name__ == "__main__":
    main()
