"""Numbers of the diagnosis: each says its reason, and those that change answers are few and in one file."""

from __future__ import annotations

import ast

from tests.benchmarks.constants import ROOT, SETTINGS, numbers


def test_every_number_of_the_diagnosis_has_its_reason_beside_it() -> None:
    found = numbers()
    assert len(found) > 100
    assert [f"{one.file}:{one.line} {', '.join(one.names)}" for one in found if len(one.reason.split()) < 2] == []


def test_at_most_forty_settings_decide_over_answers_and_each_is_used() -> None:
    settings = [name for one in numbers() if one.file == SETTINGS for name in one.names]
    assert len(settings) == len(set(settings))
    assert 20 < len(settings) <= 40
    used = {
        name.name
        for path in ROOT.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module == "straw.replay.diagnose.settings"
        for name in node.names
    }
    assert sorted(set(settings) - used) == []
