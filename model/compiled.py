"""How the model is compiled: numba, no GIL, cached on disk under a key made of the model's own source."""

from __future__ import annotations

import hashlib
import os
import sys
import uuid
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import numba
from numba.core.registry import CPUDispatcher

from straw.model import plugged

_Function = TypeVar("_Function", bound=Callable[..., Any])


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


def own_files(dispatcher: _Function) -> _Function:
    """A cached function that gives each signature's machine code a file name of its own.

    Numba numbers these files. Two processes that compile different signatures at the same time take the same number,
    and whoever comes later loads the other's machine code, without an error.
    """
    kept = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)  # none where numba only interprets
    if kept is not None:
        stem = kept._index_name.removesuffix(".nbi")
        kept._data_name = lambda number: f"{stem}.{uuid.uuid4().hex[:16]}.nbc"
    return dispatcher


class _OnlyInside(CPUDispatcher):
    """A compiled function that only compiled functions may call: it has no entry point for Python."""

    def __call__(self, *_: Any, **__: Any) -> NoReturn:
        name = self.py_func.__qualname__
        raise TypeError(f"{name}: only compiled code may call it; to call it from Python, declare it as @exposed")


#: Options of numba for a function that Python does not call.
_NO_ENTRY = {"no_cpython_wrapper": True}


def _inside(**how: Any) -> Callable[[_Function], _Function]:
    """`_kept` without an entry point for Python: unpacking the model's tuples takes long to compile."""

    def declare(function: Any) -> Any:
        dispatcher = _kept(**how, **_NO_ENTRY)(function)
        if isinstance(dispatcher, CPUDispatcher):  # not where numba only interprets
            dispatcher.__class__ = _OnlyInside
        return dispatcher

    return declare


def _kept(**how: Any) -> Callable[[_Function], _Function]:
    """A decorator that compiles as these options of numba say and keeps the result on disk."""
    compile_ = numba.njit(cache=True, **how)
    return lambda function: own_files(compile_(function))


#: Of the model's source, and of laws from outside.
_CACHE = cache_folder([*sorted(Path(__file__).parent.rglob("*.py")), *plugged.sources()])
#: Whether this machine has compiled this model already; simulating takes half a minute, derivatives two.
COMPILED_BEFORE = _CACHE.exists()  # asked here, as numba makes the folder when the first function is declared
setattr(numba.config, "CACHE_DIR", str(_CACHE))  # noqa: B010  (numba makes its settings at run time)
# LLVM's first level of optimisation: runs are as fast as with numba's third, and compiling takes 0.7 of the time
if "NUMBA_OPT" not in os.environ:
    setattr(numba.config, "OPT", type(getattr(numba.config, "OPT"))(1))  # noqa: B009, B010

#: Numba passes `fastmath` and `forceinline` on from a caller to what it calls, unless they are set: how a function is
#: compiled, and how it rounds, would depend on which of its callers is compiled first.
_ALWAYS = {"nogil": True, "error_model": "numpy", "fastmath": False, "forceinline": False, "no_cfunc_wrapper": True}
#: Compile a function of the model: ``@compiled`` instead of ``@njit``. Division by zero gives inf as in NumPy.
compiled = _kept(**_ALWAYS)

if TYPE_CHECKING:  # numba's types do not know ``_nrt``
    allocates_nothing = fused = called = composed = exposed = inlined = compiled
else:
    # Inlined into their callers, without counting references to arrays: passing and counting all fields of the
    # tuples the model is made of took longer than the arithmetic. ``_nrt`` is numba's switch for its run-time, which
    # counts; with it steps take 1.4 times as long. Without it numba refuses to compile a function that makes an array.
    _within = {**_ALWAYS, "forceinline": True, "_nrt": False}
    #: The same for a function that makes no arrays and is called by compiled ones only.
    allocates_nothing = _inside(**_within)
    #: The same for one that Python calls, too.
    exposed = _kept(**_within)
    #: The same for one that has one caller and few loops of its own, joined to it before either is compiled: compiling
    #: takes less. Loops of a large function are worse compiled so: all inlined, derivatives took 1.2 times as long.
    inlined = _inside(inline="always", **_within)
    #: The same where products may be added without rounding in between: long polynomials take 0.7 of the time.
    fused = _inside(**{**_within, "fastmath": {"contract"}})
    #: The same for a large one that is called, not inlined: its callers share its machine code.
    called = _inside(**{**_within, "forceinline": False})
    #: The same for one made of others at import, which cannot be cached by itself: its callers' caches hold it.
    composed = numba.njit(**_within, **_NO_ENTRY)
