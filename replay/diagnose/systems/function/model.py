"""A user's system file, read and checked: constants, inputs, channels, states, and the functions that relate them.

The guide says under "A system of your own" what a file holds. Times are in seconds, all else in the units that the file
names.
"""

from __future__ import annotations

import hashlib
import importlib.util
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.systems.function.functions import in_one_line, writers
from straw.replay.errors import ReplayError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Constant:
    """One of the base's constants: value, unit, plausible range; ``fixed`` where both ends are the value."""

    name: str
    value: float
    unit: str
    low: float
    high: float

    @property
    def fixed(self) -> bool:
        """Whether it may not be refitted."""
        return self.low == self.high


@dataclass(frozen=True)
class Signal:
    """A channel or an input: its column in the recordings, unit, and noise (one deviation) where it is stated."""

    name: str
    column: str
    unit: str
    noise: float | None = None


@dataclass(frozen=True)
class StartOf:
    """The start of a state: at ``value``, or free about a channel's first readings, or free within a range."""

    state: str
    value: float | None = None
    channel: str | None = None
    low: float = -np.inf
    high: float = np.inf


@dataclass(frozen=True, eq=False)
class Model:
    """The contents of a system file. ``simulate`` is a plain function in place of slopes."""

    path: Path
    title: str
    time: str | float  # column, or samples a second
    constants: tuple[Constant, ...]
    inputs: tuple[Signal, ...]
    channels: tuple[Signal, ...]
    starts: tuple[StartOf, ...]
    says: Mapping[str, str]  # names of constants, states and inputs in words
    module: ModuleType = field(repr=False)
    given: tuple[tuple[str, float, float, float], ...] = ()  # constants known better than in the file

    def __reduce__(self) -> tuple[Any, ...]:
        return load_model, (self.path, self.given)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states that slopes are given of."""
        return tuple(one.state for one in self.starts)

    @property
    def plain(self) -> bool:
        """Whether it is a plain function."""
        return hasattr(self.module, "simulate")

    @property
    def sha256(self) -> str:
        """Of the file."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()

    def get(self, name: str, default: Any = None) -> Any:
        """Another entry of the file."""
        return getattr(self.module, name, default)

    def named(self, name: str) -> str:
        """A constant, state or input in words."""
        return self.says.get(name, name)

    def unit(self, name: str) -> str:
        """Unit of an input, channel, constant or state (that of the channel of its name, or as the file says)."""
        units = {one.name: one.unit for one in self.constants}
        units |= {one.name: one.unit for one in (*self.inputs, *self.channels)}
        return str(dict(self.get("units", {})).get(name, units.get(name, "?")))

    @cached_property
    def functions(self) -> tuple[Callable[..., Any], Callable[..., Any]]:
        """Slopes and shown, compiled, that take arrays and write into their last argument."""
        return writers(self)


