"""straw lab: opens the lab in a browser, and stays at the terminal, where V vents independently of the server."""

from __future__ import annotations

import argparse
import getpass
import importlib.util
import json
import subprocess
import sys
import webbrowser
from pathlib import Path
from typing import Any

from straw.replay.errors import ReplayError
from straw.rig.errors import RigError
from straw.rig.orders import SUFFIX, send_order


def run(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C; a run in progress then continues by itself."""
    if importlib.util.find_spec("uvicorn") is None:
        raise ReplayError("the lab needs the web server's packages; install them with: pip install 'straw[lab]'")
    folder = folder_of(args)
    if not folder.is_dir():
        raise ReplayError(f"{folder} is not a folder; name the one that holds the recordings")
    from straw.replay.lab.alone import check_alone

    there = check_alone(folder)
    if there:
        print(f"the lab of {folder} is open already: {there}")
        return show(there, args)
    task = {
        "folder": str(folder),
        "rig": str(args.rig.resolve()) if args.rig else "",
        "emulate": args.emulate,
        "address": args.listen,
        "remote": args.remote,
    }
    server = subprocess.Popen(
        [sys.executable, "-P", "-m", "straw.replay.lab.server"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert server.stdin is not None
    assert server.stdout is not None
    server.stdin.write(json.dumps(task) + "\n")
    server.stdin.flush()
    said = json.loads(server.stdout.readline() or '{"error": "its server ended at once"}')
    if "error" in said:
        server.communicate()
        raise ReplayError(f"the lab of {folder}: {said['error']}")
    tell(folder, said)
    show(said["url"], args)
    try:
        attend(folder, server)
    except KeyboardInterrupt:
        pass
    finally:
        server.stdin.close()
        leave(folder, server)
        server.stdout.close()
    return 0


def folder_of(args: argparse.Namespace) -> Path:
    """The folder that is named, the rig file's, or the current one."""
    if args.folder:
        return Path(args.folder).resolve()
    if args.rig:
        from straw.rig.rig_file import load_rig

        return load_rig(args.rig).folder
    return Path().resolve()


def tell(folder: Path, said: dict[str, Any]) -> None:
    """Print the address and warnings."""
    print(f"the lab of {folder}: {said['url']}", flush=True)
    if said["remote"]:
        print("other machines can reach it: whoever has this address controls the rig", flush=True)
    if not said["writable"]:
        print(f"{folder} cannot be written: notes, runs and results cannot be stored", flush=True)
    print(
        "at this terminal V and Enter vent; Ctrl-C ends the lab, and a run in progress continues by itself", flush=True
    )


def show(url: str, args: argparse.Namespace) -> int:
    """Open the browser, if wanted."""
    if not args.no_browser:
        webbrowser.open(url)
    return 0


def attend(folder: Path, server: subprocess.Popen[str]) -> None:
    """Wait for V at the terminal; where there is none, for the server's end."""
    if not sys.stdin or not sys.stdin.isatty():
        server.wait()
        return
    for line in sys.stdin:
        if line.strip().lower() in ("v", "vent"):
            vent_all(folder)
        if server.poll() is not None:
            break
    server.wait()


def vent_all(folder: Path) -> int:
    """Vent every run of the folder from here, without the server; return how many obeyed."""
    vented = 0
    for control in sorted(folder.rglob(f"*{SUFFIX}")):
        try:
            print(f"{control.name}: {send_order(control, 'vent', f'{getpass.getuser()} at the terminal', 1.0)}")
            vented += 1
        except RigError as error:
            print(error)
    if not vented:
        print("no run is in progress here")
    return vented


def leave(folder: Path, server: subprocess.Popen[str]) -> None:
    """End the server; print which runs continue without it."""
    try:
        server.wait(timeout=5)
    except subprocess.TimeoutExpired:
        server.kill()
        server.wait()
    for control in sorted(folder.rglob(f"*{SUFFIX}")):
        try:
            state = send_order(control, "state")
            name = control.name.removesuffix(SUFFIX)
            print(f"{name} is {state} and continues; straw rig tell vent --dir {folder} vents it")
        except RigError:
            continue
