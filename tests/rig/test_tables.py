"""Tables of other loggers: every format is read, with every notation of numbers, text and dates."""

from __future__ import annotations

import dataclasses
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from straw.rig.errors import RigError
from straw.rig.tables import Mapping, Reading, TableMap, Use, read_table, understand
from straw.rig.tables.choose_format import format_of
from straw.rig.tables.formats import formats
from straw.rig.tables.write import messages

HERE = Path(__file__).parent / "tables"
START = "2026-05-03 12:00:00Z"
OF = {
    "esi": ["esi_sdk.txt", "esi_targets.txt"],
    "kinovea": ["kinovea_old.txt", "kinovea_new.txt"],
    "tracker": ["tracker.txt", "tracker_comma.txt"],
    "deeplabcut": ["dlc.csv", "dlc.h5", "dlc_fixed.h5"],
    "parquet": ["run.parquet"],
    "mat": ["run5.mat", "run73.mat"],
    "csv": ["serial.csv", "kinovea_kinematics.csv"],
}
FILES = [(form, name) for form, names in OF.items() for name in names]


@pytest.fixture(autouse=True)
def _libraries() -> None:
    for name in ("h5py", "pyarrow"):
        pytest.importorskip(name)


def said(path: Path, uses: dict[str, str] | None = None, start: str = START, **more: object) -> Mapping:
    """A mapping of one table: columns by role, as "P1 in mbar"."""
    made = {role: (Use(*text.split(" in ")),) for role, text in (uses or {}).items()}
    return Mapping((TableMap(str(path), uses=made, **more),), start=start)  # type: ignore[arg-type]


def written(tmp_path: Path, name: str, text: str) -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def problem_of(path: Path, form: str | None) -> str:
    try:
        read_table(path, Reading(format=form))
    except RigError as error:
        return str(error)
    return ""


def values(mapping: Mapping, *paths: Path) -> list[tuple[int, str, dict[str, object]]]:
    plan = understand([read_table(path) for path in paths], mapping)
    assert not plan.doubts, plan.doubts
    return messages(plan)


def test_every_format_has_a_table_that_another_program_wrote() -> None:
    assert set(OF) == set(formats())


@pytest.mark.parametrize(("form", "name"), FILES)
def test_a_format_recognises_its_own_tables(form: str, name: str) -> None:
    path = HERE / name
    assert format_of(path, path.read_bytes()).name == form
    assert len(read_table(path).columns) >= 2


@pytest.mark.parametrize(("form", "name"), FILES)
def test_a_table_cut_anywhere_or_of_random_bytes_is_read_or_refused_in_one_line(
    form: str, name: str, tmp_path: Path
) -> None:
    whole = (HERE / name).read_bytes()
    rng = np.random.default_rng(1)
    for k in range(12):
        data = bytearray(whole[: rng.integers(1, len(whole))])
        if k % 2:
            data[rng.integers(0, len(data))] ^= 1 << int(rng.integers(0, 8))
        path = tmp_path / f"{k}{Path(name).suffix}"
        path.write_bytes(bytes(data))
        for forced in (None, form):
            problem = problem_of(path, forced)
            assert "\n" not in problem
            assert path.name in problem or not problem


def test_esi_logs_are_in_mbar_and_distinguish_targets_from_readings() -> None:
    path = HERE / "esi_targets.txt"
    found = values(said(path), path)
    assert [(t, f["pressure_pa"]) for _, t, f in found if f["pressure_pa"]][-2:] == [
        ("/pressure/command", 25000.0),
        ("/pressure/measured", 24175.0),
    ]
    assert [ns % 10**9 for ns, topic, _ in found if topic.endswith("measured")] == [0, 100_000_000, 200_000_000]


def test_kinoveas_time_code_counts_hundredths() -> None:
    path = HERE / "kinovea_old.txt"
    plan = understand(
        [read_table(path)],
        said(path, points=("trajectory 2", "trajectory 1"), points_unit="mm"),
    )
    assert plan.parts[0].times.ns.tolist() == [0, 30_000_000, 70_000_000]


def test_two_points_give_the_tip_and_its_angle_in_the_straws_frame() -> None:
    """Upright: phi 0; the far point to +X of the near one by as much as above it: 45 degrees."""
    path = HERE / "kinovea_new.txt"
    mapping = said(path, {"time": "tip time in ms"}, points=("mount", "tip"), points_unit="mm")
    tips = [f for _, _, f in values(mapping, path)]
    assert tips[0]["phi_rad"] == 0.0
    assert tips[2]["phi_rad"] == pytest.approx(math.atan2(4.0, 3.0))
    assert (tips[2]["x_m"], tips[2]["z_m"]) == pytest.approx((0.005, 0.013))


@pytest.mark.parametrize("name", ["dlc.csv", "dlc.h5", "dlc_fixed.h5"])
def test_deeplabcuts_pixels_count_downwards_and_points_of_low_likelihood_are_invalid(name: str) -> None:
    path = HERE / name
    mapping = said(path, points=("mount", "tip"), mm_per_px=0.1, origin_px=(100.0, 300.0), rate_hz=240.0)
    found = values(mapping, path)
    tips = [f for _, _, f in found]
    assert (tips[0]["x_m"], tips[0]["z_m"], tips[0]["phi_rad"]) == pytest.approx((0.0, 0.015, 0.0))
    assert tips[2]["phi_rad"] == pytest.approx(math.pi / 2)
    assert [f["valid"] for f in tips] == [True, True, False]
    assert [f["frame"] for f in tips] == [0, 1, 2]
    assert found[1][0] - found[0][0] == round(1e9 / 240)


