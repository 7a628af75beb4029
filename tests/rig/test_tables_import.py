"""Tables become a run: guesses need consent, clocks are joined, and errors are one line with place and cure."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from straw.rig.errors import RigError
from straw.rig.run_read import read_run
from straw.rig.tables import Mapping, Reading, TableMap, Use, import_tables, load_mapping, read_table, understand
from straw.rig.tables.mapping import to_toml
from tests.rig.test_tables import START, said, written


def test_a_guess_is_not_written_unless_it_is_accepted(tmp_path: Path) -> None:
    path = written(tmp_path, "t.csv", "time [s],pressure [kPa]\n0,1\n1,2\n")
    with pytest.raises(RigError, match="guess"):
        import_tables([path], tmp_path / "run.mcap")
    assert not list(tmp_path.glob("run*"))
    plan = import_tables([path], tmp_path / "run.mcap", accept_guesses=True)
    assert len(plan.doubts) == 3  # the time, the pressure, and when 0 was
    assert read_run(tmp_path / "run.mcap").pressure is not None


def test_two_tables_with_separate_clocks_make_one_run(tmp_path: Path) -> None:
    pressure = written(tmp_path, "p.csv", "t [ms],P [mbar]\n0,0\n1000,250\n")
    tip = written(tmp_path, "tip.csv", "t [s],x [mm],z [mm],phi [deg]\n0,10,20,90\n0.5,11,21,45\n")
    roles = ("time", "x", "z", "phi")
    mapping = Mapping(
        (
            TableMap(
                str(pressure), uses={"time": (Use("t [ms]"),), "pressure": (Use("P [mbar]", zero=50.0),)}, offset_s=0.0
            ),
            TableMap(
                str(tip),
                uses={role: (Use(name),) for role, name in zip(roles, read_table(tip).columns, strict=True)},
                offset_s=0.132,
                tip_offset_mm=8.8,
            ),
        ),
        start=START,
        metadata={"initial_deployed": "1,4", "specimen": "s", "cycle": "3", "cells": "9"},
    )
    import_tables([pressure, tip], tmp_path / "run.mcap", mapping)
    run = read_run(tmp_path / "run.mcap")
    assert not run.lost
    assert run.pressure is not None
    assert run.tip is not None
    assert run.tip.time_s.tolist() == [0.132, 0.632]
    np.testing.assert_allclose(run.tip.x_m[0], 0.010 - 0.0088)
    np.testing.assert_allclose(run.tip.z_m[1], 0.021 - 0.0088 * math.cos(math.pi / 4))
    assert run.pressure.pressure_pa.tolist() == [-5000.0, 20000.0]
    assert (run.initial_deployed, run.specimen, run.cycle) == ((1, 4), "s", 3)
    assert load_mapping(written(tmp_path, "m.toml", run.attachments["import.toml"].decode())) == mapping


def test_a_mapping_file_reads_back_exactly(tmp_path: Path) -> None:
    one = TableMap(
        "a.csv", Reading(decimal=","), {"pressure": (Use("P", "mbar", 1.5, -1.0), Use("Q")), "x": ()}, 240.0, 0.1,
        "wrap", 0.1, (1.0, 2.0), ("a", "b"), "px", 0.9, 8.8, "dmy",
    )  # fmt: skip
    pressure = (one.uses["pressure"][0], Use("Q", channel=2))
    whole = Mapping((dataclasses.replace(one, uses={**one.uses, "pressure": pressure}),), START, "UTC", {"a": "b"})
    assert load_mapping(written(tmp_path, "m.toml", to_toml(whole))) == whole


@pytest.mark.parametrize(
    ("text", "uses", "more", "words"),
    [
        ("t [s],p\n0,0\n1,25\n", {"time": "t [s]", "pressure": "p in Pa"}, {}, "looks like kPa"),
        ("t [s],p\n0,0\n1,25\n", {"time": "t [s]", "pressure": "p2 in Pa"}, {}, "no column 'p2'"),
        ("t [s],p\n0,0\n1,25\n", {"time": "t [s]", "pressure": "p in furlong"}, {}, "not a unit of pressure"),
        ("t [s],p\n0,101.3\n1,102\n", {"time": "t [s]", "pressure": "p in kPa"}, {}, "looks absolute"),
        ("t [s],x\n0,22\n1,25\n", {"time": "t [s]", "x": "x in mm"}, {}, "not named: z and phi"),
        ("t [s],p [kPa]\n0,1\n2,2\n1.9,3\n5,4\n", {}, {}, "line 4"),
        ("t [ms],p [kPa]\n65500,1\n65530,2\n24,3\n", {}, {}, "65536 ms: give --back wrap"),
        ("t [s],p [kPa]\n0,1\n9,2\n0,1\n9,2\n", {}, {}, "2 records in one file"),
        ("p [kPa]\n1\n2\n", {}, {}, "--rate"),
        ("frame,p [kPa]\n1,1\n2,2\n", {}, {}, "counts frames"),
        ("t [s],p [kPa]\n0,a\n1,b\n", {"pressure": "p [kPa]"}, {}, "holds words"),
        ("hello\nworld\n", {}, {}, "no rows of numbers"),
        ("t [s],q\n0,1\n1,2\n", {}, {}, "no column to import"),
    ],
)
def test_an_impossible_import_is_one_line_with_place_and_cure(
    text: str, uses: dict[str, str], more: dict[str, object], words: str, tmp_path: Path
) -> None:
    path = written(tmp_path, "bad.csv", text)
    with pytest.raises(RigError) as caught:
        import_tables([path], tmp_path / "run.mcap", said(path, uses, **more), accept_guesses=True)
    assert words in str(caught.value)
    assert "bad.csv" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.glob("run*"))


def test_vectors_of_different_lengths_are_reported_with_both_lengths(tmp_path: Path) -> None:
    from scipy.io import savemat

    path = tmp_path / "run.mat"
    savemat(path, {"t": np.arange(5.0), "p": np.arange(4.0)})
    with pytest.raises(RigError, match="'p' has 4 values, but there are 5 times"):
        understand([read_table(path)], said(path, {"time": "t in s", "pressure": "p in kPa"}))


@pytest.mark.parametrize(
    ("back", "ms"),
    [
        ("drop", [65500, 65530]),
        ("sort", [24, 65500, 65530]),
        ("wrap", [65500, 65530, 65560]),
        ("part:1", [65500, 65530]),
    ],
)
def test_time_that_runs_backwards_is_corrected_as_specified(back: str, ms: list[int], tmp_path: Path) -> None:
    path = written(tmp_path, "t.csv", "t [ms],p [kPa]\n65500,1\n65530,2\n24,3\n")
    plan = understand([read_table(path)], said(path, back=back))
    assert (plan.parts[0].times.ns // 10**6).tolist() == ms


def test_real_logs_with_real_faults_are_read(shared: Path) -> None:
    folder = shared / "realdata"
    for path in sorted(folder.glob("pneumatic_tube/*.csv"))[::10]:
        assert len(read_table(path).columns) == 5
    leak = read_table(folder / "air_chamber_leak" / "Formlabs.csv")
    assert float(leak.columns["column 1"].values[-1]) == pytest.approx(142508.0)
