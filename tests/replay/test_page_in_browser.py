"""The page opened in headless Chromium: no error, everything drawn, the keyboard works, no network request."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.replay.compare.comparison import Comparison, compare
from straw.replay.report.page import page
from tests.replay.browser import asked
from tests.replay.test_compare import recorded

PRESS = "const press = (key) => document.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true }));"
#: How many colours a canvas shows, and which part of it is not empty.
INK = """const ink = (id) => { const c = document.getElementById(id), d = c.getContext('2d').getImageData(0, 0, c.width,
  c.height).data; const seen = new Set(); let full = 0; for (let k = 0; k < d.length; k += 4) if (d[k + 3]) { full++;
  seen.add(d[k] << 16 | d[k + 1] << 8 | d[k + 2]); } return [seen.size, full / (d.length / 4)]; };"""


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    run, _ = recorded(StrawParameters())
    return compare(run, StrawParameters())


def test_everything_is_drawn_without_an_error(comparison: Comparison, tmp_path: Path) -> None:
    script = (
        INK
        + """return { straw: ink('straw'), plane: ink('plane'), charts: charts.length,
        drawn: document.querySelectorAll('.u-wrap canvas').length,
        width: document.documentElement.scrollWidth - innerWidth,
        rows: document.querySelectorAll('#numbers tr').length };"""
    )
    found = asked(page([comparison]), script, tmp_path)
    assert found["errors"] == []
    answer = found["answer"]
    assert answer["charts"] == answer["drawn"] == 9  # three channels with residuals, pressure, zeta, phi
    for name in ("straw", "plane"):
        colours, share = answer[name]
        assert colours > 8
        assert share > 0.1
    assert answer["rows"] > 15
    assert answer["width"] <= 0  # nothing overflows sideways


def test_the_keyboard_moves_time_zooms_and_changes_the_theme(comparison: Comparison, tmp_path: Path) -> None:
    script = (
        PRESS
        + """
        const out = {}, samples = arraysOf(runs[0]).shapeTime;
        press('Home'); out.home = now; press('ArrowRight'); out.next = now; press('End'); out.end = now;
        press('0'); const all = charts[0].scales.x.max - charts[0].scales.x.min;
        press('+'); await null; await null;
        out.zoomed = (charts[3].scales.x.max - charts[3].scales.x.min) / all; press('0');
        const before = document.documentElement.dataset.theme; press('d');
        out.themes = [before, document.documentElement.dataset.theme];
        press('ArrowDown'); out.second = document.querySelector('#run h2').textContent;
        press('?'); out.help = document.getElementById('keys').open;
        return { ...out, samples: [samples[0], samples[1], samples[samples.length - 1]] };"""
    )
    other = dataclasses.replace(comparison, run=dataclasses.replace(comparison.run, run_id="another"))
    found = asked(page([comparison, other]), script, tmp_path)
    assert found["errors"] == []
    answer = found["answer"]
    assert [answer["home"], answer["next"], answer["end"]] == pytest.approx(answer["samples"])
    assert answer["zoomed"] == pytest.approx(0.5, abs=0.3)
    assert sorted(answer["themes"]) == ["dark", "light"]
    assert (answer["second"], answer["help"]) == ("another", True)


def test_the_straw_on_the_page_ends_where_the_model_says(comparison: Comparison, tmp_path: Path) -> None:
    """The page's own kinematics against the model's tip at every sample; 16-bit shapes err by less than 1 um."""
    script = """const a = arraysOf(runs[0]); return a.zeta.map((z, k) => { const c = chainOf(runs[0], z, a.phi[k]);
        return c[c.length - 1].end; });"""
    ends = np.array(asked(page([comparison]), script, tmp_path)["answer"])
    p = comparison.prediction
    np.testing.assert_allclose(ends[:, 0], p.x_m, atol=2e-6)
    np.testing.assert_allclose(ends[:, 1], p.z_m, atol=2e-6)
    np.testing.assert_allclose(ends[:, 2], p.phi_rad, atol=1e-4)


@pytest.mark.parametrize(
    "straw",
    [
        StrawParameters(),
        StrawParameters(elasticity="shell"),
        StrawParameters().with_term("wall_elasticity", share=0.4),
    ],
    ids=["equation 7", "finite elements", "between"],
)
def test_the_energy_on_the_page_is_that_of_the_straws_walls(
    straw: StrawParameters, comparison: Comparison, tmp_path: Path
) -> None:
    """Differences, as the page's energy is up to a constant; the last two lie beyond the end at the slant."""
    from straw.model.frustum_table import frustum_of

    places = [(2e-3, 0.1, 0.0), (-1e-3, 0.2, -2e4), (-0.13e-3, 0.215, 1e4), (3.9e-3, 0.0, 0.0), (2.0e-3, -0.2, 5e3)]
    script = f"return {[list(at) for at in places]}.map((at) => energyOf(runs[0].straw.frusta[0], ...at));"
    told = np.array(asked(page([dataclasses.replace(comparison, straw=straw)]), script, tmp_path)["answer"])
    frustum = frustum_of(straw, sealed=True)
    said = np.array([float(frustum.energy(np.array(z), np.array(f), p)) for z, f, p in places])
    np.testing.assert_allclose(told - told[0], said - said[0], rtol=1e-6, atol=1e-9)


def test_the_page_makes_no_network_request(comparison: Comparison) -> None:
    text = page([comparison])
    assert not re.search(r'(?:src|href)\s*=\s*["\'](?!data:)', text)
    assert not re.search(r"https?://(?!www\.w3\.org)", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL))
    assert not re.search(r"\bfetch\(|XMLHttpRequest|EventSource", text)
