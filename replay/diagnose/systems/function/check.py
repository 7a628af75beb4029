"""The contract test over a user's system file: one line for each thing that is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from straw.replay.diagnose.systems.function.functions import evaluated
from straw.replay.diagnose.systems.function.model import Model, load_model
from straw.replay.diagnose.systems.function.recording import Recorded
from straw.replay.diagnose.systems.function.system import FunctionSystem
from straw.replay.errors import ReplayError


def defects(path: Path) -> list[str]:
    """Defects of a system file, each in one line with its cure; empty where there are none."""
    try:
        model = load_model(path)
    except ReplayError as problem:
        return [str(problem)]
    out = [line for test in (_gives_numbers, _is_whole, _compiles) for line in _asked(test, model)]
    if model.get("columns") is None and model.get("read") is None and not isinstance(model.time, str):
        wanted = {s.column for s in (*model.inputs, *model.channels)}
        if not wanted:
            out.append(f"{path}: names no column; add channels")
    return out


def check_on(system: FunctionSystem, recordings: Sequence[Recorded]) -> None:
    """Raise ReplayError, one line, where the file's functions give no numbers where a recording starts.

    The base must be defined there; later on a trial may diverge, which the fit tolerates.
    """
    model = system.model
    for one in recordings:
        if model.plain:
            shown = system.played(one, {}, np.zeros(0))[0]
            if not np.isfinite(shown).any():
                raise ReplayError(f"{model.path}: simulate(t, u, c) gives no finite number for recording {one.name}")
            continue
        x0, u0 = system.started(one)[0], one.inputs[: len(model.inputs), 0]
        given = zip((*model.states, *(s.name for s in model.inputs)), (*x0, *u0), strict=True)
        where = ", ".join(f"{n} = {v:.4g}" for n, v in given)
        for name, wanted in (("slopes", model.states), ("shown", [y.name for y in model.channels])):
            if hasattr(model.module, name):
                _are_numbers(model, name, wanted, evaluated(model, name, at=(x0, u0)), f"{one.name} starts ({where})")


def _are_numbers(model: Model, name: str, wanted: Sequence[str], said: object, where: str) -> None:
    values = np.atleast_1d(np.asarray(said, dtype=object))
    if len(values) != len(wanted):
        raise ReplayError(f"{model.path}: {name} returns {len(values)} numbers for {len(wanted)}: {', '.join(wanted)}")
    for what, value in zip(wanted, values, strict=True):
        if not isinstance(value, int | float | np.number) or not np.isfinite(value):
            raise ReplayError(f"{model.path}: {name} returns {value!r:.40} for {what} where recording {where}")


def _asked(test: Callable[[Model], list[str]], model: Model) -> list[str]:
    try:
        return test(model)
    except ReplayError as problem:
        return [str(problem)]


def _gives_numbers(model: Model) -> list[str]:
    """Slopes and shown give as many finite numbers as there are states and channels."""
    out = []
    for name, wanted in (("slopes", model.states), ("shown", [y.name for y in model.channels])):
        if not hasattr(model.module, name):
            continue
        said = evaluated(model, name)
        values = np.atleast_1d(np.asarray(said, dtype=object))
        if len(values) != len(wanted):
            out.append(f"{model.path}: {name} returns {len(values)} numbers for {len(wanted)}: {', '.join(wanted)}")
            continue
        for one, value in zip(wanted, values, strict=True):
            if not isinstance(value, int | float | np.number):
                out.append(f"{model.path}: {name} returns {type(value).__name__} for {one}; return a number")
            elif not np.isfinite(value):
                out.append(f"{model.path}: {name} returns {value} for {one} where all states and inputs are 1")
    return out


def _is_whole(model: Model) -> list[str]:
    """Units of states are given."""
    return [
        f'{model.path}: state {s} has no unit; add units = {{"{s}": "..."}}'
        for s in model.states
        if model.unit(s) == "?"
    ]


def _compiles(model: Model) -> list[str]:
    """Its functions can be compiled."""
    if not model.plain:
        _ = model.functions
    return []
