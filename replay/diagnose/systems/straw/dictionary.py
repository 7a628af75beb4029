"""Functions whose sum may describe a missing force, by the kind of its state; all over the state in SI."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.formula import Atom
from straw.replay.diagnose.systems.straw.states import State

Floats = NDArray[np.float64]


def atoms(state: State, at: Floats) -> tuple[Atom, ...]:
    """The dictionary for a curve over a state with points at (n,), SI."""
    x = state.symbol
    if state.odd:  # over a size
        return (
            Atom(x, 1, lambda v: v, code="x"),
            Atom(f"|{x}| {x}", 2, lambda v: v**2, code="x**2"),
            Atom(f"{x}^3", 3, lambda v: v**3, code="x**3"),
            Atom(f"sign {x}", 0, lambda v: np.ones_like(v), code="1.0"),
        )
    if state.state_unit == "s":
        return (*_powers(x, 2), *(_step(x, t) for t in _middles(at)))
    if state.state_unit == "cycles":
        return (*_powers(x, 2), Atom(f"(1 + {x})^-0.5", 0, lambda n: (1 + n) ** -0.5))
    if state.zero:  # a loss: through zero, either direction its own
        return (
            Atom(x, 1, lambda q: q),
            Atom(f"|{x}| {x}", 2, lambda q: np.abs(q) * q),
            Atom(f"|{x}|", 1, np.abs),
            Atom(f"{x}^2", 2, lambda q: q**2),
        )
    if (state.state_unit == "m" and state.value_unit != "N") or state.name == "height":
        return (*_powers(x, 3), *_near_folded(x, float(at[1])))
    edges = _middles(at)[2:]
    return (*_powers(x, 3), *(_beyond(x, edge, state.state_unit) for edge in (*edges, *at[2:-1])))


def _powers(x: str, most: int) -> tuple[Atom, ...]:
    texts = ("", x, *(f"{x}^{n}" for n in range(2, most + 1)))
    return tuple(
        Atom(text, n, lambda v, n=n: v**n, code=f"x**{n}" if n else "1.0")  # type: ignore[misc]
        for n, text in enumerate(texts)
    )


def _middles(at: Floats) -> Floats:
    return np.asarray((at[1:] + at[:-1]) / 2)


def _step(x: str, edge: float) -> Atom:
    return Atom(f"[{x} > {edge:.2f} s]", 0, lambda v: (v > edge).astype(float), 2)


def _beyond(x: str, edge: float, unit: str) -> Atom:
    sign = "-" if edge > 0 else "+"
    return Atom(
        f"max(0, {x} {sign} {abs(edge):.3g} {unit})",
        1,
        lambda v: np.maximum(0.0, v - edge),
        2,
        f"max(0.0, x - {edge:.6g})",
    )


def _near_folded(x: str, folded: float) -> tuple[Atom, ...]:
    """Forces between faces that nearly touch: over the gap from the folded rest height (m), for several ranges."""
    gap = f"{x} {'+' if folded < 0 else '-'} {1e3 * abs(folded):.2f} mm"
    out = []
    for reach in (0.1e-3, 0.2e-3, 0.4e-3, 0.8e-3):
        mm = f"{1e3 * reach:.1f} mm"
        out += [
            Atom(
                f"exp(-({gap})/{mm})",
                0,
                partial(_fading, folded, reach),
                2,
                f"math.exp(-max(0.0, x - {folded:.6g}) / {reach})",
            ),
            Atom(
                f"exp(-(({gap})/{mm})^2/2)",
                0,
                partial(_well, folded, reach),
                2,
                f"math.exp(-(((x - {folded:.6g}) / {reach}) ** 2) / 2)",
            ),
            Atom(
                f"(1 + ({gap})/{mm})^-3",
                0,
                partial(_film, folded, reach),
                2,
                f"(1 + max(0.0, x - {folded:.6g}) / {reach}) ** -3",
            ),
        ]
    return tuple(out)


def _fading(folded: float, reach: float, v: Floats) -> Floats:
    return np.asarray(np.exp(-np.maximum(0.0, v - folded) / reach))


def _well(folded: float, reach: float, v: Floats) -> Floats:
    return np.asarray(np.exp(-(((v - folded) / reach) ** 2) / 2))


def _film(folded: float, reach: float, v: Floats) -> Floats:
    return np.asarray((1 + np.maximum(0.0, v - folded) / reach) ** -3)
