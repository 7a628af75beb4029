"""The lab's server: ``python -m straw.replay.lab.server`` reads its task from stdin and serves until that ends."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

from straw.replay.errors import USER_ERRORS
from straw.replay.lab.alone import LAB_FILE, STATE
from straw.replay.lab.app import Lab
from straw.replay.lab.bench import Bench
from straw.replay.lab.guard import Door
from straw.replay.lab.library import Library
from straw.replay.lab.serve import Server, bound
from straw.replay.lab.work import Jobs
from straw.rig.rig_file import load_rig

PRIVATE = 0o700


def make(task: dict[str, Any]) -> tuple[Server, Door, Lab]:
    """Everything of one lab, bound to its address; ReplayError or RigError where that cannot be."""
    folder = Path(task["folder"]).resolve()
    rig = load_rig(task["rig"]) if task["rig"] else None
    listener, host, port = bound(task["address"], elsewhere=task["remote"])
    door = Door(host, port)
    state = state_folder(folder)
    library = Library(folder)
    bench = Bench(library, rig, task["emulate"], state, host)
    straw = rig.straw.read_text(encoding="utf-8") if rig and rig.straw else ""
    lab = Lab(library, bench, Jobs(state / "work") if state else None, straw=straw)
    if state:
        said = {"pid": os.getpid(), "url": door.url, "folder": str(folder)}
        with suppress(OSError):
            path = state / LAB_FILE
            path.touch(0o600)
            path.write_text(json.dumps(said), encoding="utf-8")
    return Server(lambda: lab.application(door), listener), door, lab


def state_folder(folder: Path) -> Path | None:
    """The folder of a lab's own files; None where the recordings' folder cannot be written."""
    state = folder / STATE
    try:
        state.mkdir(mode=PRIVATE, exist_ok=True)
        probe = state / f"probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError:
        return None
    return state


def main() -> None:
    """Serve until stdin ends or says so; runs in progress continue."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is handled by the parent process
    try:
        server, door, lab = make(json.loads(sys.stdin.readline()))
    except (*USER_ERRORS, OSError) as error:
        print(json.dumps({"error": str(error)}), flush=True)
        return
    lab.library.open()
    lab.bench.open()
    writable = lab.jobs is not None
    print(json.dumps({"url": door.url, "remote": door.remote, "writable": writable}), flush=True)

    def wait() -> None:
        sys.stdin.read()
        server.stop()

    threading.Thread(target=wait, daemon=True).start()
    try:
        server.run()
    finally:
        lab.bench.close()
        lab.library.close()
        lab.predictor.close()
        if lab.bench.state:
            with suppress(OSError):
                (lab.bench.state / LAB_FILE).unlink()
    os._exit(0)  # threads that wait for a file or a process have nothing to save


if __name__ == "__main__":
    main()
