"""A formula for a curve: a sum of few functions of its state, with coefficients and constants of shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.hypothesis import Unknown

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """A constant inside a function, SI, within bounds: where a kink lies, or how far a force reaches.

    ``step`` is a typical change: of its value, or of its logarithm where it is a ``ratio``. Shown times ``per`` in
    ``unit``; an ``offset`` is shown with its sign, as what is subtracted.
    """

    value: float
    step: float
    low: float
    high: float
    unit: str
    per: float = 1.0
    ratio: bool = False
    offset: bool = False
    sigma: float = 0.0  # one deviation, zero while it is not fitted

    @property
    def text(self) -> str:
        """The number with its unit, and its deviation where it was fitted."""
        size = abs(self.value) if self.offset else self.value
        known = f"({size * self.per:.3g} ± {self.sigma * self.per:.2g})" if self.sigma else f"{size * self.per:.3g}"
        return f"{self.sign}{known} {self.unit}"

    @property
    def sign(self) -> str:
        """The operator before an offset."""
        return "" if not self.offset else "- " if self.value > 0 else "+ "

    def unknown(self) -> tuple[Unknown, float]:
        """To be searched within its bounds, and u at its value."""
        if self.ratio:
            low, high = (float(np.log(end / self.value)) / self.step for end in (self.low, self.high))
            return Unknown("shape", self.step, self.value, "log", sd=max(high, -low), low=low, high=high), 0.0
        low, at, high = (end / self.step for end in (self.low, self.value, self.high))
        return Unknown("shape", self.step, kind="linear", mean=at, sd=high - low, low=low, high=high), at


@dataclass(frozen=True)
class Atom:
    """One function of the state and perhaps of a constant of its shape, ``function(x, shape)``.

    Its ``words`` and its ``code``, Python over x for a law's file, have {} where that constant stands; no code where no
    law of the straw depends on the state. ``power`` is that of the state's unit; ``numbers``, how many constants it
    has, is the cost of choosing it.
    """

    words: str
    power: float
    function: Callable[[Floats, float], Floats]
    numbers: int = 1
    code_words: str = ""
    shape: Shape | None = None

    @property
    def text(self) -> str:
        """As a formula."""
        return self.words.format(self.shape.text) if self.shape else self.words

    def named(self, name: str) -> str:
        """As a formula with a name for the constant of its shape."""
        if self.shape is None:
            return self.words
        return self.words.format(f"- {name}" if self.shape.offset else name)

    @property
    def code(self) -> str:
        """As Python over x."""
        return self.code_words.format(f"{self.shape.value:.6g}") if self.shape else self.code_words

    def of(self, x: Floats) -> Floats:
        """Values at states x (n,)."""
        return self.function(x, self.shape.value if self.shape else 0.0)

    def shaped(self, value: float, sigma: float = 0.0) -> Atom:
        """With another constant of its shape."""
        return replace(self, shape=replace(self.shape, value=value, sigma=sigma)) if self.shape else self


@dataclass(frozen=True)
class Formula:
    """A sum of atoms with coefficients (SI) and one sigma of each, and how much of the curve's gain it keeps."""

    symbol: str
    atoms: tuple[Atom, ...]
    coefficients: Floats
    sigmas: Floats
    units: tuple[str, ...]
    keeps: float

    @property
    def text(self) -> str:
        """In one line, coefficients in SI units."""
        parts = [
            " ".join(word for word in (f"({c:.3g} ± {s:.2g})", unit if unit != "1" else "", atom.text) if word)
            for atom, c, s, unit in zip(self.atoms, self.coefficients, self.sigmas, self.units, strict=True)
        ]
        return f"{self.symbol} = {' + '.join(parts)}"

    def of(self, x: Floats) -> Floats:
        """Values at states x (n,)."""
        return np.asarray(sum(c * atom.of(x) for c, atom in zip(self.coefficients, self.atoms, strict=True)))

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        rows = zip(self.atoms, self.coefficients, self.sigmas, self.units, strict=True)
        return {
            "text": self.text,
            "terms": [
                {
                    "function": atom.shaped(atom.shape.value).text if atom.shape else atom.text or "1",
                    "coefficient": float(c),
                    "sigma": float(s),
                    "unit": unit,
                    "shape": {"value": atom.shape.value, "sigma": atom.shape.sigma} if atom.shape else None,
                }
                for atom, c, s, unit in rows
            ],
            "keeps": self.keeps,
        }


@dataclass(frozen=True, eq=False)
class Sum:
    """A curve at points ``at`` (n,) as a sum of atoms: unknowns are shares of the coefficients ``start``, then shapes.

    ``scale`` (n,) is what the curve's values are per u.
    """

    atoms: tuple[Atom, ...]
    start: Floats
    at: Floats
    scale: Floats

    @property
    def numbers(self) -> int:
        """How many constants it has."""
        return sum(atom.numbers for atom in self.atoms)

    def unknowns(self) -> tuple[tuple[Unknown, ...], Floats]:
        """They, and u where the sum starts."""
        shapes = [atom.shape.unknown() for atom in self.atoms if atom.shape]
        shares = [Unknown(f"coefficient.{n}", 1.0, kind="linear", sd=100.0) for n in range(len(self.atoms))]
        return (*shares, *(one for one, _ in shapes)), np.array([1.0] * len(shares) + [u for _, u in shapes])

    def atoms_at(self, u: Floats, sigmas: Floats | None = None) -> tuple[Atom, ...]:
        """The atoms with their shapes at u, and the deviations (of u) given."""
        unknowns, _ = self.unknowns()
        out, k = [], len(self.atoms)
        for atom in self.atoms:
            if atom.shape:
                sigma = 0.0 if sigmas is None else abs(unknowns[k].per_u(float(u[k]))) * float(sigmas[k])
                atom = atom.shaped(unknowns[k].value(float(u[k])), sigma)
                k += 1
            out.append(atom)
        return tuple(out)

    def coefficients(self, u: Floats) -> Floats:
        """Coefficients (atoms,), SI."""
        return self.start * u[: len(self.atoms)]

    def values(self, u: Floats) -> Floats:
        """The curve's u at its points (n,)."""
        table = np.stack([atom.of(self.at) for atom in self.atoms_at(u)], axis=1)
        return np.asarray(table @ self.coefficients(u) / self.scale)
