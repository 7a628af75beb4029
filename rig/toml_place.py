"""At: a place in a TOML file, so that every error about a value can name it."""

from __future__ import annotations

import math
from typing import Any, NoReturn

from straw.rig.errors import RigError


class At:
    """``where`` is the place in words; the methods return a checked value or raise RigError with one line."""

    def __init__(self, where: str) -> None:
        self.where = where

    def fail(self, problem: str) -> NoReturn:
        """Raise RigError: the place, then the problem."""
        raise RigError(" ".join(f"{self.where}: {problem}".split()))

    def inside(self, place: str) -> At:
        """A place within this one."""
        return At(f"{self.where}: {place}")

    def known_keys(self, table: dict[str, Any], allowed: tuple[str, ...]) -> None:
        """Raise RigError for an unknown key."""
        for key in table:
            if key not in allowed:
                self.fail(f"unknown key {key!r}; known here: {', '.join(allowed)}")

    def number(self, value: object, what: str) -> float:
        """The value as a finite number."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.fail(f"{what} = {value!r} is not a number; write one without quotes")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.fail(f"{what} = {number} is not a finite number; write one")
        return number

    def integer(self, value: object, what: str, least: int) -> int:
        """The value as a whole number."""
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            self.fail(f"{what} = {value!r} must be a whole number of at least {least}")
        return value

    def string(self, value: object, what: str) -> str:
        """The value as text."""
        if not isinstance(value, str):
            self.fail(f"{what} = {value!r} must be text in quotes")
        return value

    def positive(self, value: object, what: str) -> float:
        """The value as a number above 0."""
        number = self.number(value, what)
        if number <= 0.0:
            self.fail(f"{what} = {number:g} must be above 0")
        return number
