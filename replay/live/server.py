"""Serves a running rig's page: the report's own, fed 30 times a second; ``python -m straw.replay.live.server``."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket, WebSocketDisconnect

from straw.model.parameters import StrawParameters
from straw.model.straw_file import straw_from_toml
from straw.replay.errors import USER_ERRORS
from straw.replay.lab.guard import Door, Guard
from straw.replay.lab.serve import Server, bound
from straw.replay.live.follow import Follower
from straw.replay.report.data import SHOWN, straw_data
from straw.replay.report.page import SCRIPTS, assemble
from straw.rig.errors import RigError
from straw.rig.orders import read_control, send_order
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import protocol_from_toml

UPDATES_HZ = 30.0
#: The page is served for so long after the run's end, so that the last data arrive.
LINGER_S = 0.5
LARGEST = 65536
#: Period of heartbeats to the page when there are no data, s.
BEAT_S = 0.5


def run_of(straw: StrawParameters, protocol: PressureProtocol, orders: bool) -> dict[str, Any]:
    """An empty run for the report's page, which fills during the run; ``orders``: with hold and stop."""
    signals = {
        name: {"title": title, "unit": unit, "factor": factor, "known": False, "metrics": None}
        for name, (title, unit, factor) in SHOWN.items()
    }
    return {
        "live": True, "id": protocol.name, "role": "running", "specimen": protocol.specimen, "cycle": protocol.cycle,
        "deployed": ",".join(map(str, protocol.initial_deployed)) or "none", "file": "", "sha": "", "lost": [],
        "events": [], "snaps": [], "snapping": [], "pairs": [], "signals": signals, "straw": straw_data(straw),
        "toml": straw.to_toml(), "duration": protocol.duration_s, "zero": protocol.zero_s, "orders": orders,
        "limits": [protocol.limits.min_pa / 1e3, protocol.limits.max_pa / 1e3],
    }  # fmt: skip


def page_of(straw: StrawParameters, protocol: PressureProtocol, orders: bool) -> str:
    """The report's page with the empty run in it."""
    says = "Running: the model under the pressure as it is measured."
    run = run_of(straw, protocol, orders)
    return assemble(protocol.name, says, [run], "live", (*SCRIPTS, "vent", "live"))


class Page:
    """The page at / and its feed at /feed, which takes orders: VENT from everyone with access, others if ``orders``."""

    def __init__(self, follower: Follower, page: str, control: Path | None, orders: bool) -> None:
        self.follower, self.page, self.control, self.orders = follower, page, control, orders

    def application(self, door: Door) -> ASGIApp:
        """Behind its guard."""
        routes = [Route("/", self.show), WebSocketRoute("/feed", self.feed)]
        return Guard(Starlette(routes=routes), door)

    async def show(self, request: Request) -> HTMLResponse:
        """The page."""
        return HTMLResponse(self.page)

    async def feed(self, asked: WebSocket) -> None:
        """Every row from the run's start, new ones 30 times a second, then the end; meanwhile orders are taken."""
        await asked.accept()
        listening = asyncio.create_task(self._listen(asked))
        with suppress(WebSocketDisconnect, RuntimeError):  # a client that disconnects meanwhile is no error
            await self._tell(asked)
        listening.cancel()

    async def _tell(self, asked: WebSocket) -> None:
        follower, rows_sent, events_sent, beat_s = self.follower, 0, 0, 0.0
        shown = asked.query_params.get("rows") != "0"  # a page that only vents needs no curves
        while True:
            ended = follower.ended.is_set()
            rows, events = follower.rows[rows_sent:], follower.events[events_sent:]
            rows_sent, events_sent = rows_sent + len(rows), events_sent + len(events)
            rows = rows if shown else []
            if rows or events or time.monotonic() > beat_s:
                beat_s = time.monotonic() + BEAT_S
                guardian = (
                    (read_control(self.control) or {}).get("guardian") if self.control and not rows_sent else None
                )
                await asked.send_text(json.dumps({"rows": rows, "events": events, "guardian": guardian}))
            if ended and rows_sent == len(follower.rows):
                await asked.send_text('{"end": true}')
                await asked.close()
                return
            await asyncio.sleep(1 / UPDATES_HZ)

    async def _listen(self, asked: WebSocket) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                try:
                    order = json.loads(await asked.receive_text())
                    answer = await asyncio.to_thread(self._order, str(order["do"]), str(order.get("who", "")))
                except (ValueError, KeyError, TypeError):
                    answer = {"error": "an order looks like {do, who}"}
                await asked.send_text(json.dumps(answer))

    def _order(self, do: str, who: str) -> dict[str, str]:
        if do not in ("vent", "state") and not self.orders:
            return {"error": "the lab's page has the orders of this run; from here it can be vented"}
        if self.control is None:
            return {"error": "this run takes no orders"}
        try:
            return {"state": send_order(self.control, do, who)}
        except RigError as error:
            return {"error": str(error)}


def serve(task: dict[str, Any]) -> tuple[Server, Door, socket.socket, Follower]:
    """Make the page, bind its address and the feed's; ReplayError where the address cannot be had."""
    straw = straw_from_toml(task["straw"])
    read = protocol_from_toml(task["protocol"], task["name"])
    protocol = replace(read, specimen=task["specimen"], cycle=task["cycle"])
    listener, host, port = bound(task["address"])
    door = Door(host, port, embedded=True)
    follower = Follower(straw, protocol)
    follower.stepper.advance(1e-6, 0.0, 0.0)  # compiles, before the run begins
    feed = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    feed.bind(("127.0.0.1", 0))
    orders = bool(task["control"]) and not task["watched"]
    page = Page(follower, page_of(straw, protocol, orders), Path(task["control"]) if task["control"] else None, orders)
    return Server(lambda: page.application(door), listener), door, feed, follower


def main() -> None:
    """Serve until stdin ends, that is, until the run's process closes it or has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the run handles Ctrl-C; this process ends with it
    if hasattr(os, "nice"):
        os.nice(5)  # the process that drives the rig has priority
    try:
        server, door, feed, follower = serve(json.loads(sys.stdin.readline()))
    except USER_ERRORS as error:
        print(json.dumps({"error": str(error)}), flush=True)
        return
    print(json.dumps({"url": door.url, "port": feed.getsockname()[1]}), flush=True)
    threading.Thread(target=_take, args=(feed, follower.take, follower), daemon=True).start()
    server.start()
    sys.stdin.read()
    follower.ended.set()
    time.sleep(LINGER_S)


def _take(feed: socket.socket, take: Callable[[dict[str, Any]], None], follower: Follower) -> None:
    while not follower.ended.is_set():
        try:
            take(json.loads(feed.recv(LARGEST)))
        except USER_ERRORS:  # the model cannot follow: the page stops, the rig continues
            follower.ended.set()


if __name__ == "__main__":
    main()
