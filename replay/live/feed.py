"""Feeds a running page: one datagram a cycle, never waiting, so that the rig's loop does not know who is looking."""

from __future__ import annotations

import json
import socket
import struct
import subprocess
import sys
from types import TracebackType
from typing import Self

from model.parameters import StrawParameters
from replay.errors import ReplayError
from rig.protocol import PressureProtocol

#: A reading on its way to the page: seconds since the protocol's start, measured Pa. NaN seconds: the run has ended.
READING = struct.Struct("<dd")
HERE = "127.0.0.1:0"


class Live:
    """A page server beside a run; use as a context manager, then ``send`` every reading.

    Model and server live in a process of their own: nothing they do can hold this one's interpreter lock. ``url`` is
    where to look. ReplayError where the address cannot be had.
    """

    def __init__(self, straw: StrawParameters, protocol: PressureProtocol, address: str = HERE) -> None:
        self.url = ""
        self._task = {"straw": straw.to_toml(), "protocol": protocol.text, "name": protocol.name, "address": address}

    def __enter__(self) -> Self:
        command = [sys.executable, "-m", "replay.live.server"]
        self._server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.write(json.dumps(self._task) + "\n")
        self._server.stdin.flush()
        answer = self._server.stdout.readline()  # comes when the model is compiled and the page can be had
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

    def send(self, time_s: float, measured_pa: float) -> None:
        """Tell the page of a reading; what the page cannot take is lost to it, and to nobody else."""
        try:
            self._socket.send(READING.pack(time_s, measured_pa))
        except OSError:  # the page has gone, or is busy
            return

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.send(float("nan"), 0.0)
        self._socket.close()
        self._stop()

    def _stop(self) -> None:
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.close()  # its end is the server's, too, also when this process is killed
        try:
            self._server.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._server.kill()
            self._server.wait()
        self._server.stdout.close()
