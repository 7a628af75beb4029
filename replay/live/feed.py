"""Feeds the page of a run: one datagram a cycle, without waiting, so that viewers never delay the rig's loop."""

from __future__ import annotations

import importlib.util
import json
import math
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from straw.model.parameters import StrawParameters
from straw.replay.errors import ReplayError
from straw.rig.operator import Operator
from straw.rig.orders import control_of
from straw.rig.protocol import PressureProtocol
from straw.rig.reading import Reading

HERE = "127.0.0.1:0"


class Live(Operator):
    """A page server beside a run, and the operator of that run; use as a context manager.

    Model and server live in a process of their own: nothing they do can hold this one's interpreter lock. ``url`` is
    the page's address. ``recording`` is the run's path, beside which its orders are taken; ``watched``: another page
    has the orders but for VENT. ReplayError where the address cannot be used.
    """

    def __init__(
        self,
        straw: StrawParameters,
        protocol: PressureProtocol,
        address: str = HERE,
        recording: Path | None = None,
        watched: bool = False,
    ) -> None:
        super().__init__()
        if importlib.util.find_spec("uvicorn") is None:
            raise ReplayError("--live needs the web server's packages; install them with: pip install 'straw[lab]'")
        self.url = ""
        self._main = str(protocol.channel)
        control = str(control_of(recording).absolute()) if recording else ""
        self._task = {
            "straw": straw.to_toml(),
            "protocol": protocol.text,
            "name": protocol.name,
            "specimen": protocol.specimen,
            "cycle": protocol.cycle,
            "address": address,
            "control": control,
            "watched": watched,
        }

    def __enter__(self) -> Self:
        command = [sys.executable, "-P", "-m", "straw.replay.live.server"]
        self._server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.write(json.dumps(self._task) + "\n")
        self._server.stdin.flush()
        answer = self._server.stdout.readline()  # arrives when the model is compiled and the page is served
        try:
            said = json.loads(answer or '{"error": "the page\'s process ended at once"}')
            if "error" in said:
                raise ReplayError(f"--live: {said['error']}")
            self.url = str(said["url"])
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.setblocking(False)
            self._socket.connect(("127.0.0.1", int(said["port"])))
        except BaseException:
            self._stop()
            raise
        return self

    def heard(self, now_s: float, readings: Sequence[Reading], told_pa: Mapping[int, float]) -> None:
        """Send a cycle to the page; what the page cannot take is lost only there."""
        self._send(
            {
                "t": now_s,
                "main": self._main,
                "pa": {reading.channel: reading.pressure_pa for reading in readings},
                "told": dict(told_pa),
                "flow": {r.channel: r.flow_m3_s for r in readings if math.isfinite(r.flow_m3_s)},
            }
        )

    def happened(self, now_s: float, kind: str, text: str) -> None:
        """Send an event to the page."""
        self._send({"t": now_s, "event": kind, "text": text})

    def _send(self, message: Mapping[str, Any]) -> None:
        try:
            self._socket.send(json.dumps(message).encode())
        except OSError:  # the page was closed, or is busy
            return

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._send({"end": True})
        self._socket.close()
        self._stop()

    def _stop(self) -> None:
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.close()  # closing it ends the server, also when this process is killed
        try:
            self._server.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._server.kill()
            self._server.wait()
        self._server.stdout.close()
