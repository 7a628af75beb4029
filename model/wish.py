"""What a design must have and what may be varied for it, read from a TOML file."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from straw.model.errors import ModelError

#: What can be wanted, with the accuracy in which it counts, SI.
WANTED = {
    "deploy_kpa": 0.5,
    "fold_kpa": 0.5,
    "folded_length_mm": 0.05,
    "deployed_length_mm": 0.05,
    "stable_states": 0.1,
}
#: What can be varied.
VARIED = ("r_i_mm", "r_o_mm", "zeta01_mm", "zeta02_mm", "h_mm", "E_gpa")


@dataclass(frozen=True)
class Wish:
    """What is wanted of a cell and what may be varied for it; or the order in which cells are to snap."""

    wanted: Mapping[str, float] = field(default_factory=dict)
    vary: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    order: tuple[int, ...] = ()
    first_kpa: float = 0.0
    apart_kpa: float = 0.0


def read_wish(path: Path) -> Wish:
    """A wish from TOML: [wanted] and [vary], or [order] with cells, first_kpa, apart_kpa; ModelError otherwise."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise ModelError(f"{path}: cannot read the wish: {reason}") from None
    except tomllib.TOMLDecodeError as error:
        raise ModelError(f"{path}: not TOML: {error}") from None
    for key in data:
        if key not in ("wanted", "vary", "order"):
            raise ModelError(f"{path}: unknown table [{key}]; known: wanted, vary, order")
    wanted, vary, order = (_table(path, data, name) for name in ("wanted", "vary", "order"))
    for key, value in wanted.items():
        if key not in WANTED or not _is_number(value):
            raise ModelError(f"{path}: wanted.{key} = {value!r}, expected a number for one of {', '.join(WANTED)}")
    for key, value in vary.items():
        good = key in VARIED and isinstance(value, list) and len(value) == 2 and all(_is_number(x) for x in value)
        if not good or not value[0] < value[1]:
            raise ModelError(f"{path}: vary.{key} = {value!r}, expected [low, high] for one of {', '.join(VARIED)}")
    if order:
        cells = order.get("cells")
        if not isinstance(cells, list) or not all(isinstance(c, int) for c in cells) or len(set(cells)) != len(cells):
            raise ModelError(f"{path}: order.cells = {cells!r}, expected the cells, each once, first to snap first")
        for key in ("first_kpa", "apart_kpa"):
            if not _is_number(order.get(key)):
                raise ModelError(f"{path}: order.{key} = {order.get(key)!r}, expected a number")
        if order["first_kpa"] * order["apart_kpa"] <= 0:
            raise ModelError(f"{path}: order: first_kpa and apart_kpa must have one sign: pressure goes one way")
        return Wish(order=tuple(cells), first_kpa=order["first_kpa"], apart_kpa=order["apart_kpa"])
    if not wanted or not vary:
        raise ModelError(f"{path}: expected [wanted] and [vary], or [order]")
    return Wish(wanted, {k: (float(a), float(b)) for k, (a, b) in vary.items()})


def _table(path: Path, data: Mapping[str, Any], name: str) -> dict[str, Any]:
    table = data.get(name, {})
    if not isinstance(table, dict):
        raise ModelError(f"{path}: {name} = {table!r}, expected a table [{name}]")
    return table


def _is_number(x: Any) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x)
