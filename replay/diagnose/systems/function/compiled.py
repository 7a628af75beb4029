"""How a user's functions and their integrator are compiled: numba, without the GIL."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba import types

_Function = TypeVar("_Function", bound=Callable[..., object])

#: Division by zero gives inf as in NumPy.
_HOW: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
#: Returns a function of the same signature, kept on disk beside the file.
compiled = cast(Callable[[_Function], _Function], numba.njit(cache=True, **_HOW))

_VECTOR: Any = types.Array(types.f8, 1, "C")
#: f(t, x, u, c, out), which writes into its last argument.
WRITES = types.void(types.f8, _VECTOR, _VECTOR, _VECTOR, _VECTOR)
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


def users(function: Callable[..., Any]) -> Callable[..., Any]:
    """A user's function compiled; not kept, as the file may change."""
    return cast(Callable[..., Any], numba.njit(**_HOW)(function))


def writes(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function as `WRITES` compiled, so that what calls it need not be compiled again for each system."""
    return cast(Callable[..., Any], numba.njit(WRITES, **_HOW)(function))


def of_any_system(function: _Function, given: str) -> _Function:
    """A function of arguments of these kinds compiled, kept on disk; systems are passed to it as `writes`."""
    signature = tuple(_KINDS[one] for one in given.split())
    return cast(_Function, numba.njit(signature, cache=True, **_HOW)(function))