def test_trackers_minus_signs_and_decimal_commas_are_numbers() -> None:
    table = read_table(HERE / "tracker_comma.txt")
    assert table.columns["t"].values.tolist() == [0.0, 0.04, 0.08]
    assert table.columns["mass_A x"].values.tolist() == [0.01, -0.0015, -0.005]


def test_parquet_times_keep_their_nanoseconds_and_gaps_are_left_out() -> None:
    path = HERE / "run.parquet"
    found = values(said(path, {"time": "when", "pressure": "p_kpa"}), path)
    assert [ns % 10**9 for ns, _, _ in found] == [1, 10_000_002]
    assert [f["pressure_pa"] for _, _, f in found] == [500.0, -20250.0]


@pytest.mark.parametrize(("name", "time"), [("run5.mat", "log.t"), ("run73.mat", "t")])
def test_vectors_of_mat_files_are_columns(name: str, time: str) -> None:
    path = HERE / name
    pressure = "log.p_mbar" if name == "run5.mat" else "p_mbar"
    found = values(said(path, {"time": f"{time} in s", "pressure": pressure}), path)
    assert [f["pressure_pa"] for _, _, f in found] == [0.0, 5000.0, 10150.0, 15000.0]


def test_incomplete_lines_of_a_serial_log_are_reported() -> None:
    table = read_table(HERE / "serial.csv")
    assert table.notes == ("2 torn lines are left out (2, 6)",)
    assert len(table.lines) == 55


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("t;p\n0;1,5\n1;2,25\n", [1.5, 2.25]),  # decimal commas
        ("\ufefft,p\n0,1.5\n1,2.25\n", [1.5, 2.25]),  # a byte order mark
        ("sep=;\nt;p\n0;1.5\n1;2.25\n", [1.5, 2.25]),
        ("# by our logger\n% v2\nt\tp\ns\tkPa\n0\t1.5\n1\tNaN\n2\t2.25\n", [1.5, math.nan, 2.25]),  # a line of units
        ("t;p\n0;1.234,5\n1;2,0\n", [1234.5, 2.0]),
        ('"t","p",\n0,1.5,\n1,2.25,\n', [1.5, 2.25]),  # a separator at the end
        ("t p\n0 1,5\n1 2,25\n", [1.5, 2.25]),
    ],
)
def test_numbers_are_read_in_every_notation(text: str, numbers: list[float], tmp_path: Path) -> None:
    table = read_table(written(tmp_path, "t.csv", text))
    np.testing.assert_array_equal(list(table.columns.values())[1].values, numbers)
    assert not table.doubts


def test_ambiguous_numbers_are_reported_as_a_doubt(tmp_path: Path) -> None:
    assert read_table(written(tmp_path, "a.csv", "t;p\n0;1,234\n1;2,345\n")).doubts
    dots = read_table(written(tmp_path, "b.csv", "0.000;3.897\n273.000;3.897\n1.075.000;3.899\n"))
    assert dots.columns["column 1"].values.tolist() == [0.0, 273.0, 1075.0]
    assert dots.doubts[0].say == "--decimal . --thousands ."


def test_utf16_and_latin_1_are_text(tmp_path: Path) -> None:
    for encoding in ("utf-16", "latin-1"):
        path = tmp_path / f"{encoding}.csv"
        path.write_bytes("t [s],p [kPa],q [µl/min]\n0,1,2\n1,2,3\n".encode(encoding))
        assert [c.unit for c in read_table(path).columns.values()] == ["s", "kPa", "ul/min"]


@pytest.mark.parametrize(
    ("cells", "zone", "ns"),
    [
        ("2026-05-03 14:00:00.000000001", "Europe/Berlin", 1777809600000000001),
        ("2026-05-03T12:00:00Z", "", 1777809600000000000),
        ("03.05.2026 14:00:00,5", "+02:00", 1777809600500000000),
        ("5/13/2026 12:00:00 PM", "UTC", 1778673600000000000),
        ("1777809600.123456789", "", 1777809600123456789),
        ("1777809600123", "", 1777809600123000000),
    ],
)
def test_dates_are_exact_to_the_nanosecond(cells: str, zone: str, ns: int, tmp_path: Path) -> None:
    unit = {13: "ms", 20: "s"}.get(len(cells), "s") if cells[0] == "1" else ""
    path = written(tmp_path, "t.csv", f"time;p [kPa]\n{cells};1\n")
    time = f"time in {unit}" if unit else "time"
    mapping = dataclasses.replace(said(path, {"time": time, "pressure": "p [kPa]"}, start=""), time_zone=zone)
    assert [m[0] for m in values(mapping, path)] == [ns]


@pytest.mark.parametrize(("name", "library"), [("run.parquet", "pyarrow"), ("dlc.h5", "h5py"), ("run73.mat", "h5py")])
def test_a_library_that_is_not_installed_is_named_with_the_command_that_installs_it(
    name: str, library: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(RigError, match=rf"{library}.*pip install 'straw\[tables\]'"):
        read_table(HERE / name)


def test_an_h5_file_that_would_execute_code_is_refused(tmp_path: Path) -> None:
    import pickle

    import h5py

    path = tmp_path / "bad.h5"
    path.write_bytes((HERE / "dlc.h5").read_bytes())
    with h5py.File(path, "r+") as file:
        attributes = file["df_with_missing/table"].attrs
        attributes["values_block_0_kind"] = np.bytes_(pickle.dumps(print, 0))
    with pytest.raises(RigError, match="UnpicklingError"):
        read_table(path)
