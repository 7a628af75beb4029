"""Compares recordings with predictions. `straw.replay(recordings)` calls this package: see ``api/comparing.py``."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from straw.replay.api.comparing import Replay


class _Room(ModuleType):
    """This package, callable because `straw.replay` is both a package and a function of the API."""

    def __call__(self, *recordings: Any, **options: Any) -> Replay:
        """As `straw.replay.api.comparing.replay`."""
        from straw.replay.api.comparing import replay

        return replay(*recordings, **options)


sys.modules[__name__].__class__ = _Room
