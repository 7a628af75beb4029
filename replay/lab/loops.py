"""Loops: `straw investigate` as the lab's pages show, start, answer and stop it; each is a process of its own.

Everything comes from the log, which only grows, and from the process' pulse: a loop started at a terminal is shown
here, one started here can be answered at a terminal, and a restarted lab finds both.
"""

from __future__ import annotations

import math
import subprocess
from dataclasses import asdict
from pathlib import Path
from typing import Any

from straw.replay.investigate.ask import answer
from straw.replay.investigate.log import Line, log_of, read_lines
from straw.replay.investigate.pulse import read_pulse
from straw.replay.investigate.state import State
from straw.replay.investigate.stop import REASONS
from straw.replay.lab.bench import Bench
from straw.replay.lab.library import Library
from straw.replay.lab.processes import interrupt, started
from straw.rig.errors import RigError

LOGS = "investigate-*.jsonl"
#: Hypotheses of a posterior that are shown singly; the rest is summed up.
SHOWN = 7
#: Options of a start with the type and the default of each.
NUMBERS: dict[str, type] = {"certainty": float, "rounds": int, "minutes": float, "snaps": int, "yes": int}


class Loops:
    """The closed loops of one folder."""

    def __init__(self, library: Library, bench: Bench) -> None:
        self.folder, self.library, self.bench = library.folder, library, bench
        self._started: dict[str, tuple[subprocess.Popen[bytes], Path]] = {}

    def all(self) -> dict[str, Any]:
        """Every log there is, newest last, and which specimens have runs."""
        paths = sorted(self.folder.glob(LOGS), key=lambda path: path.stat().st_mtime)
        specimens = sorted({e.specimen for e in self.library.entries if e.specimen and e.kind == "run"})
        return {"logs": [self._summary(path) for path in paths], "specimens": specimens}

    def one(self, name: str) -> dict[str, Any]:
        """The data of one loop's page."""
        path = self._path(name)
        lines = read_lines(path)[0] if path.exists() else []
        state, pulse = State.of(lines), read_pulse(path.with_suffix(""))
        asked = pulse.get("asked") if pulse else None
        stops = [line for line in lines if line["kind"] == "stopped"]
        ended = stops[-1] if stops and lines[-1] is stops[-1] else None
        began = next((line for line in reversed(lines) if line["kind"] == "began"), {})
        return {
            "name": name,
            "specimen": began.get("specimen", ""),
            "asked_for": {key: began.get(key) for key in NUMBERS},
            "pulse": pulse,
            "waits": bool(asked),
            "stopped": ended and {**ended, "means": REASONS.get(str(ended["reason"]), "")},
            "cut": bool(lines) and ended is None and pulse is None,
            "complaint": "" if pulse else self._complaint(name),
            "spent": asdict(state.spent),
            "next": _next(lines, state),
            "rounds": _rounds(lines, path.with_suffix("")),
            "log": [[line.get("time", ""), line["kind"], _said(line)] for line in lines[-200:]],
        }

    def page(self, name: str, page: str) -> Path:
        """A page of findings of one round; RigError where there is none."""
        path = self._path(name).with_suffix("") / Path(page).name
        if path.suffix != ".html" or not path.is_file():
            raise RigError(f"there is no page {page!r} of {name}")
        return path

    def start(self, who: str, asked: dict[str, Any]) -> dict[str, Any]:
        """Start or continue the loop of a specimen; return the name of its log."""
        person = self.bench.control.check(who)
        if not self.bench.ready:
            raise RigError("there is no rig: start the lab with --rig rig.toml, or with --emulate")
        specimen = " ".join(str(asked.get("specimen", "")).split())
        if not specimen:
            raise RigError("say which specimen is investigated")
        log = log_of(self.folder, specimen)
        if read_pulse(log.with_suffix("")):
            raise RigError(f"{log.name} is running already")
        rig = self.bench.rig
        command = ["investigate", str(self.folder), "--wait", f"--specimen={specimen}"]
        command += [f"--operator={person}", *_numbers(asked)]
        command += [f"--tolerance={asked['tolerance']}"] if asked.get("tolerance") else []
        command += ["--rig", str(rig.path)] if rig else []
        command += ["--emulate", *(["--fast"] if asked.get("fast") else [])] if self.bench.emulated else []
        out = (self.bench.state or self.folder) / f"{log.stem}.log"
        try:
            stream = out.open("wb")
        except OSError as error:
            raise RigError(f"{out} cannot be written: {error.strerror}; nothing was started") from None
        with stream:
            process = started(command, stream)
        self._started[log.name] = process, out
        return {"log": log.name}

    def answer(self, who: str, name: str, yes: bool) -> dict[str, Any]:
        """Answer yes, which needs control of a free rig, or no, which everybody may."""
        if yes:
            self.bench.control.check(who)
            if self.bench.busy:
                raise RigError("the rig is busy: a run or the queue is in progress; hold or end it first")
        return {"says": answer(self._path(name).with_suffix(""), yes, self.bench.control.name(who))}

    def stop(self, name: str) -> dict[str, Any]:
        """As Ctrl-C: a run is vented and recorded first, and the same start continues later. Everybody may."""
        pulse = read_pulse(self._path(name).with_suffix(""))
        if pulse is None:
            raise RigError(f"{name} is not running")
        interrupt(int(pulse["pid"]))
        return {"says": f"{name} was told to end"}

    def _path(self, name: str) -> Path:
        known = {path.name for path in self.folder.glob(LOGS)} | set(self._started)
        if name not in known:
            raise RigError(f"{name!r} is no log of straw investigate in {self.folder}")
        return self.folder / name

    def _summary(self, path: Path) -> dict[str, Any]:
        lines = read_lines(path)[0]
        last = lines[-1] if lines else {}
        reason = str(last.get("reason", "")) if last.get("kind") == "stopped" else ""
        alive = read_pulse(path.with_suffix("")) is not None
        return {"name": path.name, "alive": alive, "reason": reason, "rounds": State.of(lines).spent.rounds}

    def _complaint(self, name: str) -> str:
        """The last line of a process that was started here and failed."""
        process, out = self._started.get(name, (None, None))
        if process is None or out is None or process.poll() in (None, 0, 1):
            return ""
        try:
            said = out.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        except OSError:
            said = []
        return said[-1] if said else f"it ended with code {process.returncode}"


