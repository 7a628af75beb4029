"""Units: what they are in SI, where a heading names one, and which one a column of numbers looks like."""

from __future__ import annotations

import math
import re

import numpy as np
from numpy.typing import NDArray

from straw.rig.errors import RigError

#: By quantity: unit and what one of it is in SI. Conventional factors of NIST SP 811, appendix B.
UNITS: dict[str, dict[str, float]] = {
    "pressure": {
        "Pa": 1.0, "hPa": 1e2, "mbar": 1e2, "kPa": 1e3, "bar": 1e5, "MPa": 1e6, "psi": 6894.757293168361,
        "mmHg": 133.322387415, "cmH2O": 98.0665, "inH2O": 249.08891,
    },
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "px": math.nan},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "labview": 1.0, "excel": 86400.0},
    "flow": {"m^3/s": 1.0, "ul/min": 1e-9 / 60, "ml/min": 1e-6 / 60, "l/min": 1e-3 / 60, "ul/s": 1e-9, "ml/s": 1e-6},
    "number": {"1": 1.0},
}  # fmt: skip
#: Other spellings; compared without case and blanks.
_ALSO = {
    "pascal": "Pa", "millibar": "mbar", "torr": "mmHg", "barg": "bar", "barü": "bar", "psig": "psi",
    "metre": "m", "meter": "m", "millimeter": "mm", "millimetre": "mm", "micron": "um", "inch": "in", "pixel": "px",
    "pixels": "px", "pix": "px", "radian": "rad", "radians": "rad", "°": "deg", "degree": "deg", "degrees": "deg",
    "sec": "s", "seconds": "s", "second": "s", "sek": "s", "millisecond": "ms", "milliseconds": "ms", "msec": "ms",
    "microseconds": "us", "nanoseconds": "ns", "minutes": "min", "hours": "h", "hr": "h", "m3/s": "m^3/s", "μs": "us",
}  # fmt: skip
_SPELLINGS = {
    re.sub(r"\s", "", word).casefold().replace("μ", "u").replace("µ", "u"): unit
    for word, unit in [*((u, u) for units in UNITS.values() for u in units), *_ALSO.items()]
}
#: Largest size (SI) that a run's column can plausibly have. Pressure: from one step of the quasi-static search, below
#: which no cell stirs, to the strongest regulator sold, 8 bar. Length: from a cell's shortest to a straw of a hundred
#: cells. Angle: a full turn and one to spare.
PLAUSIBLE = {"pressure": (0.5e3, 8.0e5), "length": (1.0e-3, 1.0), "angle": (0.0, 4.0 * math.pi)}
#: What is typical, by which units that are all plausible are put in order: a snap; a cell or two; a right angle.
TYPICAL = {"pressure": 20e3, "length": 0.05, "angle": 1.5}


def unit_of(text: str, quantity: str | None = None) -> str:
    """A unit by any of its spellings, "" where it is none (of this quantity)."""
    unit = _SPELLINGS.get(re.sub(r"\s", "", text).casefold().replace("μ", "u").replace("µ", "u"), "")
    return unit if unit and (quantity is None or unit in UNITS[quantity]) else ""


def unit_in(heading: str) -> str:
    """The unit that a heading names: in brackets, after a slash, comma or "in", or as the end of a name_unit."""
    for pattern in (r"[\[(]([^\])]*)[\])]\s*$", r"(?:/|,|\bin\b)\s*([^\s/,]+)\s*$", r"_([A-Za-zµμ°]+)$"):
        if (found := re.search(pattern, heading)) and (unit := unit_of(found[1])):
            return unit
    return ""


def bare(heading: str) -> str:
    """A heading without its unit, in small letters, words apart."""
    text = re.sub(r"[\[(][^\])]*[\])]\s*$", "", heading)
    if unit_in(heading) and text == heading:
        text = re.sub(r"(?:/|,|_|\bin\b)\s*[^\s/,_]+\s*$", "", heading)
    return re.sub(r"[\s_\-.:]+", " ", text).strip().casefold()


def factor(unit: str, quantity: str, where: str) -> float:
    """A unit in SI; RigError where it is no unit of the quantity."""
    if known := unit_of(unit, quantity):
        return UNITS[quantity][known]
    raise RigError(f"{where}: {unit!r} is not a unit of {quantity}; known: {', '.join(UNITS[quantity])}")


def largest(values: NDArray[np.float64]) -> float:
    """The magnitude of a column: the largest of its numbers without 1 % of glitches; 0 where there is none."""
    size = np.abs(values[np.isfinite(values)])
    return float(np.quantile(size, 0.99)) if len(size) else 0.0


def looks_like(values: NDArray[np.float64], quantity: str) -> list[str]:
    """Units in which the column would be plausible, the most typical first; all of them where it is 0 throughout."""
    size = largest(values)
    units = [(unit, size * si) for unit, si in UNITS[quantity].items() if math.isfinite(si)]
    if quantity not in PLAUSIBLE or size == 0.0:
        return [unit for unit, _ in units]
    low, high = PLAUSIBLE[quantity]
    fits = [(abs(math.log(si / TYPICAL[quantity])), unit) for unit, si in units if low <= si <= high]
    order = ["kPa", "mbar", "Pa", "bar", "mm", "m", "deg", "rad"]  # of two equally likely ones the more usual
    usual = [unit for _, unit in sorted(fits) if unit in order]
    return usual + [unit for _, unit in sorted(fits) if unit not in order]


def check_size(values: NDArray[np.float64], unit: str, quantity: str, where: str, flag: str) -> None:
    """RigError where a column in this unit would be implausibly large, with units that would fit."""
    si = UNITS[quantity].get(unit, math.nan)
    size = largest(values)
    if quantity not in PLAUSIBLE or not math.isfinite(si) or size == 0.0:
        return
    low, high = PLAUSIBLE[quantity]
    if low <= size * si <= high:
        return
    others = looks_like(values, quantity)
    cure = f'looks like {" or ".join(others[:2])}: give {flag} "... in {others[0]}"' if others else "is it this column?"
    raise RigError(f"{where}: up to {size:g} {unit} is not plausible ({size * si:g} SI); {cure}, or --as-stated")
