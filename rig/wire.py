"""Wire: serves an emulated device on TCP or on a pty, with the latency and the line rate of the real port."""

from __future__ import annotations

import os
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from types import TracebackType
from typing import Protocol, Self

from rig.errors import RigError

POLL_S = 0.05  # how soon a closed wire is noticed


class Device(Protocol):
    """What speaks at the far end: one reply for one request line, at a time given to it."""

    terminator: bytes
    baud: int

    def answer(self, line: bytes, time_s: float) -> bytes:
        """The bytes sent back, empty for silence."""


class Wire:
    """Serves one client at a time from a daemon thread until ``close``; ``url`` is what ``rig.line.Line`` opens.

    ``address`` is ``"pty"`` (POSIX) or ``"[socket://]host:port"`` with port 0 for any. ``clock`` gives the device its
    time in seconds. ``received`` keeps the last request lines with their times, so that a test can prove what was sent.
    """

    def __init__(
        self,
        device: Device,
        address: str = "127.0.0.1:0",
        *,
        clock: Callable[[], float] = time.monotonic,
        latency_s: float = 1e-3,
    ) -> None:
        self.device = device
        self.clock = clock
        self.latency_s = latency_s
        self.received: deque[tuple[float, bytes]] = deque(maxlen=100_000)
        self._open = True
        if address == "pty":
            self.url, serve = self._listen_pty()
        else:
            self.url, serve = self._listen_tcp(address)
        self._thread = threading.Thread(target=serve, name=f"wire {self.url}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Hang up, as if the cable was pulled; returns when the thread has ended."""
        self._open = False
        self._thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def _listen_tcp(self, address: str) -> tuple[str, Callable[[], None]]:
        host, _, port = address.removeprefix("socket://").rpartition(":")
        try:
            listener = socket.create_server((host or "127.0.0.1", int(port)))
        except (OSError, ValueError, OverflowError) as error:
            raise RigError(f"cannot listen on {address!r}: {error}; use host:port with a free port, or 0") from None
        listener.settimeout(POLL_S)

        def serve() -> None:
            with listener:
                while self._open:
                    try:
                        client, _ = listener.accept()
                    except TimeoutError:
                        continue
                    with client:
                        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                        self._talk(client.fileno(), partial(client.recv, 4096), client.sendall)

        return f"socket://{host or '127.0.0.1'}:{listener.getsockname()[1]}", serve

    def _listen_pty(self) -> tuple[str, Callable[[], None]]:
        try:
            import pty
            import tty
        except ImportError:
            raise RigError("a pty needs Linux or macOS; use host:port here") from None
        master, slave = pty.openpty()
        tty.setraw(slave)  # a pty echoes by default: the device would answer its own greeting
        path = os.ttyname(slave)

        def serve() -> None:
            try:  # our own slave fd stays open, or the master reads EIO for ever once the client is gone
                self._talk(master, lambda: os.read(master, 4096), lambda data: os.write(master, data))
            finally:
                os.close(master)
                os.close(slave)

        return path, serve

    def _talk(self, fd: int, read: Callable[[], bytes], write: Callable[[bytes], object]) -> None:
        """Answer request lines until the client hangs up or the wire is closed."""
        waiting = b""
        while self._open:
            try:
                if not select.select([fd], [], [], POLL_S)[0]:
                    continue
                data = read()
                if not data:
                    return
                waiting += data
                while self.device.terminator in waiting:
                    line, waiting = waiting.split(self.device.terminator, 1)
                    line += self.device.terminator
                    self._spend(len(line))
                    now_s = self.clock()
                    self.received.append((now_s, line))
                    reply = self.device.answer(line, now_s)
                    self._spend(len(reply))
                    if self._open and reply:
                        write(reply)
            except OSError:
                return  # the client is gone; the next one is welcome

    def _spend(self, n_bytes: int) -> None:
        # 8N1 is ten bits a byte; half of the latency on the way in, half on the way out.
        time.sleep(self.latency_s / 2 + 10.0 * n_bytes / self.device.baud)
