"""Line: moves bytes to and from one port, whatever they mean."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from straw.rig.errors import LinkLostError, NoAnswerError

T = TypeVar("T")
POLL_S = 0.02  # how long one read may wait; changing a port's timeout per call would reconfigure the port each time
WRITE_S = 0.3  # a request is some twenty bytes, 10 ms on the slowest line
OPEN_S = 6.0  # pyserial waits for a socket for 5 s


class Line:
    """A serial port by name (``COM3``, ``/dev/ttyUSB0``), by-id path, or URL (``socket://host:port``).

    Every fault of the port is a ``LinkLostError``; silence, and a request not taken in time, a ``NoAnswerError``. Each
    has one line that says which port and what to do.
    """

    def __init__(self, port: str, baud: int = 115200) -> None:
        self.port = port
        self.baud = baud
        self._serial: Any = None
        self._begun = b""  # an answer whose end has not come yet
        self.progress: Callable[..., None] = lambda next_s=0.0: None  # see Controller.progress

    def open(self) -> None:
        """Open at 8N1 without handshake, alone: a second program on the same port would mix up the replies."""
        self.progress(OPEN_S)
        import serial  # here, so that programs which only read recordings never load it

        alone: dict[str, Any] = {} if "://" in self.port else {"exclusive": True}
        try:
            self._serial = serial.serial_for_url(
                self.port, baudrate=self.baud, timeout=POLL_S, write_timeout=WRITE_S, **alone
            )
        except (OSError, ValueError, TypeError) as error:  # SerialException is an OSError
            raise LinkLostError(
                f"port {self.port} does not open: {_short(error)}; plug it in, check the name ({_ports()}), "
                "or close the program that holds it"
            ) from None
        _low_latency(self.port)
        self.progress()

    def close(self) -> None:
        """Close the port; never raises."""
        port, self._serial, self._begun = self._serial, None, b""
        if port is None:
            return
        socket = getattr(port, "_socket", None)
        try:
            port.close()
        except OSError:
            pass  # already closed
        finally:
            if socket is not None:  # pyserial 3.5 forgets to close its socket when the peer hung up first
                socket.close()

    def drain(self) -> bytes:
        """Discard, and return, late input: it must not be taken for the next reply."""

        def read_waiting(port: Any) -> bytes:
            stale = b""
            while len(stale) < 65536 and port.in_waiting:
                stale += port.read(port.in_waiting)
            return stale

        begun, self._begun = self._begun, b""
        return begun + self._guarded(read_waiting)

    def write(self, request: bytes) -> None:
        """Send all bytes of the request; NoAnswerError when they were not accepted in time."""
        from serial import SerialTimeoutException

        def send(port: Any) -> None:
            try:
                port.write(request)
            except SerialTimeoutException:  # also when this computer was suspended, so the link does not count as lost
                raise NoAnswerError(
                    f"port {self.port}: {request!r} was not taken within {WRITE_S:g} s; check that this computer is "
                    "not too busy, and the instrument on"
                ) from None

        self._guarded(send)

    def read_until(self, until: bytes, timeout_s: float) -> bytes:
        """Bytes up to and including ``until``; NoAnswerError when it does not come within ``timeout_s`` seconds.

        An incomplete answer is kept for the next call, or its rest would be taken for the end of another answer.
        """
        deadline = time.monotonic() + timeout_s
        reply, self._begun = self._begun, b""
        while not reply.endswith(until):
            if time.monotonic() > deadline:
                heard = f"only {reply!r}" if reply else "nothing"
                self._begun = reply
                within = f"{max(timeout_s, 0.0):.2g} s"
                raise NoAnswerError(f"port {self.port}: {heard} within {within}; check that the right instrument is on")
            reply += self._guarded(lambda port: bytes(port.read(1)))
        return reply

    def quiet(self, time_s: float) -> None:
        """Discard input until there was none for ``time_s`` seconds."""
        since = time.monotonic()
        while time.monotonic() - since < time_s:
            if self._guarded(lambda port: port.read(1)):
                since = time.monotonic()

    def exchange(self, request: bytes, until: bytes, timeout_s: float) -> bytes:
        """Drop stale input, send the request once, and return the reply up to ``until``."""
        self.drain()
        self.write(request)
        return self.read_until(until, timeout_s)

    def _guarded(self, use: Callable[[Any], T]) -> T:
        if self._serial is None:
            raise LinkLostError(f"port {self.port} is not open; open it first")
        self.progress()
        try:
            return use(self._serial)
        except (OSError, TypeError, ValueError) as error:  # pyserial turns a vanished fd into TypeError
            raise LinkLostError(
                f"port {self.port} was lost: {_short(error)}; check cable and power, then start again"
            ) from None


def _short(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _ports() -> str:
    from serial.tools.list_ports import comports

    names = [port.device for port in comports()]
    return f"ports here: {', '.join(names)}" if names else "no serial port found here"


def _low_latency(port: str) -> None:
    # FTDI chips wait 16 ms to fill a packet, which caps polling near 60 Hz; lowering it may need rights that are
    # missing.
    try:
        timer = Path("/sys/bus/usb-serial/devices") / Path(port).resolve().name / "latency_timer"
        if timer.exists():
            timer.write_text("1")
    except OSError:
        pass  # slower, not wrong
