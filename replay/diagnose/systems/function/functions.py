"""The functions of a user's system file: called in plain Python, and compiled to write into arrays."""

from __future__ import annotations

import inspect
from collections import namedtuple
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.systems.function.compiled import users, writes
from straw.replay.errors import ReplayError

if TYPE_CHECKING:
    from straw.replay.diagnose.systems.function.model import Model

Floats = NDArray[np.float64]


def fields(kind: str, names: Sequence[str]) -> Callable[..., Any]:
    """Arguments of a file's functions: fields by name; numba needs at least one."""
    return cast(Callable[..., Any], namedtuple(kind, tuple(names) or ("none",)))


def field_names(model: Model) -> dict[str, tuple[str, ...]]:
    """Names of the fields that a file's functions take: states X, inputs U, constants C."""
    constants = tuple(c.name for c in model.constants)
    return {"X": model.states, "U": tuple(i.name for i in model.inputs), "C": constants}


def evaluated(
    model: Model, name: str, function: Callable[..., Any] | None = None, at: tuple[Floats, Floats] | None = None
) -> Any:
    """Values of slopes or shown at the base's constants, in plain Python; ReplayError where they raise.

    ``at``: states and inputs; 1 otherwise.
    """
    X, U, C = (fields(k, names) for k, names in field_names(model).items())
    states, inputs = at if at is not None else (np.ones(len(model.states)), np.ones(len(model.inputs)))
    x, u = X(*(states.tolist() or [1.0])), U(*(inputs.tolist() or [1.0]))
    c = C(*([one.value for one in model.constants] or [0.0]))
    try:
        return (function or getattr(model.module, name))(0.0, x, u, c)
    except Exception as problem:  # the user's code may raise anything
        raise ReplayError(f"{model.path}: {name}(t, x, u, c) raised {in_one_line(problem)}") from problem


def writers(model: Model) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Slopes and shown, compiled, that take arrays and write into their last argument."""
    names = field_names(model)
    scope: dict[str, Any] = {kind: fields(kind, given) for kind, given in names.items()}
    for name in ("slopes", "shown"):
        if hasattr(model.module, name):
            scope[name] = _compiled(model, name)

    def unpacked(kind: str, array: str) -> str:
        return f"{kind}({', '.join(f'{array}[{i}]' for i in range(len(names[kind]))) or '0.0'})"

    given = f"t, {unpacked('X', 'x')}, {unpacked('U', 'u')}, {unpacked('C', 'c')}"
    lines = ["def write_slopes(t, x, u, c, out):"]
    if model.states:
        lines += [f"    r = slopes({given})"]
        one = len(model.states) == 1 and not _returns_tuple(model, "slopes")
        lines += ["    out[0] = r"] if one else [f"    out[{i}] = r[{i}]" for i in range(len(model.states))]
    else:
        lines += ["    return"]
    lines += ["def write_shown(t, x, u, c, out):"]
    if "shown" in scope:
        lines += [f"    r = shown({given})"]
        one = len(model.channels) == 1 and not _returns_tuple(model, "shown")
        lines += ["    out[0] = r"] if one else [f"    out[{i}] = r[{i}]" for i in range(len(model.channels))]
    else:
        lines += [f"    out[{i}] = x[{model.states.index(y.name)}]" for i, y in enumerate(model.channels)]
    exec("\n".join(lines), scope)
    try:
        return writes(scope["write_slopes"]), writes(scope["write_shown"])
    except Exception as problem:  # numba's, of many kinds
        raise ReplayError(
            f"{model.path}: slopes or shown cannot be compiled; return a tuple of as many numbers as there are "
            "states or channels"
        ) from problem


def _returns_tuple(model: Model, name: str) -> bool:
    return isinstance(evaluated(model, name), tuple | list | np.ndarray)


def _compiled(model: Model, name: str) -> Callable[..., Any]:
    """One of the file's functions compiled, with what it calls."""
    function = getattr(model.module, name)
    for other in list(vars(model.module)):
        thing = getattr(model.module, other)
        if other != name and inspect.isfunction(thing) and other in function.__code__.co_names:
            setattr(model.module, other, users(thing))
    out: Callable[..., Any] = users(function)
    try:
        evaluated(model, name, out)
    except ReplayError as problem:
        text = str(problem.__cause__).strip().splitlines() or ["?"]
        raise ReplayError(
            f"{model.path}: {name} cannot be compiled ({text[-1][:120]}); use floats and NumPy's functions of numbers "
            "in it, or give simulate(t, u, c), a plain function, in its place"
        ) from problem
    return out


def in_one_line(problem: Exception) -> str:
    """An exception of the user's code in one line, with where it was raised."""
    import traceback

    frames = traceback.extract_tb(problem.__traceback__)
    where = f" (line {frames[-1].lineno})" if frames else ""
    return f"{type(problem).__name__}: {problem}{where}"
