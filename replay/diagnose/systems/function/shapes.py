"""Shapes of a law over one state: a table, and the formulas that may replace it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.systems.function.compiled import compiled

Floats = NDArray[np.float64]

#: Numbers of shapes in a law's row.
TABLE, CONSTANT, LINEAR, SQUARE, CUBE, QUADRATIC, SIGN, ROOT = range(8)
#: The same of shapes with constants of their own.
POWER, SATURATES, ABOVE, BELOW, FADES, STEP, OUTSIDE, UNEQUAL, WAVE, BUMP, FOLLOWS, GROWS, PLAY, YIELDS = range(8, 22)


@dataclass(frozen=True)
class Shape:
    """A formula over a state s: its text, its constants beside the strength, and their starts.

    ``constants`` are (name, start, low, high, of) in units of the state's span (``span``), from its lower end
    (``place``), or plain numbers (""), which have a logarithm unless they may be negative; ``unit`` is the
    power of the state's unit that the strength is divided by; ``positive`` its text for a state that is never negative.
    """

    number: int
    name: str
    text: str  # {s} the state, {0} and {1} its constants
    constants: tuple[tuple[str, float, float, float, str], ...] = ()
    unit: float = 0.0
    positive: str = ""


#: The shortest first. Starts and bounds in units of the state's span, 0 to 1, or plain numbers.
SHAPES = {
    shape.number: shape
    for shape in (
        Shape(CONSTANT, "constant", ""),
        Shape(LINEAR, "linear", "{s}", unit=1),
        Shape(SQUARE, "square with sign", "|{s}| {s}", unit=2, positive="{s}^2"),
        Shape(QUADRATIC, "square", "{s}^2", unit=2),
        Shape(CUBE, "cube", "{s}^3", unit=3),
        Shape(ROOT, "root with sign", "sign({s}) sqrt|{s}|", unit=0.5, positive="sqrt({s})"),
        Shape(SIGN, "sign", "tanh({s} / {0})", (("width", 0.02, 1e-4, 0.3, "span"),)),
        Shape(
            POWER,
            "power",
            "sign({s}) |{s} / span|^{0}",
            (("exponent", 1.5, 0.1, 6.0, ""),),
            positive="({s} / span)^{0}",
        ),
        Shape(
            SATURATES,
            "saturating",
            "{s} / (1 + |{s}| / {0})",
            (("knee", 0.2, 0.005, 5.0, "span"),),
            unit=1,
            positive="{s} / (1 + {s} / {0})",
        ),
        Shape(ABOVE, "above a threshold", "max(0, {s} - {0})", (("threshold", 0.6, 0.0, 1.0, "place"),), unit=1),
        Shape(BELOW, "below a threshold", "max(0, {0} - {s})", (("threshold", 0.4, 0.0, 1.0, "place"),), unit=1),
        Shape(
            OUTSIDE,
            "outside a dead band",
            "sign({s}) max(0, |{s}| - {0})",
            (("half_width", 0.25, 0.01, 1.0, "span"),),
            unit=1,
            positive="max(0, {s} - {0})",
        ),
        Shape(FADES, "fading", "exp(-({s} - {low}) / {0})", (("range", 0.3, 0.02, 5.0, "span"),)),
        Shape(GROWS, "growing", "exp(({s} - {high}) / {0})", (("range", 0.3, 0.02, 5.0, "span"),)),
        Shape(
            STEP,
            "step",
            "(1 + tanh(({s} - {0}) / {1})) / 2",
            (("place", 0.5, 0.0, 1.0, "place"), ("width", 0.05, 0.003, 0.5, "span")),
        ),
        Shape(
            UNEQUAL,
            "sign with offset",
            "(tanh({s} / {0}) + {1})",
            (("width", 0.02, 1e-4, 0.3, "span"), ("offset", 0.0, -0.95, 0.95, "")),
        ),
        Shape(
            BUMP,
            "bump",
            "exp(-(({s} - {0}) / {1})^2)",
            # with both flanks, down to 1/e, in what was visited: else it is any curve's end
            (("place", 0.5, 0.2, 0.8, "place"), ("width", 0.1, 0.01, 0.2, "span")),
        ),
        Shape(
            WAVE,
            "wave",
            "sin(2 pi {s} / {0} + {1})",
            (("period", 1.0, 0.2, 6.0, "span"), ("phase", 0.0, -3.2, 3.2, "")),
        ),
        # of a state and its own history: a reading or an input that lags, wholly where the strength is one
        Shape(FOLLOWS, "lag", "({s} - {now})", unit=1),
        # the same of one with backlash: it stays until the other has crossed the play
        Shape(PLAY, "play", "({s} - {now})", unit=1),
        # and of one that yields little by little (Dahl 1968)
        Shape(YIELDS, "gradual play", "({s} - {now})", unit=1),
    )
}


@compiled
def value(shape: int, p: Floats, at: int, many: int, s: float) -> float:
    """A law at state s: its parameters are ``many`` of p from ``at`` on: strength and constants of a formula, or of a
    table its points and their values."""
    if shape == TABLE:
        n = many // 2
        if s <= p[at]:
            return float(p[at + n])
        if s >= p[at + n - 1]:
            return float(p[at + 2 * n - 1])
        low, high = at, at + n - 1
        while high - low > 1:
            middle = (low + high) // 2
            if p[middle] <= s:
                low = middle
            else:
                high = middle
        share = (s - p[low]) / (p[high] - p[low])
        return float(p[n + low] * (1 - share) + p[n + high] * share)
    a = p[at]
    if shape == CONSTANT:
        return float(a)
    if shape in (LINEAR, FOLLOWS, PLAY, YIELDS):
        return float(a * s)
    if shape == SQUARE:
        return float(a * abs(s) * s)
    if shape == CUBE:
        return float(a * s * s * s)
    if shape == QUADRATIC:
        return float(a * s * s)
    if shape == SIGN:
        return float(a * np.tanh(s / p[at + 1]))
    if shape == ROOT:
        return float(a * np.sign(s) * np.sqrt(abs(s)))
    if shape == POWER:
        # in units of the state's span, so that strength and exponent do not trade
        return float(a * np.sign(s) * abs(s / p[at + 2]) ** p[at + 1])
    if shape == SATURATES:
        return float(a * s / (1 + abs(s) / p[at + 1]))
    if shape == ABOVE:
        return float(a * max(0.0, s - p[at + 1]))
    if shape == BELOW:
        return float(a * max(0.0, p[at + 1] - s))
    if shape == OUTSIDE:
        return float(a * np.sign(s) * max(0.0, abs(s) - p[at + 1]))
    if shape == FADES:
        return float(a * np.exp(-min(max((s - p[at + 2]) / p[at + 1], -50.0), 50.0)))
    if shape == GROWS:
        return float(a * np.exp(min(max((s - p[at + 2]) / p[at + 1], -50.0), 50.0)))
    if shape == UNEQUAL:
        return float(a * (np.tanh(s / p[at + 1]) + p[at + 2]))
    if shape == BUMP:
        return float(a * np.exp(-min(((s - p[at + 1]) / p[at + 2]) ** 2, 50.0)))
    if shape == WAVE:
        return float(a * np.sin(2 * np.pi * s / p[at + 1] + p[at + 2]))
    return float(a * 0.5 * (1 + np.tanh((s - p[at + 1]) / p[at + 2])))


@compiled
def values_of(shape: int, p: Floats, s: Floats) -> Floats:
    """A law at states (n,)."""
    out = np.empty_like(s)
    for k in range(len(s)):
        out[k] = value(shape, p, 0, len(p), s[k])
    return out
