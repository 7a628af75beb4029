"""How the model is compiled: numba, no GIL, cached on disk under a key made of the model's own source."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numba

from straw.model import plugged


def cache_folder(sources: Iterable[Path]) -> Path:
    """Folder for compiled code, one per state of its source files.

    Numba notices a change in the file of the function it cached but not in the files that function calls into, so a
    stale result is possible after an edit or an upgrade. Keying the folder by all of the source rules that out.
    """
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for source in sources:
        digest.update(source.read_bytes())
    parent = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(parent) / "straw" / f"numba-{digest.hexdigest()[:16]}"


#: Of the model's source, and of laws from outside.
_CACHE = cache_folder([*sorted(Path(__file__).parent.rglob("*.py")), *plugged.sources()])
#: Whether this machine has compiled this model already; the first time takes about half a minute.
COMPILED_BEFORE = _CACHE.exists()  # asked here, as numba makes the folder when the first function is declared
setattr(numba.config, "CACHE_DIR", str(_CACHE))  # noqa: B010  (numba makes its settings at run time)
# LLVM's first level of optimisation: runs are as fast as with numba's third, and compiling takes 0.7 of the time
if "NUMBA_OPT" not in os.environ:
    setattr(numba.config, "OPT", type(getattr(numba.config, "OPT"))(1))  # noqa: B009, B010

#: Compile a function of the model: ``@compiled`` instead of ``@njit``. Division by zero gives inf as in NumPy.
compiled = numba.njit(cache=True, nogil=True, error_model="numpy")

if TYPE_CHECKING:  # numba's types do not know ``_nrt``
    allocates_nothing = fused = called = composed = inlined = compiled
else:
    # Inlined into their callers, without counting references to arrays: passing and counting all fields of the
    # tuples the model is made of took longer than the arithmetic. ``_nrt`` is numba's switch for its run-time, which
    # counts; with it steps take 1.4 times as long. Without it numba refuses to compile a function that makes an array.
    _within = {"nogil": True, "error_model": "numpy", "forceinline": True, "_nrt": False}
    #: The same for a function that makes no arrays.
    allocates_nothing = numba.njit(cache=True, **_within)
    #: The same for one that has one caller and few loops of its own, joined to it before either is compiled: compiling
    #: takes less. Loops of a large function are worse compiled so: all inlined, derivatives took 1.2 times as long.
    inlined = numba.njit(cache=True, inline="always", **_within)
    #: The same where products may be added without rounding in between: long polynomials take 0.7 of the time.
    fused = numba.njit(cache=True, fastmath={"contract"}, **_within)
    #: The same for a large one that is called, not inlined: its callers share its machine code.
    called = numba.njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
    #: The same for one made of others at import, which cannot be cached by itself: its callers' caches hold it.
    composed = numba.njit(**_within)
