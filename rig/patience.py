"""Patience: how many answers in a row, and for how long, may be missing or corrupted before a run is given up."""

from __future__ import annotations

import time

from straw.rig.errors import LimitError, LinkLostError, NoAnswerError, RigError

MISSES = 3  # consecutive readings that may be refused or implausible before the run is given up
#: Without an answer for so long the run is given up: two answers in a row that come 2 s late, and catching up after
#: each. Meanwhile nothing is set.
PATIENCE_S = 5.0


class Patience:
    """Counts failed exchanges; a single garbled answer does not end a run."""

    def __init__(self) -> None:
        self.missed = 0  # in all
        self.answered()

    def answered(self) -> None:
        """An exchange succeeded."""
        self._in_a_row, self._answered_s = 0, time.monotonic()

    def failed(self, error: RigError) -> None:
        """An exchange failed: return if it may be repeated, or raise the error if that makes no sense."""
        if isinstance(error, LinkLostError | LimitError):
            raise error
        self._in_a_row += not isinstance(error, NoAnswerError)
        self.missed += 1
        if self._in_a_row >= MISSES or time.monotonic() - self._answered_s > PATIENCE_S:
            raise error
