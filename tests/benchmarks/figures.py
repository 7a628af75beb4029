"""Figures of README.md: with --write a benchmark replaces its own and the row of its last run.

A figure stands between comments as GROUP.NAME, `<!-- soak.wrong -->0<!-- / -->`; a command replaces all figures of a
group at once, so that no group mixes two runs. The last runs are in a table between the comments of `runs.table`.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

README = Path(__file__).with_name("README.md")
MARKED = re.compile(r"<!-- (?P<group>[a-z0-9_]+)\.(?P<name>[a-z0-9-]+) -->(?P<text>.*?)<!-- / -->", re.DOTALL)
RUNS = ("runs", "table")


def write_option(parser: argparse.ArgumentParser) -> None:
    """Add --write."""
    parser.add_argument("--write", action="store_true", help="rewrite the figures in tests/benchmarks/README.md")


def publish(group: str, figures: Mapping[str, str], write: bool, readme: Path = README) -> None:
    """Replace a group's figures in the README, and the row of its last run; does nothing unless ``write``.

    Raises SystemExit, one line, unless the README has a place for each figure and a figure for each place.
    """
    if not write:
        return
    text = readme.read_text(encoding="utf-8")
    places = [match["name"] for match in MARKED.finditer(text) if match["group"] == group]
    if sorted(places) != sorted(figures):
        strange = sorted(set(places) ^ set(figures)) or sorted(places)
        sys.exit(f"{readme}: places and figures of {group} differ in {', '.join(strange)}; nothing was written")

    def replaced(match: re.Match[str]) -> str:
        if match["group"] != group:
            return match[0]
        return f"<!-- {group}.{match['name']} -->{figures[match['name']]}<!-- / -->"

    readme.write_text(_with_run(MARKED.sub(replaced, text), group), encoding="utf-8")
    print(f"{readme}: {len(figures)} figures of {group} rewritten")


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as a figure, on lines of its own."""
    lines = (f"| {' | '.join(words)} |" for words in (head, ["---"] * len(head), *rows))
    return "\n".join(["", *lines, ""])


def missed(text: str, good: bool) -> str:
    """A figure, bold where it misses its target."""
    return text if good else f"**{text}**"


def _with_run(text: str, group: str) -> str:
    """The text with the row of a group's run in the table of runs, in alphabetical order."""
    held = next((m for m in MARKED.finditer(text) if (m["group"], m["name"]) == RUNS), None)
    if held is None:
        sys.exit(f"no table of runs: add <!-- {'.'.join(RUNS)} --> and <!-- / -->; nothing was written")
    head, rule, *rows = held["text"].strip().splitlines()
    rows = [row for row in rows if not row.startswith(f"| {group} |")]
    words = [word for word in sys.argv[1:] if word != "--write"]
    command = " ".join(["python -m", f"tests.benchmarks.{_name(Path(sys.argv[0]))}", *words])
    today = datetime.now(UTC).date().isoformat()
    rows.append(f"| {group} | `{command}` | {today} | {_version()} | {_machine()} |")
    table_text = "\n".join([head, rule, *sorted(rows)])
    return f"{text[: held.start('text')]}\n{table_text}\n{text[held.end('text') :]}"


def _name(path: Path) -> str:
    """Of a benchmark, which is a file or a folder."""
    return path.parent.name if path.stem == "__main__" else path.stem


def _version() -> str:
    """The last tag and the commit, with a plus sign if files differ from it."""
    command = ["git", "-C", str(README.parent), "describe", "--tags", "--always", "--dirty=+"]
    said = subprocess.run(command, capture_output=True, text=True)
    return said.stdout.strip() if said.returncode == 0 else "no git checkout"


def _machine() -> str:
    """Processor, cores, system, Python, and the load at the end of the run, which affects timings."""
    listed = Path("/proc/cpuinfo")
    lines = listed.read_text(encoding="utf-8").splitlines() if listed.exists() else []
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    named = model or platform.processor() or platform.machine()
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{named}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}{load}"
