"""How a user's functions and their integrator are compiled: numba, without the GIL."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., object])

#: Returns a function of the same signature. Division by zero gives inf as in NumPy.
compiled = cast(Callable[[_Function], _Function], numba.njit(nogil=True, error_model="numpy"))
