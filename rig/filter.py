"""Filter: the one language that picks recordings, on the lab's page and in ``straw runs list --where``.

    specimen = straw-7 and (cycle >= 20 or tag = good) and not archived
    protocol ~ fold highest > 30 "leaks at the base"

A comparison is a column, one of = != < <= > >= ~ !~ (contains), and a value; comparisons side by side are joined by
``and``. A word by itself is a flag (starred, archived, locked, cut, damaged) or is searched for in run, specimen,
protocol, tags and notes. Case is ignored. An absent value equals "" and is neither less nor greater than any other.
"""

from __future__ import annotations

import difflib
import operator
import re
from collections.abc import Callable, Collection, Iterable
from typing import NoReturn, TypeAlias

from straw.rig.catalogue import Entry
from straw.rig.columns import COLUMNS, Value, value_of
from straw.rig.errors import RigError

Test: TypeAlias = Callable[[Entry], bool]
TOKEN = re.compile(
    r"""\s*(?:(?P<quoted>"[^"]*"|'[^']*')|(?P<sign>!=|!~|<=|>=|[=<>~()])|(?P<word>[^\s=<>~!()"']+)|(?P<bad>\S))"""
)
ORDERS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
SIGNS = ("=", "!=", "~", "!~", *ORDERS)
FLAGS: dict[str, Test] = {
    "starred": lambda e: "star" in e.marks,
    "archived": lambda e: "archive" in e.marks,
    "locked": lambda e: "lock" in e.marks,
    "cut": lambda e: e.kind == "part",
    "damaged": lambda e: bool(e.problem),
}


def compiled(text: str, more: Iterable[str] = ()) -> Test:
    """The test that a filter means; RigError, naming the place, where it is not valid. Empty text matches everything.

    ``more`` are columns beyond ``COLUMNS``: the metadata that the recordings carry (``columns.metadata_names``).
    """
    parser = _Parser(text, {*COLUMNS, *more})
    if not parser.tokens:
        return lambda entry: True
    test = parser.either()
    if parser.at < len(parser.tokens):
        parser.fail("nothing was open here")
    return test


class _Parser:
    """Recursive descent: either := both ('or' both)*; both := one ('and'? one)*; one := 'not' one | '(' .. | test."""

    def __init__(self, text: str, names: Collection[str]) -> None:
        self.text, self.names, self.at = text, names, 0
        self.tokens: list[tuple[str, str, int]] = []
        for match in TOKEN.finditer(text):
            kind = match.lastgroup or ""
            if kind == "bad":
                raise RigError(
                    f"filter {text!r}: {match['bad']!r} at {match.start('bad') + 1} is not understood; close the quotes"
                )
            value = match[kind]
            self.tokens.append((kind, value[1:-1] if kind == "quoted" else value, match.start(kind)))

    def fail(self, problem: str) -> NoReturn:
        place = (
            f"at {self.tokens[self.at][1]!r} (place {self.tokens[self.at][2] + 1})"
            if self.at < len(self.tokens)
            else "at its end"
        )
        raise RigError(f"filter {self.text!r} {place}: {problem}")

    def next_is(self, *words: str) -> bool:
        if self.at >= len(self.tokens):
            return False
        kind, value, _ = self.tokens[self.at]
        return kind != "quoted" and value.lower() in words

    def either(self) -> Test:
        tests = [self.both()]
        while self.next_is("or"):
            self.at += 1
            tests.append(self.both())
        return tests[0] if len(tests) == 1 else lambda entry: any(test(entry) for test in tests)

    def both(self) -> Test:
        tests = [self.one()]
        while self.at < len(self.tokens) and not self.next_is("or", ")"):
            self.at += self.next_is("and")
            tests.append(self.one())
        return tests[0] if len(tests) == 1 else lambda entry: all(test(entry) for test in tests)

    def one(self) -> Test:
        if self.at >= len(self.tokens):
            self.fail("something is missing; write a comparison such as specimen = straw-7")
        if self.next_is("not"):
            self.at += 1
            inner = self.one()
            return lambda entry: not inner(entry)
        if self.next_is("("):
            self.at += 1
            inner = self.either()
            if not self.next_is(")"):
                self.fail("a ) is missing")
            self.at += 1
            return inner
        kind, value, _ = self.tokens[self.at]
        if kind == "sign" or self.next_is("and", "or"):
            self.fail("a column or a word was expected; put text in quotes")
        self.at += 1
        if kind == "word" and self.next_is(*SIGNS):
            return self.comparison(value)
        return FLAGS[value.lower()] if kind == "word" and value.lower() in FLAGS else _anywhere(value.lower())

    def comparison(self, name: str) -> Test:
        if name not in self.names:
            self.at -= 1
            near = difflib.get_close_matches(name, self.names, 1)
            self.fail(f"no such column; {f'did you mean {near[0]}?' if near else 'known: ' + ', '.join(COLUMNS)}")
        sign = self.tokens[self.at][1]
        self.at += 1
        if self.at >= len(self.tokens) or self.tokens[self.at][0] == "sign":
            self.fail(f"a value is missing after {name} {sign}")
        wanted = self.tokens[self.at][1]
        self.at += 1
        return _comparison(name, sign, wanted)


def _comparison(name: str, sign: str, wanted: str) -> Test:
    number = _number(wanted)
    low = wanted.lower()

    def holds(value: Value) -> bool:
        if isinstance(value, tuple):
            return any(map(holds, value)) if value else holds(None)
        if sign == "~":
            return value is not None and low in str(value).lower()
        if sign == "=":
            return low == "" if value is None else value == number if isinstance(value, float) else value.lower() == low
        if value is None:
            return False
        if isinstance(value, float):
            return number is not None and bool(ORDERS[sign](value, number))
        return bool(ORDERS[sign](value.lower(), low))

    if sign.startswith("!"):
        same = _comparison(name, sign[1:], wanted)
        return lambda entry: not same(entry)
    return lambda entry: holds(value_of(entry, name))


def _anywhere(word: str) -> Test:
    def found(entry: Entry) -> bool:
        texts = (entry.run_id, entry.specimen, entry.protocol, entry.name, *entry.tags, *(t for _, t in entry.notes))
        return word in "\n".join(texts).lower()

    return found


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
