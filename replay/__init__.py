"""Judges: reality against prediction. Called, as `straw.replay(recordings)`, it lays recordings over the model."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from straw.replay.api.comparing import Replay


class _Room(ModuleType):
    """This package, which has the name of a command that the API has, too."""

    def __call__(self, *recordings: Any, **options: Any) -> Replay:
        """As `straw.replay.api.comparing.replay`."""
        from straw.replay.api.comparing import replay

        return replay(*recordings, **options)


sys.modules[__name__].__class__ = _Room
