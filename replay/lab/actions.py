"""Actions: what a page of the lab may change, by name; each is a function of the lab and the request."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from straw.replay.lab.protocols import drawn
from straw.rig.catalogue import latest_tracks
from straw.rig.errors import RigError
from straw.rig.recover import recover

if TYPE_CHECKING:
    from straw.replay.lab.app import Lab


def _queue(lab: Lab, asked: dict[str, Any]) -> Any:
    lab.bench.control.check(str(asked["who"]))
    queue, do = lab.bench.queue, asked["do"]
    if do == "add":
        if lab.bench.rig is not None:
            drawn(str(asked["toml"]), lab.bench.rig.limits)
        repeats, pause_s = int(asked.get("repeats", 1)), float(asked.get("pause_s", 0.0))
        by_hand = bool(asked.get("by_hand", False))
        queue.add(str(asked["toml"]), str(asked.get("specimen", "")).strip(), repeats, pause_s, by_hand)
    elif do == "remove":
        queue.remove(str(asked["id"]))
    elif do == "move":
        queue.move(str(asked["id"]), int(asked["by"]))
    elif do == "hold":
        queue.hold("held by hand")
    else:
        raise RigError(f"the queue cannot {do}")
    return queue.as_data()


def _control(lab: Lab, asked: dict[str, Any]) -> Any:
    control, who = lab.bench.control, str(asked["who"])
    if asked["do"] == "take":
        control.take(who)
    else:
        control.give(who, keep=asked["do"] == "keep")
    return control.as_data(who)


def _say(lab: Lab, asked: dict[str, Any]) -> Any:
    more = {"instead_of": int(asked["instead_of"])} if "instead_of" in asked else {}
    changed = []
    for name in asked["names"]:
        entry = lab.library.say(str(name), str(asked["kind"]), str(asked["text"]), **more)
        changed.append({"name": entry.name, "tags": entry.tags, "marks": entry.marks})
    return changed


def _recover(lab: Lab, asked: dict[str, Any]) -> Any:
    entry = lab.library.entry(str(asked["name"]))
    done = recover(lab.library.path(entry))
    lab.library.look()
    return {"path": done.path.relative_to(lab.library.folder).as_posix(), "lost": list(done.lost)}


def _job(lab: Lab, asked: dict[str, Any]) -> Any:
    """Replay, diagnose or identify chosen runs, with their tracks, as the command of that name does."""
    kind = str(asked["kind"])
    entries = [lab.library.entry(str(name)) for name in asked["names"]]
    latest = latest_tracks(lab.library.entries)
    chosen = {e.parent for e in entries if e.kind == "track"}  # a track that was selected with its run is used for it
    tracks = [latest[e.sha256] for e in entries if e.sha256 in latest and e.sha256 not in chosen]
    if not entries or kind not in JOBS:
        raise RigError(f"{kind} of {len(entries)} recordings: choose some, and one of {', '.join(JOBS)}")
    paths = [str(lab.library.path(e)) for e in (*entries, *tracks)]
    words, options, made = JOBS[kind]
    straw = lab.bench.rig.straw if lab.bench.rig else None
    command = [*words, *paths, *options, *(["--straw", str(straw)] if straw else [])]
    names = ", ".join(e.run_id or e.name for e in entries[:3]) + (
        f" and {len(entries) - 3} more" if len(entries) > 3 else ""
    )
    inputs = {e.name: e.sha256 for e in (*entries, *tracks)}
    return lab.working().start(f"{kind} of {names}", command, made, inputs).as_data()


def _investigate(lab: Lab, asked: dict[str, Any]) -> Any:
    """Start a closed loop, answer it, or stop it."""
    do, who = asked["do"], str(asked["who"])
    if do == "start":
        return lab.loops.start(who, asked)
    if do == "answer":
        return lab.loops.answer(who, str(asked["log"]), asked["yes"] is True)
    if do == "stop":
        return lab.loops.stop(str(asked["log"]))
    raise RigError(f"a loop cannot {do}")


#: Kinds of job: words of the command, its outputs, the one to show.
JOBS: dict[str, tuple[list[str], list[str], str]] = {
    "replay": (["replay"], ["--report", "{folder}/replay.html", "--json", "{folder}/replay.json"], "replay.html"),
    "diagnose": (
        ["diagnose"],
        ["--report", "{folder}/diagnosis.html", "--json", "{folder}/findings.json"],
        "diagnosis.html",
    ),
    "identify": (["identify", "runs"], ["--each", "--json", "{folder}/findings.json"], ""),
}
ACTIONS: dict[str, Callable[[Lab, dict[str, Any]], Any]] = {
    "vent": lambda lab, asked: lab.bench.vent(str(asked.get("name", "") or "somebody")),
    "order": lambda lab, asked: {"state": lab.bench.order(str(asked["who"]), str(asked["do"]))},
    "arm": lambda lab, asked: {"armed": lab.bench.arm(str(asked["who"]), bool(asked["on"]))},
    "start": lambda lab, asked: {"started": lab.bench.start(str(asked["who"]))},
    "queue": _queue,
    "control": _control,
    "protocol": lambda lab, asked: drawn(str(asked["toml"]), lab.bench.rig.limits if lab.bench.rig else None),
    "predict": lambda lab, asked: lab.predict(str(asked["toml"])),
    "say": _say,
    "recover": _recover,
    "job": _job,
    "investigate": _investigate,
    "stopjob": lambda lab, asked: lab.working().stop(str(asked["id"])),
}
