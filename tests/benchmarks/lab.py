"""The lab with many recordings, 1 % of them damaged: time to the first picture, to filter and to sort, and memory.

``python -m tests.benchmarks.lab [--runs 1000] [--pictures DIR]`` makes recordings in a temporary folder (or takes those
of ``--folder``), opens the lab on them as ``straw lab`` does, and a Chromium on that.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from straw.rig.notes import say
from straw.rig.run_write import RunWriter
from tests.replay.driven import Browser, Tab

ZERO_NS = 1_795_000_000_000_000_000
READY = "document.documentElement.dataset.ready"
VIEWS = (
    {"where": "specimen = straw-3 and cycle > 20"},
    {"where": "fold not damaged"},
    {"where": "rate_hz = 100 or tag = good", "sort": "specimen"},
    {"sort": "-duration"},
    {"sort": "highest", "group": "specimen"},
    {"where": "day > 2026-11-20", "differs": "1"},
)


def recorded(folder: Path, count: int) -> None:
    """Recordings of a second each, every hundredth cut or corrupted."""
    for number in range(count):
        zero_ns = ZERO_NS + number * 600 * 10**9
        path = folder / f"run-{number:05d}.mcap"
        about = {
            "run_id": path.stem,
            "specimen": f"straw-{number % 9}",
            "protocol": ("fold-25kPa", "deploy-35kPa", "excite")[number % 3],
            "initial_deployed": "1,4",
            "cycle": str(number // 9),
            "cells": "9",
            "rate_hz": "100",
            "exit_status": "success",
            "zero_time_ns": str(zero_ns),
        }
        with RunWriter(path, about) as writer:
            for k in range(30):
                pa = -1000.0 * (number % 30) * (k > 8)
                writer.add("/pressure/measured", zero_ns + k * 33_000_000, pressure_pa=pa, sigma_pa=30.0, channel=1)
        if number % 100 == 50:
            data = path.read_bytes()
            path.write_bytes(data[: len(data) // 2] if number % 200 == 50 else b"nothing" + data[7:])
        if number % 10 == 0:
            say(path, "tag", "good")


def main() -> None:
    """Print every figure."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--runs", type=int, default=1000)
    asked.add_argument("--folder", type=Path)
    asked.add_argument("--pictures", type=Path)
    args = asked.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = args.folder or Path(scratch) / "recordings"
        if not folder.exists():
            folder.mkdir(parents=True)
            recorded(folder, args.runs)
        with Browser(Path(scratch)) as browser:
            measured(folder, browser, args.pictures)


def measured(folder: Path, browser: Browser, pictures: Path | None) -> None:
    """Open the lab twice: without an index, and with the one it wrote."""
    for turn in ("no index", "with index"):
        command = [sys.executable, "-m", "straw.replay.cli", "lab", str(folder), "--emulate", "--no-browser"]
        began_s = time.monotonic()
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True) as lab:
            assert lab.stdout is not None
            url = re.search(r"http://\S+", lab.stdout.readline())
            assert url
            said_s = time.monotonic() - began_s
            tab = browser.tab(url[0])
            tab.until(READY)
            first_ms = float(tab.js(READY))
            print(f"{turn}: address after {said_s:.2f} s; first picture {first_ms:.0f} ms after the page was asked for")
            known = "fetch('/api/runs').then((a) => a.json()).then((d) => (d.reading ? 0 : d.of))"
            while not (total := tab.js(known)):
                time.sleep(0.5)
            print(f"{turn}: all {total} recordings known after {time.monotonic() - began_s:.1f} s")
            if turn == "with index":
                server = json.loads((folder / ".straw-lab" / "lab.json").read_text())["pid"]
                views(tab, total, server)
                memory(server)
                if pictures:
                    tab.js("location.href = '/?group=specimen&sort=-start'")
                    time.sleep(1)
                    tab.picture(pictures / "many.png")
            lab.terminate()


def cpu_ms(process: int) -> float:
    """CPU time of a process, which is independent of other load."""
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return 1e3 * (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def views(tab: Tab, total: int, server: int) -> None:
    """Each view as the page requests it, until it is drawn."""
    for view in VIEWS:
        times, before_ms = [], cpu_ms(server)
        for turn in range(7):
            fresh = {**view, "where": f"{view.get('where', '')}{' ' * turn}"}  # not the cached one
            script = f"""(async () => {{
                Object.assign(look, {{where: '', sort: '', group: '', differs: ''}}, {fresh!r});
                const t = performance.now(); await load(false); return performance.now() - t; }})()"""
            times.append(float(tab.js(script)))
        used_ms = (cpu_ms(server) - before_ms) / len(times)
        said = f"{statistics.median(times):.0f} ms, worst {max(times):.0f} ms; server {used_ms:.0f} ms of processor"
        print(f"{total} recordings, {view}: {said}")


def memory(server: int) -> None:
    """Resident memory of the server."""
    lines = Path(f"/proc/{server}/status").read_text().splitlines()
    megabytes = {key: int(line.split()[1]) / 1e3 for line in lines for key in ("VmRSS", "VmHWM") if key in line}
    print(f"server: {megabytes['VmRSS']:.0f} MB, at most {megabytes['VmHWM']:.0f} MB")


if __name__ == "__main__":
    main()
