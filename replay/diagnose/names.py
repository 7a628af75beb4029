"""Names of hypotheses in words."""

from __future__ import annotations

#: Judged names that are no causes.
NO_CAUSE = {"complete": "nothing missing", "unknown": "something outside the library"}


def words(name: str) -> str:
    """A hypothesis' name: ``squeeze_film+gauge_offset`` is squeeze film and gauge offset."""
    return NO_CAUSE.get(name) or name.replace("_", " ").replace("+", " and ")
