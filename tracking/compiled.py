"""How the tracker is compiled: numba, no GIL, cached on disk under a key made of the tracker's own source."""

from __future__ import annotations

import hashlib
import os
import sys
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba


def _cache_folder() -> str:
    """Folder for compiled code, one per state of the tracker's source.

    Numba notices a change in the file of the function it cached but not in the files that function calls into.
    """
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    parent = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return str(Path(parent) / "straw" / f"numba-tracking-{digest.hexdigest()[:16]}")


_CACHE = _cache_folder()
# LLVM's first level of optimisation: as fast here as numba's third, and compiled sooner; one setting for a process
if "NUMBA_OPT" not in os.environ:
    setattr(numba.config, "OPT", type(getattr(numba.config, "OPT"))(1))  # noqa: B009, B010


def own_files(dispatcher: Any) -> Any:
    """A cached function that gives each signature's machine code a file name of its own.

    Numba numbers these files. Two processes that compile different signatures at the same time take the same number,
    and whoever comes later loads the other's machine code, without an error. The model has the same function, as the
    two rooms do not import each other.
    """
    kept = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)  # none where numba only interprets
    if kept is not None:
        stem = kept._index_name.removesuffix(".nbi")
        kept._data_name = lambda number: f"{stem}.{uuid.uuid4().hex[:16]}.nbc"
    return dispatcher


def compiled(function: Callable[..., Any], **more: Any) -> Any:
    """Compile a function at its first call, with numba's options ``more``; division by zero gives inf as in NumPy."""
    settings: Any = numba.config
    others = settings.CACHE_DIR  # the folder is read when a function is declared; the model has one of its own
    settings.CACHE_DIR = _CACHE
    try:
        return own_files(numba.njit(nogil=True, cache=True, error_model="numpy", **more)(function))
    finally:
        settings.CACHE_DIR = others
