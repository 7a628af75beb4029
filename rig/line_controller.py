"""LineController: what drivers of instruments on a serial line share: nothing is sent twice, no late answer is used."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

from rig.controller import Controller
from rig.errors import LinkLostError, RigError
from rig.line import Line

VENT_ATTEMPTS = 3


class LineController(Controller):
    """A controller that is asked line by line.

    After an exchange that failed, its answer may still be on its way and would be taken for the next one's. Instruments
    answer in order, so before the next request ``_catch_up`` asks for something whose answer cannot be mistaken: once
    that is there, nothing older comes.
    """

    def __init__(self, line: Line, **settings: Any) -> None:
        super().__init__(**settings)
        self._line, self.port = line, line.port
        line.progress = lambda next_s=0.0: self.progress(next_s)
        self._behind = False  # an answer may still be on its way

    @abstractmethod
    def _catch_up(self) -> None:
        """Ask what only the right instrument answers, and pass over all that comes before its answer."""

    @abstractmethod
    def _exchange(self, request: bytes) -> bytes:
        """Send once; the answer to this request. RigError when none comes, or one that cannot be it."""

    @abstractmethod
    def _vent_requests(self, channel: int) -> Sequence[bytes]:
        """Requests that bring a channel to ambient pressure; sending them twice must do no harm."""

    def _open(self) -> None:
        self._line.open()
        self._behind = True
        try:
            self._catch_up()
        except BaseException:
            self._line.close()
            raise
        self._behind = False

    def _close(self) -> None:
        self._line.close()

    def _ask(self, request: bytes) -> bytes:
        """One exchange, in step with the instrument."""
        if self._behind:
            self._catch_up()
        self._behind = True
        reply = self._exchange(request)
        self._behind = False
        return reply

    def _vent(self, channel: int) -> None:
        """Unlike any other set, a vent is sent at once, whatever is still on its way, and repeated until confirmed."""
        for attempt in range(VENT_ATTEMPTS):
            try:
                if self._behind:
                    self._line.write(b"".join(self._vent_requests(channel)))
                for request in self._vent_requests(channel):
                    self._confirm(request, self._ask(request))
                return
            except LinkLostError:
                raise
            except RigError:
                if attempt == VENT_ATTEMPTS - 1:
                    raise

    @abstractmethod
    def _confirm(self, request: bytes, reply: bytes) -> None:
        """RigError unless the reply says that the request was understood and is in force."""
