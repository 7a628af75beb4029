"""Constants of a straw's terms: checked, spread over the frusta, and packed for the compiled equations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.terms import COLUMNS, DEFAULTS, TERMS, WIDTH

Floats = NDArray[np.float64]
#: Constants by name, by term.
Terms = Mapping[str, Mapping[str, Any]]


def all_of(condition: Any) -> bool:
    """Whether a condition holds, everywhere for an array."""
    return condition if isinstance(condition, bool) else bool(np.all(condition))


def finite(value: Any) -> bool:
    """Whether a number, or every one of an array, is finite."""
    return math.isfinite(value) if isinstance(value, float) else bool(np.isfinite(np.asarray(value, np.float64)).all())


def checked(terms: Terms, cells: int) -> Terms:
    """The terms of a straw as plain numbers and lists; ModelError names a constant that is none of `straw.model.terms`,
    does not spread over the cells, or is out of its range."""
    out: dict[str, dict[str, Any]] = {}
    for name, given in terms.items():
        if name not in TERMS:
            raise ModelError(f"straw: unknown term {name!r}; known: {', '.join(TERMS)}")
        if not isinstance(given, Mapping):
            raise ModelError(f"straw: terms.{name} = {given!r}, expected constants by name")
        known = {constant.name: constant for constant in TERMS[name].constants}
        out[name] = {}
        for key, value in given.items():
            where = f"terms.{name}.{key}"
            if key not in known:
                raise ModelError(f"straw: unknown constant {where}; known: {', '.join(known)}")
            plain = isinstance(value, float)
            numbers = value if plain else per_frustum(where, value, TERMS[name].kind, cells)
            if known[key].low >= 0 and key in TERMS[name].strengths:
                good, expected = all_of(numbers >= 0), "zero or above"
            else:
                good, expected = all_of((numbers > 0) | (known[key].low <= 0)), "above zero"
            if not (good and finite(numbers)):
                raise ModelError(f"straw: {where} = {value!r}, expected {expected}")
            out[name][key] = float(value) if plain else np.asarray(value, dtype=np.float64).tolist()
        for points in TERMS[name].rising:
            at = [out[name].get(point, known[point].default) for point in points]
            if any(np.ndim(x) for x in at) or not np.all(np.diff(at) > 0):
                raise ModelError(f"straw: terms.{name}: {points[0]} to {points[-1]} = {at}, expected rising numbers")
    return out


def per_frustum(where: str, value: Any, kind: str, cells: int) -> Floats:
    """A constant of a term of that kind for each frustum, (cells, 2); ModelError where it does not spread so."""
    try:
        given = np.asarray(value, dtype=np.float64)
        if given.ndim == 1:  # one number a cell, for both of its frusta
            given = np.broadcast_to(given[:, np.newaxis], (len(given), 2))
        if given.ndim and (kind in ("body", "flow") or len(given) != cells):
            raise ValueError
        return np.broadcast_to(given, (cells, 2))
    except (TypeError, ValueError):
        wanted = "a number" if kind in ("body", "flow") else f"a number, {cells} numbers or {cells} pairs"
        raise ModelError(f"straw: {where} = {value!r}, expected {wanted}") from None


def acting(terms: Terms, *kinds: str) -> NDArray[np.bool_]:
    """Which of all terms are of these kinds and have a strength other than zero, (terms,)."""
    acts = np.zeros(len(TERMS), np.bool_)
    for place, (name, term) in enumerate(TERMS.items()):
        if name in terms and term.kind in kinds:
            acts[place] = any(np.any(np.asarray(terms[name].get(one, 0.0)) != 0) for one in term.strengths)
    return acts


def packed(terms: Terms, cells: int) -> Floats:
    """Constants of all terms side by side, (cells, 2, WIDTH); defaults, strengths zero, where none are given."""
    out = np.empty((cells, 2, WIDTH))
    out[:] = DEFAULTS
    for name, given in terms.items():
        for column, constant in enumerate(TERMS[name].constants, COLUMNS[name][0]):
            if constant.name in given:
                out[:, :, column] = per_frustum(constant.name, given[constant.name], TERMS[name].kind, cells)
    return out
