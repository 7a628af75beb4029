"""A straw as a solid: closed, of the right volume, and read by another program where one is installed."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.solid.outline import Flange, section, volume_m3
from straw.model.solid.step import step_text
from straw.model.solid.stl import RECORD, stl_bytes, triangles
from straw.replay.cli import main

STRAW = StrawParameters(cells=3)


def test_the_triangles_form_a_closed_surface_of_the_right_volume() -> None:
    around = 180
    corners = section(STRAW)
    facets = triangles(corners, around)
    edges: Counter[tuple[tuple[int, ...], tuple[int, ...]]] = Counter()
    for facet in np.round(1e9 * facets).astype(int):
        points = [tuple(p) for p in facet.tolist()]
        edges.update((points[i], points[(i + 1) % 3]) for i in range(3))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    volume = np.einsum("ni,ni->", facets[:, 0], np.cross(facets[:, 1], facets[:, 2])) / 6
    # a polygon of n corners has sin(2 pi / n) / (2 pi / n) of its circle's area
    share = np.sin(2 * np.pi / around) / (2 * np.pi / around)
    assert volume == pytest.approx(share * volume_m3(corners), rel=1e-9)


def test_a_written_stl_has_all_triangles_in_mm() -> None:
    data = stl_bytes(triangles(section(STRAW), 24))
    record = np.frombuffer(data[84:], RECORD)
    assert int(np.frombuffer(data[80:84], "<u4")[0]) == len(record)
    assert record["corners"][..., 2].max() == pytest.approx(1e3 * section(STRAW)[:, 1].max(), rel=1e-6)


def test_the_wall_is_as_thick_as_the_straw_says() -> None:
    corners = section(STRAW)
    wall_m3 = volume_m3(corners) - np.pi * Flange().radius_m ** 2 * Flange().thickness_m
    slants = [np.hypot(3.55e-3, z) for z in (3.78e-3, 2.28e-3)]
    middle = np.pi * (STRAW.r_i_m + STRAW.r_o_m)
    thin = 0.508e-3 * (3 * middle * sum(slants) + 2 * np.pi * STRAW.r_i_m * Flange().collar_m)
    assert wall_m3 == pytest.approx(thin, rel=0.02)  # the lid intersects the last wall, corners overlap


def test_another_program_reads_the_step_as_one_solid_of_that_volume(tmp_path: Path) -> None:
    occ = pytest.importorskip("netgen.occ")
    path = tmp_path / "s.step"
    path.write_text(step_text(section(STRAW)))
    shape = occ.OCCGeometry(str(path)).shape
    assert len(list(shape.solids)) == 1
    assert shape.mass == pytest.approx(1e9 * volume_m3(section(STRAW)), rel=1e-9)


def test_walls_that_would_intersect_are_named() -> None:
    with pytest.raises(ModelError, match="walls meet"):
        section(STRAW.replace(h_m=np.array(1.2e-3)), folded=True)
    assert volume_m3(section(STRAW, folded=True)) > 0


def test_an_unknown_suffix_is_refused_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["solid", "-o", str(tmp_path / "s.obj")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("around", ["0", "2", "2000000"])
def test_a_circle_of_too_few_or_too_many_segments_is_refused(
    around: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["solid", "-o", str(tmp_path / "s.stl"), "--around", around]) == 2
    assert f"--around {around}: expected 8 to 5000" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
