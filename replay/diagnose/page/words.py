"""Names as a person writes them."""

from __future__ import annotations

from collections.abc import Sequence


def words(name: str) -> str:
    """A hypothesis' name: ``squeeze_film+gauge_offset`` is squeeze film and gauge offset."""
    return name.replace("_", " ").replace("+", " and ")


def and_(names: Sequence[str]) -> str:
    """One, two and three."""
    return " and ".join([*filter(None, [", ".join(names[:-1])]), *names[-1:]])
