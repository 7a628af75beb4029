"""Functions whose sum may describe a missing force, by the kind of its state; all over the state in SI."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.formula import Atom, Shape
from straw.replay.diagnose.systems.straw.states import State
from straw.replay.diagnose.systems.straw.tables import APART

Floats = NDArray[np.float64]

#: Distance from a point, m, within which a force that fades levels off: where its fit starts, between a tenth of it and
#: ten times as much. Chosen, not derived or varied.
NEAR_M = 3e-3


def atoms(state: State, at: Floats) -> tuple[Atom, ...]:
    """The dictionary for a curve over a state with points at (n,), SI."""
    x = state.symbol
    if state.odd:  # over a size
        return (
            Atom(x, 1, lambda v, _: v, code_words="x"),
            Atom(f"|{x}| {x}", 2, lambda v, _: v**2, code_words="x**2"),
            Atom(f"{x}^3", 3, lambda v, _: v**3, code_words="x**3"),
            Atom(f"sign {x}", 0, lambda v, _: np.ones_like(v), code_words="1.0"),
        )
    if state.state_unit == "s":
        return (*_powers(x, 2), *_relaxing(x, at), *(_step(x, t, at) for t in _middles(at)[1:-1]))
    if state.state_unit == "cycles":
        return (*_powers(x, 2), Atom(f"(1 + {x})^-0.5", 0, lambda n, _: (1 + n) ** -0.5))
    if state.zero:  # a loss: through zero, either direction its own; through an orifice by the root
        root = Atom(f"sign({x}) |{x}|^0.5", 0.5, lambda q, _: np.sign(q) * np.sqrt(np.abs(q)))
        return (
            *((root,) if state.name == "leak" else ()),
            Atom(x, 1, lambda q, _: q),
            Atom(f"|{x}| {x}", 2, lambda q, _: np.abs(q) * q),
            Atom(f"|{x}|", 1, lambda q, _: np.abs(q)),
            Atom(f"{x}^2", 2, lambda q, _: q**2),
        )
    near = _near_folded(x, float(at[1])) if state.symbol == "zeta" else ()
    far = _fading_powers(x) if state.name == "tip distance" else ()
    return (*_powers(x, 3), *near, *far, *_kinks(x, at, state.state_unit))


def _kinks(x: str, at: Floats, unit: str) -> tuple[Atom, ...]:
    """Straight lines beyond an edge: outwards from zero, or above it where the state keeps its sign."""
    middles = _middles(at)
    edges = np.concatenate([middles[2:], at[2:-1]])
    beyond = [_beyond(x, edge, at, unit) for edge in edges if edge > 0 or at[0] >= 0 or at[-1] <= 0]
    return (*beyond, *(_below(x, edge, at, unit) for edge in (*middles[:-2], *at[1:-2]) if edge < 0 < at[-1]))


def _powers(x: str, most: int) -> tuple[Atom, ...]:
    texts = ("", x, *(f"{x}^{n}" for n in range(2, most + 1)))
    return tuple(
        Atom(text, n, lambda v, _, n=n: v**n, code_words=f"x**{n}" if n else "1.0")  # type: ignore[misc]
        for n, text in enumerate(texts)
    )


def _fading_powers(x: str) -> tuple[Atom, ...]:
    """Forces that fade with the distance, as those of charges and magnets do."""
    powers = (1, 2, 4)
    plain = (Atom(f"(10 mm/{x})^{n}", 0, lambda v, _, n=n: (0.01 / v) ** n) for n in powers)  # type: ignore[misc]
    return (*plain, *(fading_softly(n, x) for n in powers))


def fading_softly(power: int, x: str = "r") -> Atom:
    """A force that fades with a power of the distance, but levels off near the point, as bodies are no points."""
    return Atom(
        f"((10 mm)^2/({x}^2 + {{}}^2))^{power / 2:g}", 0, lambda v, near: (1e-4 / (v**2 + near**2)) ** (power / 2), 2,
        shape=Shape(NEAR_M, 1.0, NEAR_M / 10, 10 * NEAR_M, "mm", 1e3, ratio=True),
    )  # fmt: skip


def _middles(at: Floats) -> Floats:
    return np.asarray((at[1:] + at[:-1]) / 2)


def _relaxing(x: str, at: Floats) -> tuple[Atom, ...]:
    """What fades, and what warms up or sinks: exponentials of time, of a fortieth to 1.6 of the time covered, in three
    ranges that meet, as each start finds its own minimum."""
    spread, out = float(at[-1] - at[0]), []
    for share in (1 / 20, 1 / 5, 4 / 5):
        shape = Shape(spread * share, 1.0, spread * share / 2, 2 * spread * share, "s", ratio=True)
        out.append(Atom(f"exp(-{x}/{{}})", 0, lambda t, tau: np.exp(-t / tau), 2, shape=shape))
        out.append(Atom(f"(1 - exp(-{x}/{{}}))", 0, lambda t, tau: -np.expm1(-t / tau), 2, shape=shape))
    return tuple(out)


def _step(x: str, edge: float, at: Floats) -> Atom:
    """A step in time, drawn out as far as the points of a table are apart at least, so that its place can be fitted."""
    wide = 2 * APART * float(at[-1] - at[0])
    return Atom(f"[{x} > {{}}]", 0, partial(_ramp, wide), 2, shape=_edge(edge, at, "s"))


def _ramp(wide: float, v: Floats, edge: float) -> Floats:
    return np.asarray(np.clip((v - edge) / wide + 0.5, 0.0, 1.0))


def _beyond(x: str, edge: float, at: Floats, unit: str) -> Atom:
    """Nothing up to an edge, then a straight line."""
    shape = replace(_edge(edge, at, unit), offset=True)
    return Atom(f"max(0, {x} {{}})", 1, lambda v, edge: np.maximum(0.0, v - edge), 2, "max(0.0, x - {})", shape)


def _below(x: str, edge: float, at: Floats, unit: str) -> Atom:
    """A straight line up to an edge, then nothing."""
    shape = _edge(edge, at, unit)
    return Atom(f"max(0, {{}} - {x})", 1, lambda v, edge: np.maximum(0.0, edge - v), 2, "max(0.0, {} - x)", shape)


def _edge(edge: float, at: Floats, unit: str) -> Shape:
    """Where a kink lies: between the points next to the ends."""
    per, shown = (1e3, "mm") if unit == "m" else (1.0, unit)
    return Shape(float(edge), float(np.median(np.diff(at))), float(at[1]), float(at[-2]), shown, per)


def _near_folded(x: str, folded: float) -> tuple[Atom, ...]:
    """Forces between faces that nearly touch: over the gap from the folded rest height (m), for several ranges."""
    gap = f"{x} {'+' if folded < 0 else '-'} {1e3 * abs(folded):.2f} mm"
    over = f"x - {folded:.6g}"
    apart = f"max(0.0, {over})"
    out = []
    for reach in (0.1e-3, 0.2e-3, 0.4e-3, 0.8e-3):
        shape = Shape(reach, 1.0, reach / 2, 2 * reach, "mm", 1e3, ratio=True)
        out += [
            Atom(text, 0, partial(function, folded), 2, code, shape)
            for text, function, code in (
                (f"exp(-({gap})/{{}})", _fading, f"math.exp(-{apart} / {{}})"),
                (f"exp(-(({gap})/{{}})^2/2)", _well, f"math.exp(-((({over}) / {{}}) ** 2) / 2)"),
                (f"({gap})/{{0}} exp(1 - ({gap})/{{0}})", _rising, f"{apart} / {{0}} * math.exp(1 - {apart} / {{0}})"),
                (f"(1 + ({gap})/{{}})^-3", _film, f"(1 + {apart} / {{}}) ** -3"),
            )
        ]
    return tuple(out)


def _fading(folded: float, v: Floats, reach: float) -> Floats:
    return np.asarray(np.exp(-np.maximum(0.0, v - folded) / reach))


def _well(folded: float, v: Floats, reach: float) -> Floats:
    return np.asarray(np.exp(-(((v - folded) / reach) ** 2) / 2))


def _rising(folded: float, v: Floats, reach: float) -> Floats:
    gap = np.maximum(0.0, v - folded) / reach
    return np.asarray(gap * np.exp(1 - gap))


def _film(folded: float, v: Floats, reach: float) -> Floats:
    return np.asarray((1 + np.maximum(0.0, v - folded) / reach) ** -3)