def load_model(path: Path, given: Sequence[tuple[str, float, float, float]] = ()) -> Model:
    """A system file; ReplayError names the defect, its place, and the cure.

    ``given`` are constants known better than in the file: name, value, low, high.
    """
    path = Path(path)
    if not path.is_file():
        raise ReplayError(f"{path}: no such file; give a system as a Python file")
    spec = importlib.util.spec_from_file_location(f"system_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ReplayError(f"{path}: not a Python file; a system ends in .py")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except SyntaxError as problem:
        raise ReplayError(f"{path}: line {problem.lineno}: {problem.msg}") from problem
    except SystemExit as problem:
        raise ReplayError(f"{path}: ends Python when it is loaded; a system only defines things") from problem
    except Exception as problem:
        raise ReplayError(f"{path}: cannot be run: {in_one_line(problem)}") from problem
    model = _model(path, module)
    constants = {one.name: one for one in model.constants}
    for name, value, low, high in given:
        if name not in constants:
            raise ReplayError(f"--given {name}: no such constant; known: {', '.join(constants) or 'none'}")
        constants[name] = _constant(path, name, (value, constants[name].unit, low, high))
    return replace(model, constants=tuple(constants.values()), given=tuple(given))


def _model(path: Path, module: ModuleType) -> Model:
    known = vars(module)
    for name in ("constants", "inputs", "channels", "start", "says", "units", "laws"):
        if not isinstance(known.get(name, {}), Mapping):
            raise ReplayError(f'{path}: {name} = {known[name]!r:.60}; give a dict, as {name} = {{"name": ...}}')

    def need(name: str, hint: str) -> Any:
        if name not in known:
            raise ReplayError(f"{path}: says no {name}; add {hint}")
        return known[name]

    constants = tuple(_constant(path, k, v) for k, v in known.get("constants", {}).items())
    inputs = tuple(_signal(path, "inputs", k, v) for k, v in known.get("inputs", {}).items())
    channels = tuple(
        _signal(path, "channels", k, v) for k, v in need("channels", 'channels = {"y": ("column", "unit")}').items()
    )
    starts = tuple(_start(path, k, v, [y.name for y in channels]) for k, v in known.get("start", {}).items())
    time = known.get("time", "time_s")
    if not isinstance(time, str | int | float):
        raise ReplayError(f"{path}: time = {time!r}; give the column's name, or samples a second as a number")
    if starts and "slopes" not in known:
        raise ReplayError(f"{path}: has start but no slopes(t, x, u, c); add it, or leave start out")
    if "slopes" in known and not starts:
        raise ReplayError(f'{path}: has slopes but no start; add start = {{"state": value or "channel"}}')
    if "simulate" not in known and "shown" not in known:
        hidden = [y.name for y in channels if y.name not in [s.state for s in starts]]
        if hidden:
            raise ReplayError(f"{path}: channel {hidden[0]} is no state; add shown(t, x, u, c), which returns it")
    names = [*(c.name for c in constants), *(s.state for s in starts), *(i.name for i in inputs)]
    for name in names:
        if not str(name).isidentifier():
            raise ReplayError(f"{path}: {name!r} is no name that Python can use; rename it")
    for law, wanted in known.get("laws", {}).items():
        for name in wanted if isinstance(wanted, list | tuple) else [wanted]:
            if name not in (c.name for c in constants):
                raise ReplayError(f'{path}: laws["{law}"]: no constant {name}; add it to constants')
    title = str(known.get("title", (module.__doc__ or path.stem).strip().splitlines()[0].rstrip(".")))
    return Model(path, title, time, constants, inputs, channels, starts, dict(known.get("says", {})), module)


def _constant(path: Path, name: str, given: Any) -> Constant:
    """(value, unit), (value, unit, low, high), or (value, unit, "fixed")."""
    where = f'{path}: constants["{name}"]'
    parts = tuple(given) if isinstance(given, tuple | list) else (given,)
    if len(parts) == 1:
        parts = (parts[0], "1")
    try:
        value, unit = float(parts[0]), str(parts[1])
        if len(parts) == 3 and parts[2] == "fixed":
            return Constant(name, value, unit, value, value)
        ends = [float(x) for x in parts[2:]] or sorted((value / 10, value * 10))
        low, high = ends
    except (TypeError, ValueError) as problem:
        raise ReplayError(f"{where} = {given!r}; give (value, unit, low, high)") from problem
    if not low <= value <= high:
        raise ReplayError(f"{where}: the value {value:g} is not within its range {low:g} to {high:g}")
    return Constant(name, value, unit, low, high)


def _signal(path: Path, kind: str, name: str, given: Any) -> Signal:
    """(column, unit) or (column, unit, noise)."""
    parts = tuple(given) if isinstance(given, tuple | list) else (given,)
    if not all(isinstance(x, str) for x in parts[:2]) or len(parts) > 3:
        raise ReplayError(f'{path}: {kind}["{name}"] = {given!r}; give (column, unit) or (column, unit, noise)')
    noise = float(parts[2]) if len(parts) == 3 else None
    if noise is not None and not noise > 0:
        raise ReplayError(f'{path}: {kind}["{name}"]: noise {noise:g} must be positive')
    return Signal(name, parts[0], parts[1] if len(parts) > 1 else "1", noise)


def _start(path: Path, state: str, given: Any, channels: list[str]) -> StartOf:
    """A number, a channel's name, or (value, low, high)."""
    if isinstance(given, str):
        if given not in channels:
            raise ReplayError(f'{path}: start["{state}"] = {given!r}: no such channel; known: {", ".join(channels)}')
        return StartOf(state, channel=given)
    if isinstance(given, tuple | list) and len(given) == 3:
        value, low, high = (float(x) for x in given)
        return StartOf(state, value, None, low, high)
    try:
        return StartOf(state, float(given), None, float(given), float(given))
    except (TypeError, ValueError) as problem:
        raise ReplayError(
            f'{path}: start["{state}"] = {given!r}; give a number, a channel, or (value, low, high)'
        ) from problem
