"""The page holds the comparison in one file, whatever characters a recording's names contain."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
from typing import Any

import numpy as np

from straw.model.parameters import StrawParameters
from straw.replay.compare.comparison import Comparison, compare
from straw.replay.report.page import page
from tests.replay.test_compare import recorded

STRAW = StrawParameters()


def compared(**changes: Any) -> Comparison:
    run, _ = recorded(STRAW)
    return compare(dataclasses.replace(run, **changes), STRAW)


def data_in(text: str) -> Any:
    found = re.search(r'<script id="data" type="application/json">(.*?)</script>', text, flags=re.DOTALL)
    assert found
    return json.loads(found[1])


def unpacked(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4")


def test_the_page_holds_the_measurement_and_the_prediction_in_the_units_it_shows() -> None:
    comparison = compared()
    (run,) = data_in(page([comparison]))
    x, phi = comparison.signals["x_m"], comparison.signals["phi_rad"]
    np.testing.assert_allclose(unpacked(run["signals"]["x_m"]["measured"]), x.measured * 1e3, rtol=1e-6)
    np.testing.assert_allclose(unpacked(run["signals"]["phi_rad"]["predicted"]), np.degrees(phi.predicted), rtol=1e-6)
    assert len(unpacked(run["pressure"]["measured"])) == len(comparison.run.pressure or ())


def test_names_that_look_like_markup_are_escaped() -> None:
    nasty = "</script><script>alert(1)</script>"
    text = page([compared(run_id=nasty, specimen=nasty, lost=(nasty,))])
    assert "<script>alert" not in text
    (run,) = data_in(text)
    assert run["id"] == nasty


def test_a_recording_without_sigmas_or_a_command_still_makes_a_page() -> None:
    run, _ = recorded(STRAW)
    assert run.tip is not None
    unknown = np.full(len(run.tip), np.nan)
    tip = dataclasses.replace(run.tip, sigma_x_m=unknown, sigma_z_m=unknown, sigma_phi_rad=unknown)
    (shown,) = data_in(page([compared(tip=tip)]))
    assert shown["signals"]["x_m"]["metrics"]["reduced_chi2"] is None
    assert shown["signals"]["x_m"]["sigma"] is None
    assert shown["pressure"]["command"] is None


def test_the_page_of_many_runs_names_the_worst() -> None:
    run, _ = recorded(STRAW)
    assert run.tip is not None
    off = dataclasses.replace(run.tip, z_m=run.tip.z_m + 1e-3)
    text = page([compared(), compared(run_id="the bad one", tip=off)])
    assert "2 runs" in text
    assert "the worst run, the bad one, is off by" in text


def test_braces_in_a_name_are_kept() -> None:
    (run,) = data_in(page([compared(run_id="{{script}}")]))
    assert run["id"] == "{{script}}"
