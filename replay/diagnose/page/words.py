"""Names, values and units as text for people."""

from __future__ import annotations

import re
from collections.abc import Sequence

#: Units that are read in thousandths where numbers are small.
SMALL = {"m": "mm", "s": "ms", "rad": "mrad", "N": "mN", "N m": "mN m"}
MINUS = "\u2212"
#: A constant's description begins with its symbol: "c, damping at rest"; its name ends with its unit.
SYMBOL, UNIT = re.compile(r"(\S{1,8})(?:[,;] (.*))?"), re.compile(r"_(m|m2|m3|s|n|pa|rad|kg)(_.*)?$")
POWERS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def and_(names: Sequence[str]) -> str:
    """One, two and three."""
    return " and ".join([*filter(None, [", ".join(names[:-1])]), *names[-1:]])


def sig(value: float) -> str:
    """Three digits."""
    text = f"{value:.3g}".replace("e-0", "e-").replace("e+0", "e")
    head, _, power = text.partition("e")
    text = f"{head}·10{power.translate(POWERS).replace('-', '⁻')}" if power else head
    return text.replace("-", MINUS)


def quantity(value: float, low: float, high: float, unit: str) -> tuple[str, str]:
    """A value with its display unit, and an interval in the same unit."""
    if unit in SMALL and abs(value) < 0.1:
        value, low, high, unit = 1e3 * value, 1e3 * low, 1e3 * high, SMALL[unit]
    return f"{sig(value)} {raised(unit)}".removesuffix(" 1"), f"{sig(low)} to {sig(high)}"


def raised(unit: str) -> str:
    """A unit with its powers raised: kg/m^4."""
    return re.sub(r"\^(-?\d+)", lambda found: found[1].translate(POWERS).replace("-", "⁻"), unit)


def symbol_of(name: str, about: str) -> tuple[str, str]:
    """A constant's symbol and description, from its name and description."""
    found = SYMBOL.fullmatch(about)
    return (found[1], found[2] or "") if found else (UNIT.sub("", name), about)
