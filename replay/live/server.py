"""Serves the page of a running rig: the report's own page, fed 30 times a second; ``python -m replay.live.server``."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from model.parameters import StrawParameters, straw_from_toml
from replay.errors import USER_ERRORS, ReplayError
from replay.live.feed import READING
from replay.live.follow import Follower
from replay.report.data import SHOWN, straw_data
from replay.report.page import SCRIPTS, assemble
from rig.protocol import PressureProtocol
from rig.protocol_toml import protocol_from_toml

UPDATES_HZ = 30.0
#: After the run's end the page is served for so long, for what is on its way to get there.
LINGER_S = 0.5


def page_of(straw: StrawParameters, protocol: PressureProtocol) -> str:
    """The report's page with an empty run in it, which fills as the run goes on."""
    signals = {
        name: {"title": title, "unit": unit, "factor": factor, "known": False, "metrics": None}
        for name, (title, unit, factor) in SHOWN.items()
    }
    run: dict[str, Any] = {
        "live": True, "id": protocol.name, "role": "running", "specimen": protocol.specimen, "cycle": protocol.cycle,
        "deployed": ",".join(map(str, protocol.initial_deployed)) or "none", "file": "", "sha": "", "lost": [],
        "events": [], "snaps": [], "snapping": [], "pairs": [], "signals": signals, "straw": straw_data(straw),
        "toml": straw.to_toml(), "duration": protocol.duration_s, "zero": protocol.zero_s,
    }  # fmt: skip
    says = "Running: the model under the pressure as it is measured."
    return assemble(protocol.name, says, [run], "live", (*SCRIPTS, "live"))


class PageServer(ThreadingHTTPServer):
    """The page at / and its feed at /events; loopback only, unless bound elsewhere on purpose."""

    daemon_threads = True

    def __init__(self, address: tuple[str, int], page: str, follower: Follower) -> None:
        self.page, self.follower = page.encode(), follower
        super().__init__(address, _Handler)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Who went away while being answered is no error."""


class _Handler(BaseHTTPRequestHandler):
    server: PageServer

    def do_GET(self) -> None:
        """The page, or its feed."""
        if self.path == "/":
            self._head("text/html; charset=utf-8", str(len(self.server.page)))
            self.wfile.write(self.server.page)
        elif self.path == "/events":
            self._head("text/event-stream")
            self._feed()
        else:
            self.send_error(404)

    def _head(self, kind: str, length: str = "") -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        if length:
            self.send_header("Content-Length", length)
        self.end_headers()

    def _feed(self) -> None:
        """Every row from the run's start, new ones 30 times a second, then the end."""
        follower, sent, due_s = self.server.follower, 0, time.monotonic()
        while True:
            ended, rows = follower.ended.is_set(), follower.rows[sent:]
            sent += len(rows)
            if rows:
                self.wfile.write(f"data: {json.dumps(rows)}\n\n".encode())
            if ended and sent == len(follower.rows):
                self.wfile.write(b"event: end\ndata: 0\n\n")
                return
            due_s = max(due_s + 1 / UPDATES_HZ, time.monotonic())
            time.sleep(due_s - time.monotonic() if due_s > time.monotonic() else 0)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002  # the base class calls it so
        """Nothing: the rig's terminal is for the rig."""


def serve(task: dict[str, str]) -> tuple[PageServer, socket.socket]:
    """Make the page, bind its address and the feed's; ReplayError where the address cannot be had."""
    host, _, port = task["address"].rpartition(":")
    straw = straw_from_toml(task["straw"])
    protocol = protocol_from_toml(task["protocol"], task["name"])
    follower = Follower(straw, protocol)
    follower.stepper.advance(1e-6, 0.0, 0.0)  # compiles, before the run begins
    feed = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    feed.bind(("127.0.0.1", 0))
    try:
        return PageServer((host, int(port)), page_of(straw, protocol), follower), feed
    except (OSError, ValueError, OverflowError) as error:
        raise ReplayError(f"{task['address']} cannot be listened at: {error}; give HOST:PORT of this machine") from None


def main() -> None:
    """Serve until stdin ends, which is when the run's process has done with it or is no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the run's to answer; this ends with it
    if hasattr(os, "nice"):
        os.nice(5)  # whoever drives a rig goes first
    try:
        server, feed = serve(json.loads(sys.stdin.readline()))
    except USER_ERRORS as error:
        print(json.dumps({"error": str(error)}), flush=True)
        return
    host, port = server.server_address[:2]
    print(json.dumps({"url": f"http://{host!s}:{port}/", "port": feed.getsockname()[1]}), flush=True)
    threading.Thread(target=_take, args=(feed, server.follower), daemon=True).start()
    threading.Thread(target=server.serve_forever, daemon=True).start()
    sys.stdin.read()
    server.follower.ended.set()
    time.sleep(LINGER_S)


def _take(feed: socket.socket, follower: Follower) -> None:
    while not follower.ended.is_set():
        try:
            follower.reading(*READING.unpack(feed.recv(READING.size)))
        except USER_ERRORS:  # the model cannot follow: the page stands still, the rig goes on
            follower.ended.set()


if __name__ == "__main__":
    main()
