"""How a user's functions and their integrator are compiled: numba, without the GIL; the integrator is kept on disk."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba import types

from straw.model.compiled import cache_folder, own_files
from straw.replay.diagnose import settings

_Function = TypeVar("_Function", bound=Callable[..., object])

#: Division by zero gives inf as in NumPy.
_HOW: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
#: Numba's type of an array of one dimension.
_VECTOR: Any = types.Array(types.f8, 1, "C")
#: f(t, x, u, c, out), which writes into its last argument.
WRITES = types.void(types.f8, _VECTOR, _VECTOR, _VECTOR, _VECTOR)
#: Numba's types of arguments, by the words of a signature.
_KINDS = {
    "function": types.FunctionType(WRITES),
    "vector": _VECTOR,
    "table": types.Array(types.f8, 2, "C"),
    "rows": types.Array(types.i8, 2, "C"),
    "flags": types.Array(types.b1, 1, "C"),
    "indices": types.Array(types.i8, 1, "C"),
    "number": types.f8,
    "count": types.i8,
    "flag": types.b1,
}


_SOURCES = [
    Path(__file__).with_name(f"{name}.py")
    for name in ("clocks", "codes", "compiled", "kernel", "shapes", "shots", "varied")
]
_FOLDER = cache_folder([*_SOURCES, Path(settings.__file__)])


@contextmanager
def _kept_here() -> Iterator[None]:
    """Functions that are declared inside are kept in this folder's own place; the model has another."""
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]  # numba makes its settings at run time
    setattr(numba.config, "CACHE_DIR", str(_FOLDER))  # noqa: B010
    try:
        yield
    finally:
        setattr(numba.config, "CACHE_DIR", before)  # noqa: B010


def compiled(function: _Function) -> _Function:
    """A function of the same signature, kept on disk."""
    with _kept_here():
        return cast(_Function, own_files(numba.njit(cache=True, **_HOW)(function)))


def users(function: Callable[..., Any]) -> Callable[..., Any]:
    """A user's function compiled; not kept, as the file may change."""
    return cast(Callable[..., Any], numba.njit(**_HOW)(function))


def writes(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function as `WRITES` compiled, so that what calls it need not be compiled again for each system."""
    return cast(Callable[..., Any], numba.njit(WRITES, **_HOW)(function))


def of_any_system(function: _Function, given: str) -> _Function:
    """A function of arguments of these kinds compiled, kept on disk; systems are passed to it as `writes`."""
    signature = tuple(_KINDS[one] for one in given.split())
    with _kept_here():
        dispatcher = own_files(numba.njit(cache=True, **_HOW)(function))
        dispatcher.compile(signature)
        dispatcher.disable_compile()
        return cast(_Function, dispatcher)
