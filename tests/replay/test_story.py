"""The page of a diagnosis: each figure once, laws typeset, moment and place of the misfit shown, for any system."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.model.terms import TERMS
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.findings import Findings, conclude
from straw.replay.diagnose.fit import Contestant, Fit, fitted
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.page.fits import law_curve
from straw.replay.diagnose.page.mathml import mathml
from straw.replay.diagnose.page.moment import parting
from straw.replay.diagnose.page.report import story
from straw.replay.diagnose.page.shown import LawCurve
from straw.replay.diagnose.page.story import Story
from straw.replay.diagnose.page.words import quantity, symbol_of
from straw.replay.diagnose.page.write import written
from straw.replay.diagnose.systems.oscillator.system import OscillatorSystem
from straw.replay.diagnose.systems.straw.library import causes, hypothesis
from straw.replay.diagnose.systems.straw.portrait import PLACES, place_of, portrait
from straw.replay.diagnose.systems.straw.shown import StrawShown
from tests.replay.browser import asked
from tests.replay.test_system import stiffening

CUBIC = 5e9


@pytest.fixture(scope="module")
def told() -> tuple[Story, Findings]:
    """Findings on three recordings of an oscillator with a stiffening spring, made without a search."""
    first, second = stiffening(CUBIC)
    runs = [first, second, replace(second, name="again")]
    with ThreadPoolExecutor() as pool:
        campaign = Campaign(runs, OscillatorSystem(), pool)
        base = campaign.system.base
        found = Inquiry(campaign, fitted(campaign, base, np.zeros(len(base)), rounds=20), whole=True)
        for name in ("cubic_stiffness", "dry_friction"):
            cause = campaign.hypothesis([name])
            u = np.concatenate([found.null.u, cause.starts[0]])
            found.keep(Contestant(cause, fitted(campaign, (*base, *cause.unknowns), u, rounds=40)))
        findings = conclude(found, brief=True)
        return story(findings, found), findings


def elements(formula: str) -> list[str]:
    """Names of a formula's elements; raises where they are not properly nested."""
    return [one.tag for one in ET.fromstring(f"<p>{mathml(formula)}</p>").iter()]


def test_an_article_is_a_word_and_a_coefficient_a_symbol() -> None:
    assert "<mtext>&#160;a&#160;</mtext>" in mathml("p follows x with a gradual play of ±6.9 kPa")
    assert "<mi>a</mi><mi>x</mi>" in mathml("F = a x")
    assert "<mi>a</mi><mi>ζ</mi>" in mathml("F = a zeta")


def test_every_law_of_the_library_is_typeset_in_well_formed_mathml() -> None:
    for term in TERMS.values():
        assert "math" in elements(term.law), term.name


def test_a_fraction_a_power_a_root_and_a_rate_are_typeset_as_such() -> None:
    assert "mfrac" in elements("F = -c (g/h)^3 zeta'")
    assert elements("x^2 + sqrt(y)").count("msup") == 1
    assert "msqrt" in elements("x^2 + sqrt(y)")
    assert elements("d v/dt = ... + (0.2 N s/m) v").count("mfrac") == 1  # the unit is no fraction of symbols
    assert "mtext" not in elements("rho/2 A")  # A is an area here, not ampere
    for broken in ("(((", "a/", "^", "|x", "sqrt(", "<b>&"):
        elements(broken)


def test_an_interval_is_stated_in_the_unit_of_its_value() -> None:
    assert quantity(2e-4, 1e-4, 3e-4, "m") == ("0.2 mm", "0.1 to 0.3")
    assert quantity(1.0, 0.5, 1.5, "1") == ("1", "0.5 to 1.5")
    assert quantity(8e6, 1e6, 9e6, "kg/m^4") == ("8·10⁶ kg/m⁴", "1·10⁶ to 9·10⁶")
    assert symbol_of("gap_m", "g, gap of the folded faces") == ("g", "gap of the folded faces")
    assert symbol_of("tau_s", "time constant of the line") == ("tau", "time constant of the line")


def test_the_page_starts_at_the_moment_of_the_largest_difference() -> None:
    time_s = np.linspace(0.0, 10.0, 1001)
    other = np.sin(time_s)[None]
    one = other + 0.3 * np.exp(-(((time_s - 7.0) / 0.05) ** 2))
    moment, (low, high) = parting(time_s, one, other)
    assert moment == pytest.approx(7.0, abs=0.02)
    assert low < 7.0 < high
    assert high - low < 2.0


