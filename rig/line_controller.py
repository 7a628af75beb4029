"""LineController: what drivers of instruments on a serial line share: nothing is sent twice, no late answer is used."""

from __future__ import annotations

import re
import time
from abc import abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Any, TypeAlias

from straw.rig.controller import Controller
from straw.rig.errors import LinkLostError, NoAnswerError, RigError
from straw.rig.line import Line

LATE_S = 2.5  # the latest answer that is expected; an instrument is asked for its identity for as long
VENT_S = 4.0  # a vent is two answers on some instruments; it is repeated for so long until both arrived
ASK_AGAIN_S = 0.6  # a mark may be lost as well; if repeated more often, late answers would pile up
VENT_REFUSALS = 3
Mark: TypeAlias = "tuple[bytes, re.Pattern[bytes]]"  # a request, and the pattern that only its answer matches


class LineController(Controller):
    """A controller that is queried line by line; ``timeout_s`` is how long it waits for an answer.

    After an exchange that failed, its answer may still be on its way and would be taken for the next one's. Instruments
    answer in order, so before the next request ``_catch_up`` sends one of the ``marks``: requests that change nothing
    and whose answers identify them. After the last mark's answer no older one can arrive, provided that the mark was
    asked after everything else. No mark is asked twice while its first answer may still come, so that a late one is
    not taken for the last one's either.
    """

    terminator: bytes
    marks: Sequence[Mark]

    def __init__(self, line: Line, timeout_s: float, **settings: Any) -> None:
        super().__init__(**settings)
        self._line, self.port, self.timeout_s = line, line.port, timeout_s
        line.progress = lambda next_s=0.0: self.progress(next_s)
        self._behind = False  # an answer may still be on its way
        self._turn = 0
        self._owed: deque[tuple[int, float]] = deque()  # marks whose answers may still come, and when asked (s)
        self._unmarked = True  # something was sent after the last mark

    @abstractmethod
    def _identify(self) -> None:
        """Send what only the right instrument answers, and keep the answer."""

    @abstractmethod
    def _is_whole(self, reply: bytes) -> bool:
        """Whether the line is an undamaged answer to anything."""

    @abstractmethod
    def _exchange(self, request: bytes) -> bytes:
        """Send once; return the answer to this request. RigError when none comes, or one that does not fit."""

    @abstractmethod
    def _vent_requests(self, channel: int) -> Sequence[bytes]:
        """Requests that bring a channel to ambient pressure; sending them twice must do no harm."""

    def _open(self) -> None:
        self._line.open()
        self._behind = True
        until_s = time.monotonic() + LATE_S
        try:
            while True:
                try:
                    self._identify()
                    self._unmarked = True
                    self._catch_up()
                    break
                except NoAnswerError:
                    if time.monotonic() > until_s:
                        raise
        except BaseException:
            self._line.close()
            raise
        self._behind = False

    def _close(self) -> None:
        self._line.close()

    def _catch_up(self) -> None:
        """Skip the answers to earlier requests; NoAnswerError while the mark's answer has not come."""
        if not self._owed:
            self._line.drain()
        if self._unmarked or not self._owed or time.monotonic() > self._owed[-1][1] + ASK_AGAIN_S:
            self._ask_mark()
        deadline_s = time.monotonic() + self.timeout_s
        while True:
            reply = self._line.read_until(self.terminator, deadline_s - time.monotonic())
            if any(self.marks[mark][1].fullmatch(reply) for mark, _ in self._owed):
                while not self.marks[self._owed.popleft()[0]][1].fullmatch(reply):
                    pass  # its answer was lost, or this one could not have come
                if not self._owed and not self._unmarked:
                    return
                uncovered = self._unmarked
            else:
                uncovered = not self._is_whole(reply)  # it may be the last mark's
            if uncovered:
                self._ask_mark()

    def _ask_mark(self) -> None:
        """Ask for the next mark that is not owed; where all are, none until the oldest can no longer come."""
        now_s = time.monotonic()
        if self._owed and self._owed[0][1] < now_s - LATE_S:
            self._line.drain()  # what came while this computer was busy may be its answer
            while self._owed and self._owed[0][1] < now_s - LATE_S:
                self._owed.popleft()
        owed = {mark for mark, _ in self._owed}
        turns = [(self._turn + 1 + k) % len(self.marks) for k in range(len(self.marks))]
        mark = next((mark for mark in turns if mark not in owed), None)
        if mark is not None:
            self._turn = mark
            self._owed.append((mark, now_s))
            self._unmarked = False
            self._line.write(self.marks[mark][0])

    def _ask(self, request: bytes) -> bytes:
        """One exchange, synchronised with the instrument."""
        if self._behind:
            self._catch_up()
        self._behind = True
        reply = self._exchange(request)
        self._behind = False
        return reply

    def _vent(self, channel: int) -> None:
        """Unlike any other set, a vent is sent at once, whatever is still on its way, and repeated until confirmed."""
        until_s, again_s, refusals = time.monotonic() + VENT_S, -float("inf"), 0
        while True:
            try:
                if self._behind and time.monotonic() > again_s:
                    again_s = time.monotonic() + ASK_AGAIN_S
                    # Marks asked before do not cover these: their answers come after those marks'.
                    self._unmarked = True
                    self._line.write(b"".join(self._vent_requests(channel)))
                for request in self._vent_requests(channel):
                    self._confirm(request, self._ask(request))
                return
            except LinkLostError:
                raise
            except RigError as error:
                refusals += not isinstance(error, NoAnswerError)
                if refusals >= VENT_REFUSALS or time.monotonic() > until_s:
                    raise

    @abstractmethod
    def _confirm(self, request: bytes, reply: bytes) -> None:
        """RigError unless the reply says that the request was understood and is in force."""
