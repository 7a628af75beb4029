"""Serve: an application behind its guard on one address; uvicorn's settings in one place."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from typing import Any

from straw.replay.errors import ReplayError
from straw.replay.lab.guard import LOOPBACK, Door

#: An open stream must not delay the end: uvicorn would wait for it for ever.
GRACE_S = 1


def bound(address: str, *, elsewhere: bool = True) -> tuple[socket.socket, str, int]:
    """A listening socket, its host and port, for ``HOST:PORT`` (port 0: any); ReplayError where it cannot be used.

    Other addresses than this machine's own are refused unless ``elsewhere``.
    """
    host, _, port = address.rpartition(":")
    host = host.strip("[]") or "127.0.0.1"
    if host not in LOOPBACK and not elsewhere:
        raise ReplayError(f"{address} can be reached from other machines; if that is wanted, add --remote")
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listener = socket.socket(family, socket.SOCK_STREAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind((host, int(port)))
            listener.listen(128)
        except BaseException:
            listener.close()
            raise
    except (OSError, ValueError, OverflowError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise ReplayError(
            f"{address} cannot be used as an address: {why}; give HOST:PORT of this machine, or port 0"
        ) from None
    return listener, host, listener.getsockname()[1]


class Server:
    """An application on a socket; ``run`` serves until ``stop``, ``start`` does so in a thread."""

    def __init__(self, make: Callable[[], Any], listener: socket.socket) -> None:
        import uvicorn

        self._listener = listener
        self._server = uvicorn.Server(
            uvicorn.Config(
                make,
                factory=True,
                ws="websockets-sansio",
                lifespan="off",
                log_config=None,
                access_log=False,
                server_header=False,
                timeout_graceful_shutdown=GRACE_S,
            )
        )

    def run(self) -> None:
        """Serve here."""
        try:
            self._server.run(sockets=[self._listener])
        finally:
            self._listener.close()

    def start(self) -> threading.Thread:
        """Serve in a thread that ends with the process."""
        thread = threading.Thread(target=self.run, name="web server", daemon=True)
        thread.start()
        return thread

    def stop(self) -> None:
        """End soon."""
        self._server.should_exit = True


def door_of(host: str, port: int, *, embedded: bool = False) -> Door:
    """The guard of a server on that socket."""
    return Door(host, port, embedded=embedded)
