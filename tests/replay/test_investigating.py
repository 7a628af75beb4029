"""The closed loop's benchmark: what counts as an answer, what it costs, and wrong causes that only the loop names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.apparatus.cases import Case
from tests.apparatus.effects import Cause
from tests.benchmarks.investigating_score import end_of, score
from tests.benchmarks.rows import kept, worked_out

FILM = Case("develop-001", "single", (Cause("squeeze_film", 1.0),), 1)
NULL = Case("develop-002", "null", (), 2)
OTHER = Case("develop-003", "unknown", (Cause("unknown", 1.0, "a wind"),), 3)


def row(case: Case, way: str, reason: str, causes: tuple[str, ...] = (), rounds: int = 8) -> dict[str, Any]:
    spent = {"rounds": rounds, "minutes": rounds / 10, "snaps": 3 * rounds}
    told = [{"probability": dict.fromkeys(causes, 0.92)}]
    return {"name": case.name, "way": way, "reason": reason, "verdict": reason, "causes": list(causes), **spent} | {
        "diagnoses": told,
        "cpu_s": 60.0,
    }


@pytest.mark.parametrize(
    ("case", "reason", "causes", "end"),
    [
        (FILM, "named", ("squeeze_film",), "right"),
        (FILM, "named", ("cohesion",), "wrong name"),
        (FILM, "named", ("squeeze_film", "cohesion"), "wrong name"),
        (FILM, "complete", (), "missed"),
        (FILM, "budget", ("squeeze_film",), "undecided"),  # less certain than was asked for
        (NULL, "complete", (), "right"),
        (NULL, "named", ("cohesion",), "wrong name"),
        (OTHER, "unknown", (), "right"),
        (OTHER, "named", ("cohesion",), "wrong name"),
    ],
)
def test_an_answer_is_right_only_if_it_is_certain_and_correct(
    case: Case, reason: str, causes: tuple[str, ...], end: str
) -> None:
    assert end_of(case, row(case, "loop", reason, causes)) == end


def test_costs_are_compared_where_both_are_right_and_wrong_causes_are_reported() -> None:
    rows = [
        row(FILM, "loop", "named", ("squeeze_film",), 3),
        row(FILM, "fixed", "named", ("squeeze_film",)),
        row(NULL, "loop", "named", ("cohesion",), 2),
        row(NULL, "fixed", "complete"),
    ]
    said = score([FILM, NULL, OTHER], {(r["name"], r["way"]): r for r in rows}, ["loop", "fixed"])
    assert "loop against fixed: wrong names gained 1 of 2 (develop-002); both right in 1; rounds 3 of 8 (38 %)" in said


def halved(number: int) -> dict[str, Any]:
    return {"name": str(number), "half": 12 // number}


def test_rows_are_written_as_they_come_and_what_failed_is_repeated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "rows.jsonl"
    done = list(worked_out({"1": (1,), "0": (0,), "3": (3,)}, halved, path, jobs=1))
    assert [one["half"] for one in done] == [12, 4]
    assert kept(path) == done
    assert "0: Traceback" in capsys.readouterr().out
