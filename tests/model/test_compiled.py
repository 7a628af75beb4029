"""Compiled code: each signature loads its own from disk, and no function is compiled as its callers happen to be."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from straw.model.compiled import allocates_nothing, exposed, fused
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


def test_how_a_function_rounds_does_not_depend_on_which_of_its_callers_is_compiled_first() -> None:
    @allocates_nothing
    def product_and_sum(a: float, b: float, c: float) -> float:
        return a * b + c

    @exposed
    def rounded(a: float, b: float, c: float) -> float:
        return product_and_sum(a, b, c)

    @fused
    def in_one(a: float, b: float, c: float) -> float:
        return product_and_sum(a, b, c)

    @exposed
    def first(a: float, b: float, c: float) -> float:
        return in_one(a, b, c)

    less = 1 - 2.0**-30
    first(less, 2 - less, -1.0)
    assert rounded(less, 2 - less, -1.0) == 0.0  # the exact product is 1 - 2**-60, which rounds to 1


def test_a_function_that_only_compiled_code_may_call_says_so() -> None:
    @allocates_nothing
    def twice(a: float) -> float:
        return 2 * a

    @exposed
    def four_times(a: float) -> float:
        return twice(twice(a))

    assert four_times(1.5) == 6.0
    with pytest.raises(TypeError, match="twice: only compiled code may call it"):
        twice(1.5)
