"""A user's own figure of merit: one number of a motion, computed for measurement and prediction alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from straw.model.plugged import said
from straw.replay.errors import ReplayError
from straw.rig import parts

if TYPE_CHECKING:
    from straw.replay.compare.judge import Motion

Floats = NDArray[np.float64]

#: Noisy copies of the measurement for a figure's standard uncertainty, which is known to 1 / sqrt(2 * 15).
DRAWS = 16


@dataclass(frozen=True)
class FigureOfMerit:
    """One number to compare: ``FIGURE = straw.FigureOfMerit(name="settling time", unit="s", about="...", value=f)``.

    ``value(motion)`` is called with the measured and with the predicted motion. A motion has ``time_s``, ``x_m``,
    ``z_m``, ``phi_rad`` and the gauge ``pressure_pa`` that drove it, each (n,), at the tip's valid samples, ``snaps``
    (``start_s``, ``end_s``, ``turn_rad``, ``cell``, ...) and ``ring`` (``frequency_hz``, ``decay_per_s``; None where
    nothing rings). NaN means that the figure does not exist in this motion.
    """

    name: str
    unit: str
    about: str
    value: Callable[[Motion], float]

    def __post_init__(self) -> None:
        where = f"figure of merit {self.name!r}"
        for name, what in (
            ("name", "what it is called"),
            ("unit", 'its unit, "1" for none'),
            ("about", "what it is"),
        ):
            text = getattr(self, name)
            if not isinstance(text, str) or not text.strip() or "\n" in text.strip():
                raise ReplayError(f"{where}: {name} = {text!r}; state in a line {what}")
        if not callable(self.value):
            raise ReplayError(f"{where}: value is no function; give value(motion), which gives one number")


FIGURES = parts.Kind("figure", ("FIGURE", "FIGURES"), FigureOfMerit)


def add_figures(*paths: str | Path) -> None:
    """Judge the figures of merit in these files, too; RigError, one line, for a file that gives none."""
    parts.add(FIGURES, paths)


def own_figures(measured: Motion, predicted: Motion, taken: Mapping[str, Any]) -> dict[str, tuple[str, float, float]]:
    """Unit, measured and predicted of every user's figure of merit, by name; ReplayError, one line, for an unusable
    one."""
    out: dict[str, tuple[str, float, float]] = {}
    for part in parts.parts(FIGURES):
        one: FigureOfMerit = part.what
        if one.name in taken or one.name in out:
            raise ReplayError(
                f"{part.where}: figure of merit {one.name!r}: there is one of this name; give yours another"
            )
        out[one.name] = one.unit, asked(part, measured, "measured"), asked(part, predicted, "predicted")
    return out


def asked(part: parts.Part, motion: Motion, which: str) -> float:
    """The figure of one motion, NaN where it has none; ReplayError where the function raises or gives no number."""
    one: FigureOfMerit = part.what
    where = f"{part.where}: figure of merit {one.name!r} of the {which} motion"
    try:
        given = one.value(motion)
    except Exception as error:  # the user's code may raise anything
        path = Path(part.where) if part.sha256 else None
        raise ReplayError(f"{where}: value raises {said(error, path)}; give NaN where there is none") from None
    if isinstance(given, bool) or np.ndim(given) != 0:
        what = f"an array of shape {np.shape(given)}" if np.ndim(given) else repr(given)
        raise ReplayError(f"{where}: value gives {what}; expected one number of {one.unit}")
    try:
        number = float(given)
    except (TypeError, ValueError):
        raise ReplayError(f"{where}: value gives {given!r:.60}; expected one number of {one.unit}") from None
    if math.isinf(number):
        raise ReplayError(f"{where}: value is {number}; give a finite number, or NaN where there is none")
    return number


def uncertainties(measured: Motion, again: Callable[[Motion], Motion]) -> dict[str, float]:
    """Standard uncertainty of each figure, by name, from the measurement's own sigma; NaN where that is unknown.

    The figure is computed for noisy copies, once with independent noise of each sample and once with all samples of a
    channel shifted by one sigma, as for correlated noise; the larger counts (Monte Carlo, JCGM 101:2008). ``again``
    finds snaps and ring-down in a copy.
    """
    if not parts.parts(FIGURES):
        return {}
    random = np.random.default_rng(0)
    moved = [again(_noisy(measured, lambda n: random.standard_normal(n))) for _ in range(DRAWS)]
    common = [again(_noisy(measured, lambda n: np.ones(n), only=name)) for name in measured.pose]
    out = {}
    for part in parts.parts(FIGURES):
        here = asked(part, measured, "measured")
        white = np.array([asked(part, motion, "measured") for motion in moved])
        lasting = np.array([asked(part, motion, "measured") for motion in common])
        known = np.all([np.all(np.isfinite(sigma)) for sigma in measured.sigma.values()])
        u = max(float(np.std(white, ddof=1)), float(np.sqrt(np.sum((lasting - here) ** 2))))
        out[part.what.name] = u if known and math.isfinite(here) else math.nan
    return out


def _noisy(motion: Motion, drawn: Callable[[int], Floats], only: str = "") -> Motion:
    n = len(motion.time_s)
    pose = {
        name: values + motion.sigma[name] * drawn(n) if only in ("", name) else values
        for name, values in motion.pose.items()
    }
    return replace(motion, pose=pose)
