"""Compiled code on disk: what one process keeps is never loaded for another signature."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from straw.model.compiled import compiled as of_model
from straw.tracking.compiled import compiled as of_tracking


@pytest.mark.parametrize("compiled", [of_model, of_tracking])
def test_two_processes_that_compile_different_signatures_at_the_same_time_keep_both_apart(
    compiled: Callable[[Any], Any], tmp_path: Path
) -> None:
    """The second one looks at the index before the first has written to it, and writes its code before the first's."""
    path = tmp_path / "doubling.py"
    path.write_text("def twice(x):\n    return 2 * x\n")
    spec = importlib.util.spec_from_file_location("doubling", path)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    first, second, third = (compiled(module.twice) for _ in range(3))
    second._cache._cache_file._load_index = dict
    writes = first._cache._cache_file._save_data

    def after_the_second(name: str, code: Any) -> None:
        second(2.5)
        writes(name, code)

    first._cache._cache_file._save_data = after_the_second
    assert first(3) == 6
    assert third(2.5) == 5.0
    assert sum(third.stats.cache_hits.values()) == 1
