"""Every number at module level of the diagnosis, with the reason that stands beside it.

    python -m tests.benchmarks.constants               # all
    python -m tests.benchmarks.constants systems/straw # of one folder or file

What changes answers is a setting (`settings.py`, 40 at most), which `python -m tests.benchmarks.settings` halves and
doubles. The others are definitions, units, starts and limits of a method, and stand beside their use.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import straw.replay.diagnose

ROOT = Path(straw.replay.diagnose.__path__[0])
SETTINGS = "settings.py"


@dataclass(frozen=True)
class Number:
    """One assignment: its file below the diagnosis, line, names, value as written, and the comment on it or above."""

    file: str
    line: int
    names: tuple[str, ...]
    value: str
    reason: str


def numbers() -> list[Number]:
    """All of them, by file and line."""
    return [one for path in sorted(ROOT.rglob("*.py")) for one in _of(path)]


def _of(path: Path) -> Iterator[Number]:
    """Those of a file."""
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        if not any(_is_number(part) for part in ast.walk(node.value)):
            continue
        first, last = node.lineno - 1, node.end_lineno or node.lineno
        above = first
        while above and lines[above - 1].startswith("#"):
            above -= 1
        beside = [line.partition("  # ")[2] for line in lines[first:last]]
        reason = " ".join(line.lstrip("#: ") for line in (*lines[above:first], *beside) if line)
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = [part.id for target in targets for part in ast.walk(target) if isinstance(part, ast.Name)]
        yield Number(path.relative_to(ROOT).as_posix(), node.lineno, tuple(names), ast.unparse(node.value), reason)


def _is_number(part: ast.AST) -> bool:
    return isinstance(part, ast.Constant) and isinstance(part.value, int | float) and not isinstance(part.value, bool)


def main() -> None:
    """Print them, one a line, and their count."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("below", nargs="?", default="", metavar="FOLDER", help="files whose path begins so (all)")
    found = [one for one in numbers() if one.file.startswith(ask.parse_args().below)]
    for one in found:
        value = one.value if len(one.value) < 60 else f"{one.value[:56]} ..."
        print(f"{one.file}:{one.line}  {', '.join(one.names)} = {value}  # {one.reason or 'NO REASON'}")
    settings = sum(len(one.names) for one in found if one.file == SETTINGS)
    print(f"{settings} settings and {sum(len(one.names) for one in found) - settings} other names of numbers")


if __name__ == "__main__":
    main()
