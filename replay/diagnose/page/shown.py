"""A system's contributions to the page of a diagnosis: picture, laws, motion, next experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from straw.replay.diagnose.fit import Fit
    from straw.replay.diagnose.hypothesis import Unknown

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LawCurve:
    """A law over one state: ``at`` (n,), ``values`` (n,) and one standard deviation ``sigmas`` (n,), labels of axes.

    ``parts``: whether the points are separate ones, as of cells, and no line.
    """

    at: Floats
    values: Floats
    sigmas: Floats
    over: str
    shows: str
    parts: bool = False
    others: tuple[tuple[str, Floats, Floats], ...] = ()  # what is drawn beside it: label, at, values


@dataclass(frozen=True, eq=False)
class Law:
    """A cause as a law: its formula in one line, descriptions of its constants by name, its curve."""

    formula: str
    source: str = ""
    about: Mapping[str, str] = field(default_factory=dict)
    curve: LawCurve | None = None


@dataclass(frozen=True)
class Drawing:
    """An SVG element (or nothing) and what it shows."""

    svg: str = ""
    caption: str = ""
    commands: tuple[str, ...] = ()  # commands that run the experiment


class Shown:
    """The page's contents for a system; by default its channels only."""

    def picture(self, model: Any, places: Sequence[int], causes: Sequence[str]) -> Drawing:
        """The system with the place of what was found marked; ``places`` are those of the events that differ most."""
        return Drawing()

    def about(self, cause: str) -> Mapping[str, str]:
        """Descriptions of a cause's constants by name: "c, damping at rest"."""
        return {}

    def law(self, cause: str, fit: Fit, covariance: Floats) -> Law | None:
        """A cause as fitted; ``covariance`` of the fit's u, for the band."""
        return None

    def played(self, recording: Any, unknowns: Sequence[Unknown], u: Floats) -> dict[str, Any]:
        """The player's data of a recording beside its channels (`straw.replay.report.data`), with unknowns at u."""
        return {}

    def experiment(self, proposed: Any) -> Drawing:
        """The next experiment, and the commands that run it."""
        return Drawing()
