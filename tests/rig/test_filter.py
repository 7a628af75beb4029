"""The filter language of the lab's page and of ``straw runs list --where`` selects the right runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from straw.replay.cli import main
from straw.rig.catalogue import Entry
from straw.rig.columns import differing, ordered
from straw.rig.errors import RigError
from straw.rig.filter import compiled
from tests.rig.test_catalogue import recorded


def entry(name: str, **said: object) -> Entry:
    return Entry(name, 1, 1, **{"kind": "run", "run_id": name, **said})  # type: ignore[arg-type]


A = entry("a", specimen="Straw-7", protocol="fold-25kPa", cycle=20, tags=("good",), marks=("star",), start_ns=3)
B = entry("b", specimen="straw-8", cycle=3, notes=(("t", "Leaks at the base"),), metadata={"rate_hz": "50"}, start_ns=1)
C = entry("c", kind="part", problem="cut", duration_s=2.5, marks=("archive",), start_ns=2)
ALL = (A, B, C)


@pytest.mark.parametrize(
    ("text", "picked"),
    [
        ("", "abc"),
        ("specimen = straw-7", "a"),
        ("specimen != straw-7", "bc"),  # a run without a specimen is not straw-7
        ('specimen = ""', "c"),
        ("specimen ~ straw", "ab"),
        ("specimen !~ straw", "c"),
        ("cycle >= 20", "a"),
        ("cycle < 20", "bc"),
        ("cycle > 2 cycle < 20", "b"),  # adjacent terms are combined by "and"
        ("rate_hz = 50", "b"),
        ("rate_hz > 10", "b"),  # a number, not a text
        ("tag = good or note ~ leak", "ab"),
        ("not (tag = good or cut)", "b"),
        ("starred", "a"),
        ("archived and damaged", "c"),
        ("leaks base", "b"),
        ('"leaks at"', "b"),
        ("FOLD", "a"),
        ("tag = good and cycle > 30 or cut", "c"),
        ("duration > 2", "c"),
    ],
)
def test_a_filter_selects_by_its_terms(text: str, picked: str) -> None:
    test = compiled(text, ["rate_hz"])
    assert "".join(e.name for e in ALL if test(e)) == picked


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("specimn = x", "did you mean specimen"),
        ("rate = 3", "no such column"),
        ("(cycle > 3", r"at its end: a \) is missing"),
        ("cycle >", "a value is missing after cycle >"),
        ("= 3", "a column or a word was expected"),
        ("cycle > 3 )", "nothing was open here"),
        ('note ~ "leak', "close the quotes"),
        ("a or", "something is missing"),
    ],
)
def test_an_invalid_filter_is_an_error_with_its_place(text: str, said: str) -> None:
    with pytest.raises(RigError, match=said):
        compiled(text)


def test_sorting_puts_missing_values_last_in_either_order() -> None:
    assert [e.name for e in ordered(list(ALL), "specimen")] == ["a", "b", "c"]
    assert [e.name for e in ordered(list(ALL), "-specimen")] == ["b", "a", "c"]
    assert [e.name for e in ordered(list(ALL), "-start")] == ["a", "c", "b"]


def test_only_columns_that_differ_are_kept() -> None:
    assert differing([A, B], ["kind", "specimen", "cycle", "duration"]) == ["specimen", "cycle"]


def test_the_command_line_has_the_same_filter_and_the_marks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recorded(tmp_path / "a.mcap")
    recorded(tmp_path / "b.mcap", "s2", minute=5)
    assert main(["runs", "star", "b", "--dir", str(tmp_path)]) == 0
    assert main(["runs", "lock", "b", "--dir", str(tmp_path)]) == 0
    assert main(["runs", "archive", "b", "--dir", str(tmp_path)]) == 2
    assert "b.mcap is locked" in capsys.readouterr().err
    assert main(["runs", "list", "--dir", str(tmp_path), "--where", "starred and specimen = S2"]) == 0
    said = capsys.readouterr().out
    assert "b.mcap" in said
    assert "a.mcap" not in said
    assert main(["runs", "list", "--dir", str(tmp_path), "--where", "starred and"]) == 2
    assert main(["runs", "list", "--dir", str(tmp_path), "--sort", "nonsense"]) == 2
    assert main(["runs", "lock", "b", "--dir", str(tmp_path), "--remove"]) == 0
    assert main(["runs", "archive", "b", "--dir", str(tmp_path)]) == 0
