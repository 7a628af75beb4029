"""Figures in the benchmarks' README: placeholders are well formed, and a command rewrites its own figures only."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from tests.benchmarks.figures import MARKED, README, publish

TEXT = """| what | figure |
|---|---|
| wrong | <!-- soak.wrong -->0<!-- / --> of <!-- soak.all -->10<!-- / --> |
| other | <!-- live.off -->2 ms<!-- / --> |

<!-- runs.table -->
| figures of | command | date | version | machine |
|---|---|---|---|---|
| live | `python -m tests.benchmarks.live` | 2026-01-02 | abc | here |
<!-- / -->
end
"""


@pytest.fixture
def readme(tmp_path: Path) -> Path:
    path = tmp_path / "README.md"
    path.write_text(TEXT)
    return path


def test_a_command_rewrites_its_own_figures_and_its_row(readme: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["/x/soak.py", "--exchanges", "20", "--write"])
    publish("soak", {"wrong": "1", "all": "20"}, True, readme)
    once = readme.read_text()
    assert "<!-- soak.wrong -->1<!-- / --> of <!-- soak.all -->20<!-- / -->" in once
    assert "<!-- live.off -->2 ms<!-- / -->" in once
    assert "| live | `python -m tests.benchmarks.live` | 2026-01-02 | abc | here |" in once
    assert re.search(r"^\| soak \| `python -m tests\.benchmarks\.soak --exchanges 20` \| \d{4}-\d\d-", once, re.M)
    assert once.endswith("<!-- / -->\nend\n")
    publish("soak", {"wrong": "1", "all": "20"}, True, readme)
    assert readme.read_text() == once


def test_without_write_nothing_changes(readme: Path) -> None:
    publish("soak", {"wrong": "1", "all": "20"}, False, readme)
    assert readme.read_text() == TEXT


@pytest.mark.parametrize("figures", [{"wrong": "1"}, {"wrong": "1", "all": "2", "more": "3"}])
def test_places_and_figures_must_agree(figures: dict[str, str], readme: Path) -> None:
    with pytest.raises(SystemExit, match="nothing was written"):
        publish("soak", figures, True, readme)
    assert readme.read_text() == TEXT


def test_every_place_in_the_readme_belongs_to_a_benchmark_that_publishes_its_group() -> None:
    text = README.read_text(encoding="utf-8")
    groups = {match["group"] for match in MARKED.finditer(text)} - {"runs"}
    assert text.count("<!-- / -->") == len(list(MARKED.finditer(text)))
    sources = "".join(path.read_text(encoding="utf-8") for path in README.parent.rglob("*.py"))
    assert groups == set(re.findall(r'publish\(\s*"([a-z0-9_]+)"', sources))
