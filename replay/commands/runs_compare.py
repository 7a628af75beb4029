"""straw runs compare: two recordings side by side: what was set up differently, and how far their signals differ."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from straw.replay.compare.gather import read_whole
from straw.replay.compare.series import Series, differ, tip_series
from straw.replay.errors import ReplayError
from straw.replay.output import write_json
from straw.rig.catalogue import family, find
from straw.rig.run import Run
from straw.rig.run_read import read_run

#: Keys that differ between any two runs and are left out.
OWN = ("run_id", "zero_time_ns", "cycles", "port", "missed_readings", "parent_sha256")
SHOWN = {"Pa": (1e-3, "kPa"), "m": (1e3, "mm"), "rad": (1e3, "mrad")}


def compare_runs(args: argparse.Namespace) -> int:
    """Print both tables; times count from each run's own zero."""
    a, b = (read_whole(find(args.dir, name)) for name in args.runs)
    settings = {
        key: (a.metadata.get(key, "-"), b.metadata.get(key, "-"))
        for key in sorted({*a.metadata, *b.metadata} - set(OWN))
        if a.metadata.get(key) != b.metadata.get(key)
    }
    settings |= {
        f"software {key}": (a.software.get(key, "-"), b.software.get(key, "-"))
        for key in sorted({*a.software, *b.software})
        if a.software.get(key) != b.software.get(key)
    }
    left, right = series_of(a, args.dir), series_of(b, args.dir)
    signals = {name: differ(left[name], right[name], name) for name in left if name in right}
    if not signals:
        raise ReplayError(f"{a.path} and {b.path} have no signal in common; compare runs, or tracks of runs")
    if args.json:
        data = {"settings": {key: list(pair) for key, pair in settings.items()}}
        write_json(args.json, data | {"signals": {name: asdict(metrics) for name, metrics in signals.items()}})
    print(f"a  {a.path}\nb  {b.path}\n")
    for key, (x, y) in settings.items():
        print(f"{key:<22} {_short(x)} | {_short(y)}")
    print("settings are the same" if not settings else "")
    print(f"{'b - a':<10}{'samples':>9}{'bias':>10}{'rms':>10}{'largest':>10}   at")
    for name, m in signals.items():
        scale, unit = SHOWN[left[name].unit]
        print(
            f"{name:<10}{m.n:>9}{m.bias * scale:>10.3f}{m.rmse * scale:>10.3f}{m.max_abs * scale:>10.3f}   "
            f"{m.max_at_s:.3f} s   {unit}"
        )
    return 0


def series_of(run: Run, folder: Path) -> dict[str, Series]:
    """Signals of a recording, with the tip of its track where one lies beside it."""
    found = {}
    for name, log in (("command", run.command), ("pressure", run.pressure)):
        if log is not None:
            found[name] = Series(log.time_s, log.pressure_pa, log.sigma_pa, "Pa")
    tip, shift_s = run.tip, 0.0
    if tip is None:
        tracks = [track for track in map(read_run, family(run.path, folder)) if track.tip is not None]
        if tracks:
            tip, shift_s = tracks[0].tip, (tracks[0].zero_time_ns - run.zero_time_ns) * 1e-9
    if tip is not None:
        found |= tip_series(tip, shift_s)
    return found


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 48 else text[:45] + "..."