def test_the_portrait_marks_what_a_cause_acts_on() -> None:
    straw = StrawParameters()
    assert {place_of(cause) for cause in causes(straw.cells)} <= set(PLACES)
    film = portrait(straw, (2, 4), ["squeeze_film"])
    assert film.svg.count("cell marked") == 4  # two frusta each
    assert "cells 2 and 4" in film.caption
    gauge = portrait(straw, (), ["gauge_offset"])
    assert "device marked" in gauge.svg
    assert "gauge" in gauge.caption
    assert "marked" not in portrait(straw, (), []).svg.replace("marked: nothing", "")


def test_every_cause_of_a_straw_is_shown_as_a_law_and_all_but_two_as_a_curve_with_its_band() -> None:
    straw, without = StrawParameters(), set()
    for name in causes(straw.cells):
        cause = hypothesis([name], straw.cells)
        u = np.array(cause.starts[-1])
        fit = Fit(cause.unknowns, u, np.zeros(1), np.zeros((1, len(u))), 0.0)
        law = StrawShown(straw).law(name, fit, 1e-2 * np.eye(len(u)))
        assert law is not None, name
        assert elements(law.formula), name
        if law.curve is None:
            without.add(name)
        else:
            assert np.all(np.isfinite(law.curve.values)), name
            assert np.any(law.curve.sigmas > 0), name
    assert without == {"odd_frusta_compliance", "wall_elasticity"}  # shares of one number: over nothing


def test_the_page_shows_the_figures_of_the_findings(told: tuple[Story, Findings]) -> None:
    page, findings = told
    assert findings.verdict == "missing_physics"
    assert findings.held is not None
    (error,), (channel,) = page.errors, OscillatorSystem().channels
    rms = (findings.held.before, findings.held.after, findings.held.floor)
    assert (error.before, error.after, error.noise) == pytest.approx(
        tuple(channel.shown_per_si * row[channel.name] for row in rms)
    )
    (law,) = page.laws
    (constant,) = law.constants
    assert constant.low < CUBIC < constant.high
    chosen = [one for one in page.rivals if one.chosen]
    assert [one.name for one in chosen] == ["cubic stiffness"]
    assert chosen[0].probability == findings.judgement.probability["cubic_stiffness"]
    assert {one[0] for one in page.unseen} == {"dry friction"}  # the alternatives to what was found


def test_the_page_needs_no_network_and_has_one_measure_of_misfit(told: tuple[Story, Findings]) -> None:
    text = written(told[0])
    assert not re.findall(r'(?:src|href)="(?!data:|#)', text)
    read = re.sub(r"<(script|style).*?</\1>", "", text, flags=re.DOTALL).lower()
    assert "chi-square" not in read
    assert "unexplained" not in read


def test_a_system_without_a_drawing_is_played_as_curves(told: tuple[Story, Findings], tmp_path: Path) -> None:
    script = """return { charts: charts.length, at: now, said: document.querySelector('#who').textContent,
        drawn: document.querySelectorAll('#straw, .pressure').length, series: charts[0].series.map((s) => s.label),
        width: document.documentElement.scrollWidth - innerWidth };"""
    found = asked(written(told[0]), script, tmp_path)
    assert found["errors"] == []
    answer = found["answer"]
    assert answer["charts"] == 2  # the channel and its residual
    assert answer["at"] == pytest.approx(told[0].runs[0]["at"])
    assert answer["said"] == "improved model"
    assert answer["drawn"] == 0
    assert {"measured", "base", "improved model"} <= set(answer["series"])
    assert answer["width"] <= 0


@pytest.mark.parametrize("at", [np.linspace(0, 1, 20), np.sin(np.linspace(0, 6, 40))])
def test_a_law_is_drawn_with_its_band_in_the_theme_s_colours(at: np.ndarray) -> None:
    drawn = law_curve(LawCurve(at, at**2, 0.1 + 0 * at, "x / mm", "F / N"))
    ET.fromstring(drawn)
    assert "var(--after)" in drawn
    assert not re.search(r"#0[1-6]0[1-6]0[1-6]", drawn)
