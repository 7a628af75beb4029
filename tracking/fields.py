"""Reads fields of JSON files and writes JSON; anything wrong becomes one line with file, field and cure."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

from straw.tracking.errors import TrackingError

_LARGEST_FILE_BYTES = 1_000_000  # a camera file is a few kB; anything bigger is the wrong file


def reason(error: OSError) -> str:
    """Return the operating system's reason in a few words."""
    return (error.strerror or type(error).__name__).lower()


class Fields:
    """A JSON object being read: every getter checks the type and names the place when it is wrong."""

    def __init__(self, data: Any, where: str) -> None:
        if not isinstance(data, dict):
            raise TrackingError(f"{where}: expected a JSON object {{...}}, got {type(data).__name__}")
        self.data: dict[str, Any] = data
        self.where = where

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Fields:
        """Read a JSON file; TrackingError when it is missing, not JSON, or its top level is not an object."""
        try:
            if Path(path).stat().st_size > _LARGEST_FILE_BYTES:
                raise TrackingError(f"{path}: too large for a camera file; give the JSON of the camera, not the video")
            text = Path(path).read_text(encoding="utf-8-sig")
        except OSError as error:
            raise TrackingError(f"{path}: cannot read the camera file ({reason(error)}); check the path") from error
        except UnicodeDecodeError as error:
            raise TrackingError(f"{path}: not a text file; give the JSON of a camera or a lens profile") from error
        return cls.parse(text, str(path))

    @classmethod
    def parse(cls, text: str, where: str) -> Fields:
        """Parse JSON text; ``where`` names its origin in messages."""
        try:
            return cls(json.loads(text), where)
        except json.JSONDecodeError as error:
            line = f"line {error.lineno}, column {error.colno}: {error.msg}"
            raise TrackingError(f"{where}: not valid JSON ({line}); repair that line or save the file again") from error
        except (RecursionError, ValueError) as error:  # nested too deeply, or an integer of thousands of digits
            raise TrackingError(
                f"{where}: JSON nested too deeply or with too large a number; save the camera file again"
            ) from error

    def __contains__(self, name: str) -> bool:
        return self.data.get(name) is not None

    def wrong(self, name: str, expected: str) -> NoReturn:
        """Raise the one-line error about this field."""
        if name not in self.data:
            raise TrackingError(f"{self.where}: '{name}' is missing; add it as {expected}")
        shown = repr(self.data[name])
        shown = shown if len(shown) <= 60 else shown[:57] + "..."
        raise TrackingError(f"{self.where}: '{name}' is {shown}; it must be {expected}")

    def child(self, name: str) -> Fields:
        """Return the JSON object under ``name``."""
        if not isinstance(self.data.get(name), dict):
            self.wrong(name, "a JSON object {...}")
        return Fields(self.data[name], f"{self.where}: {name}")

    def text(self, name: str, default: str | None = None) -> str:
        """Return a string."""
        value = self.data.get(name, default)
        return value if isinstance(value, str) else self.wrong(name, "text in quotes")

    def number(self, name: str, default: float | None = None) -> float:
        """Return a finite number."""
        value = as_number(self.data.get(name, default))
        return value if value is not None else self.wrong(name, "a finite number")

    def integer(self, name: str) -> int:
        """Return a whole number."""
        value = self.data.get(name)
        return value if isinstance(value, int) and not isinstance(value, bool) else self.wrong(name, "a whole number")

    def numbers(self, name: str, count: int | None = None) -> tuple[float, ...]:
        """Return a flat list of finite numbers."""
        value = self.data.get(name)
        found = [as_number(item) for item in value] if isinstance(value, list) else [None]
        good = [number for number in found if number is not None]
        if len(good) != len(found) or (count is not None and len(good) != count):
            self.wrong(name, f"a list of {'' if count is None else f'{count} '}finite numbers")
        return tuple(good)

    def matrix(self, name: str, size: int) -> tuple[tuple[float, ...], ...]:
        """Return a square matrix written as a list of rows."""
        value = self.data.get(name)
        rows = value if isinstance(value, list) else []
        found = [[as_number(item) for item in row] if isinstance(row, list) else [] for row in rows]
        good = [tuple(number for number in row if number is not None) for row in found]
        if len(found) != size or any(
            len(row) != size or len(kept) != size for row, kept in zip(found, good, strict=True)
        ):
            self.wrong(name, f"{size} rows of {size} finite numbers")
        return tuple(good)


def as_number(value: Any) -> float | None:
    """Return a finite float, or None for anything else (JSON's true is an int to Python, and NaN parses)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def write_json(path: str | os.PathLike[str], data: Mapping[str, Any]) -> None:
    """Write JSON beside the target and rename it into place: the old file or the new one, never half of it."""
    target = Path(path)
    part = target.with_name(target.name + ".part")
    try:
        part.write_text(json.dumps(data, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        part.replace(target)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise TrackingError(
            f"{path}: cannot write the file ({reason(error)}); check the folder and its space"
        ) from error