def _numbers(asked: dict[str, Any]) -> list[str]:
    """Options of a start; RigError for what is no number."""
    out = []
    for key, kind in NUMBERS.items():
        if asked.get(key) in (None, ""):
            continue
        try:
            value = kind(asked[key])
        except (TypeError, ValueError):
            raise RigError(f"{key} = {asked[key]!r}: expected a number") from None
        if not math.isfinite(value):
            raise RigError(f"{key} = {value}: expected a number")
        out.append(f"--{key}={value}")
    return out


def _next(lines: list[Line], state: State) -> dict[str, Any] | None:
    """The proposal that was not run yet, with its curves as a page draws them."""
    if state.proposal is None or state.plan is None or state.recording:
        return None
    runs = next((line.get("runs", 1) for line in reversed(lines) if line["kind"] == "proposed"), 1)
    predicted = state.plan.predicted or {}
    units = {"pressure": ("pressure_pa", 1e-3, "kPa"), "X": ("x_m", 1e3, "mm"), "Z": ("z_m", 1e3, "mm")}
    units["Phi"] = ("phi_rad", 180 / math.pi, "deg")
    signals = {
        name: {
            "time_s": list(predicted["time_s"]),
            "values": [round(v * factor, 5) for v in predicted[key]],
            "unit": unit,
        }
        for name, (key, factor, unit) in units.items()
        if key in predicted
    }
    plan = {key: value for key, value in asdict(state.plan).items() if key != "predicted"}
    return {**asdict(state.proposal), "plan": plan, "runs": runs, "round": state.number, "signals": signals}


def _rounds(lines: list[Line], place: Path) -> list[dict[str, Any]]:
    """Each diagnosis with its posterior, and the proposal, answer and run that followed."""
    rows: list[dict[str, Any]] = []
    for line in lines:
        kind = line["kind"]
        if kind == "diagnosed":
            if rows and "ran" not in rows[-1] and rows[-1]["recordings"] == line.get("recordings"):
                rows.pop()  # the same again, by a process that continued
            rows.append({**_posterior(line), "recordings": line.get("recordings")})
        elif rows and kind == "proposed":
            rows[-1]["proposed"] = {key: line["proposal"].get(key) for key in ("why", "information_nats", "run_before")}
        elif rows and kind == "answered":
            rows[-1]["who"] = line.get("who") or "nobody"
        elif rows and kind == "ran":
            rows[-1]["ran"] = {key: line.get(key) for key in ("recording", "status", "minutes", "snaps", "reason")}
    pages = sorted(path.name for path in place.glob("after-*-runs.html")) if place.is_dir() else []
    for row, page in zip([row for row in rows if row["probability"]][::-1], pages[::-1], strict=False):
        row["page"] = page
    return [{key: value for key, value in row.items() if key != "recordings"} for row in rows]


def _posterior(line: Line) -> dict[str, Any]:
    """Verdict, words, and [hypothesis, probability], largest first, the sum of the rest last."""
    probability = sorted((line.get("probability") or {}).items(), key=lambda row: -row[1])
    rest = sum(p for _, p in probability[SHOWN:])
    shown = [[name, round(p, 4)] for name, p in probability[:SHOWN]]
    return {
        "round": line.get("round"),
        "verdict": line.get("verdict"),
        "causes": line.get("causes") or [],
        "says": line.get("says", ""),
        "probability": [*shown, *([[f"{len(probability) - SHOWN} others", round(rest, 4)]] if rest > 0 else [])],
    }


def _said(line: Line) -> str:
    """A line of the log in words."""
    if line["kind"] == "proposed":
        return str(line["proposal"].get("why", ""))
    if line["kind"] == "answered":
        return f"{line.get('who') or 'nobody'}: {'yes' if line.get('yes') else 'no'}"
    if line["kind"] == "began":
        return ", ".join(f"{key} {line[key]}" for key in NUMBERS if line.get(key))
    keys = ("reason", "status", "recording", "says", "verdict_before")
    return "; ".join(str(line[key]) for key in keys if line.get(key))
