"""Names as a person writes them."""

from __future__ import annotations

from collections.abc import Sequence

#: Units that are read in thousandths where numbers are small.
SMALL = {"m": "mm", "s": "ms", "rad": "mrad", "N": "mN", "N m": "mN m"}
POWERS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def words(name: str) -> str:
    """A hypothesis' name: ``squeeze_film+gauge_offset`` is squeeze film and gauge offset."""
    return name.replace("_", " ").replace("+", " and ")


def and_(names: Sequence[str]) -> str:
    """One, two and three."""
    return " and ".join([*filter(None, [", ".join(names[:-1])]), *names[-1:]])


def sig(value: float) -> str:
    """Three digits."""
    text = f"{value:.3g}".replace("e-0", "e-").replace("e+0", "e")
    head, _, power = text.partition("e")
    text = f"{head}·10{power.translate(POWERS).replace('-', '⁻')}" if power else head
    return text.replace("-", "−")


def quantity(values: Sequence[float], unit: str) -> str:
    """A value, or the two ends of an interval, with the unit in which they are read."""
    if unit in SMALL and max(map(abs, values)) < 0.1:
        values, unit = [1e3 * v for v in values], SMALL[unit]
    return f"{' to '.join(map(sig, values))} {unit}".removesuffix(" 1").strip()
