"""The contract test over a user's system file: one line for each thing that is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from straw.replay.diagnose.systems.function.model import Model, load_model
from straw.replay.errors import ReplayError


def defects(path: Path) -> list[str]:
    """What is wrong with a system file, each in one line with its cure; empty where it is sound."""
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
        said = model.asked(name)
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
    """Optional laws name constants that there are; units of states are said."""
    out, known = [], {c.name for c in model.constants}
    for law, names in model.get("laws", {}).items():
        out += [f'{model.path}: laws["{law}"]: no constant {n}; add it to constants' for n in names if n not in known]
    out += [
        f'{model.path}: state {s} has no unit; add units = {{"{s}": "..."}}'
        for s in model.states
        if model.unit(s) == "?"
    ]
    return out


def _compiles(model: Model) -> list[str]:
    """The march can be built."""
    if not model.plain:
        _ = model.march
    return []
