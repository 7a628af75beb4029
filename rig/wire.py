"""Wire: serves an emulated device on TCP or on a pty, with latency, line rate and faults of a real port."""

from __future__ import annotations

import os
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from types import TracebackType
from typing import Protocol, Self

from straw.rig.clock import Clock
from straw.rig.emulator import Emulator
from straw.rig.errors import RigError

POLL_S = 0.05  # how soon a closed wire is noticed


@dataclass(frozen=True)
class Sent:
    """A reply: bytes, delay (s), and whether the link is unplugged after them for ``away_s``."""

    data: bytes
    late_s: float = 0.0
    away_s: float = 0.0


class Faults(Protocol):
    """Injects faults between a device and its wire; ``straw.rig.faults`` makes them from a seed."""

    def answer(self, device: Emulator, line: bytes, time_s: float) -> Sent:
        """The reply to this request line."""


class Wire:
    """Serves one client at a time from a daemon thread until ``close``; ``url`` is what ``straw.rig.line.Line`` opens.

    ``address`` is ``"pty"`` (POSIX) or ``"[socket://]host:port"`` with port 0 for any. ``now`` gives the device its
    time in seconds; the wire spends its own on ``clock``. ``received`` keeps the last request lines with their times,
    so that a test can check what was sent. Wires of one device share its ``lock``: it answers one request at a time.
    """

    def __init__(
        self,
        device: Emulator,
        address: str = "127.0.0.1:0",
        *,
        clock: Clock | None = None,
        now: Callable[[], float] | None = None,
        latency_s: float = 1e-3,
        faults: Faults | None = None,
        lock: threading.Lock | None = None,
    ) -> None:
        self.device = device
        self.clock = clock or Clock()
        self.now = now or self.clock.monotonic_s
        self.latency_s = latency_s
        self.faults = faults
        self._lock = lock or threading.Lock()
        self.received: deque[tuple[float, bytes]] = deque(maxlen=100_000)
        self._open = True
        if address == "pty":
            self.url, serve = self._listen_pty()
        else:
            self.url, serve = self._listen_tcp(address)
        self._thread = threading.Thread(target=serve, name=f"wire {self.url}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close the connection, as if the cable was pulled; returns when the thread has ended."""
        self._open = False
        self._thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def _listen_tcp(self, address: str) -> tuple[str, Callable[[], None]]:
        host, _, port = address.removeprefix("socket://").rpartition(":")
        host = host or "127.0.0.1"
        try:
            listener = socket.create_server((host, int(port)))
        except (OSError, ValueError, OverflowError) as error:
            raise RigError(f"cannot listen on {address!r}: {error}; use host:port with a free port, or 0") from None
        place: tuple[str, int] = (host, listener.getsockname()[1])

        def serve() -> None:
            away_s = self._accept(listener)
            while self._open:  # unplugged: the port does not exist for a while
                time.sleep(away_s)
                away_s = self._accept(socket.create_server(place))

        return f"socket://{place[0]}:{place[1]}", serve

    def _accept(self, listener: socket.socket) -> float:
        """Serve one client after the other; return how long the link stays unplugged (s)."""
        listener.settimeout(POLL_S)
        with listener:
            while self._open:
                try:
                    client, _ = listener.accept()
                except TimeoutError:
                    continue
                with client:
                    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    if away_s := self._talk(client.fileno(), partial(client.recv, 4096), client.sendall):
                        return away_s
        return 0.0

    def _listen_pty(self) -> tuple[str, Callable[[], None]]:
        try:
            import pty
            import termios
            import tty
        except ImportError:
            raise RigError("a pty needs Linux or macOS; use host:port here") from None
        master, slave = pty.openpty()
        tty.setraw(slave)  # a pty echoes by default: the device would receive its own output
        path = os.ttyname(slave)

        def serve() -> None:
            try:  # our own slave fd stays open, or the master reads EIO for ever once the client has closed
                while self._open:  # a terminal cannot be unplugged and keep its name: it stops answering instead
                    time.sleep(self._talk(master, lambda: os.read(master, 4096), lambda data: os.write(master, data)))
                    termios.tcflush(slave, termios.TCIOFLUSH)
            finally:
                os.close(master)
                os.close(slave)

        return path, serve

    def _talk(self, fd: int, read: Callable[[], bytes], write: Callable[[bytes], object]) -> float:
        """Answer request lines until the client hangs up or the wire is closed; s until it is plugged in again."""
        waiting = b""
        while self._open:
            try:
                if not select.select([fd], [], [], POLL_S)[0]:
                    continue
                data = read()
                if not data:
                    return 0.0
                waiting += data
                while self.device.terminator in waiting:
                    line, waiting = waiting.split(self.device.terminator, 1)
                    line += self.device.terminator
                    self._spend(len(line))
                    sent = self._answer(line)
                    self._spend(len(sent.data))
                    self.clock.sleep(sent.late_s)
                    if self._open and sent.data:
                        write(sent.data)
                    if sent.away_s:
                        return sent.away_s
            except OSError:
                return 0.0  # the client has closed; wait for the next one
        return 0.0

    def _answer(self, line: bytes) -> Sent:
        now_s = self.now()
        self.received.append((now_s, line))
        with self._lock:
            if self.faults:
                return self.faults.answer(self.device, line, now_s)
            return Sent(self.device.answer(line, now_s))

    def _spend(self, n_bytes: int) -> None:
        # 8N1 is ten bits a byte; half of the latency on the way in, half on the way out.
        self.clock.sleep(self.latency_s / 2 + 10.0 * n_bytes / self.device.baud)
