"""Numbers as people and programs write them: decimal commas, thousands, minus signs, words for missing values."""

from __future__ import annotations

import re
from collections.abc import Iterable

NOTHING = {"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "1.#qnan", "-1.#ind", "#nv", "nul"}
_SPACES = str.maketrans("", "", "'\u2019\u00a0\u202f\u2009")
_MINUS = str.maketrans({"\u2212": "-", "\u2013": "-"})  # Tracker writes a real minus sign, also in exponents
_LOOKS = re.compile(r"[-+\u2212\u2013]?(\d[\d.,'\u2019\u00a0\u202f\u2009]*|[.,]\d+)([eE][-+\u2212\u2013]?\d+)?$")
_MOMENT = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}([T ].*)?$|\d+:\d\d(:\d\d)?([.,:]\d+)?( ?[AaPp][Mm])?$")
_GROUPS = re.compile(r"[-+]?\d{1,3}([.,]\d{3})+$")


def is_nothing(text: str) -> bool:
    """Whether a cell stands for a missing value."""
    return text.strip().casefold() in NOTHING


def looks_numeric(text: str) -> bool:
    """Whether a cell may be a number, in one way of writing or another."""
    return bool(_LOOKS.match(text)) or text.casefold() in ("inf", "-inf", "+inf")


def looks_like_data(text: str) -> bool:
    """Whether a cell is a number or a moment, rather than a heading."""
    return looks_numeric(text) or bool(_MOMENT.match(text))


def number(text: str, decimal: str, thousands: str) -> float | None:
    """A cell as a number, NaN for a missing value, None where it is no number.

    ``thousands`` may be the decimal mark itself: then the last one is the decimal mark.
    """
    text = text.strip().translate(_MINUS).translate(_SPACES)
    if is_nothing(text):
        return float("nan")
    if thousands:
        if thousands == decimal:
            head, mark, tail = text.rpartition(decimal)
            text = head.replace(decimal, "") + mark + tail
        else:
            text = text.replace(thousands, "")
    if decimal != ".":
        if "." in text:
            return None
        text = text.replace(decimal, ".")
    if "_" in text:  # Python would take 1_000
        return None
    try:
        return float(text)
    except ValueError:
        return None


def marks(cells: Iterable[str], separator: str | None) -> tuple[str, str, str]:
    """Decimal mark and thousands mark of cells that look numeric, and a description of what is ambiguous."""
    commas: list[str] = []
    points: list[str] = []
    both: list[str] = []
    for cell in cells:
        text = cell.translate(_MINUS).translate(_SPACES)
        if "," in text:
            (both if "." in text else commas).append(text)
        elif "." in text:
            points.append(text)
    if both:
        decimal = max(",.", key=both[0].rfind)
        return decimal, "." if decimal == "," else ",", ""
    if commas and separator != ",":
        several = next((text for text in commas if text.count(",") > 1), "")
        if several:
            return ".", ",", ""
        if not points:
            if any(not _GROUPS.match(text) or text.lstrip("-+").startswith("0") for text in commas):
                return ",", "", ""
            return ",", "", f"{commas[0]!r} is read as {commas[0].replace(',', '.')}, not as thousands"
    several = next((text for text in points if text.count(".") > 1), "")
    if not several:
        return ".", "", ""
    if any(text.count(".") == 1 and (not _GROUPS.match(text) or text.lstrip("-+").startswith("0")) for text in points):
        head, _, tail = several.rpartition(".")
        return ".", ".", f"{several!r} is read as {head.replace('.', '')}.{tail}"
    return ",", ".", f"{several!r} is read as {several.replace('.', '')}"
