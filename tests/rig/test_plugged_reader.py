"""Users' readers: named by file, mapping, straw file and entry point; an error in one is reported in one line."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from straw.replay.cli import main
from straw.rig.errors import RigError
from straw.rig.run_read import read_run
from straw.rig.tables import read_table
from straw.rig.tables.reader import READERS
from straw.rig.tables.table import Reading

READER = """
import numpy as np
import straw

def read(path):
    data = path.read_bytes()
    if data[:4] != b"DAQ1":
        raise ValueError("no DAQ1 at its start")
    rows = np.frombuffer(data[4:], dtype=[("t", "<u4"), ("p", "<f4")])
    return {"t": rows["t"], "p": rows["p"]}

READER = straw.Reader(name="daq1", about="the lab's own logger", read=read, suffixes=(".daq",),
                      roles={"t": "time", "p": "pressure"}, units={"t": "ms", "p": "mbar"})
"""
RETURNS = 'return {"t": rows["t"], "p": rows["p"]}'
START = ("--start", "2026-05-03 14:02:11Z")


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a reader and a log of 50 rows, 10 ms apart, falling to -49 mbar; no readers are registered."""
    monkeypatch.setenv(READERS.variable, "")
    (tmp_path / "my_reader.py").write_text(READER)
    (tmp_path / "log.daq").write_bytes(b"DAQ1" + b"".join(struct.pack("<If", 10 * k, -k) for k in range(50)))
    return tmp_path


def imported(place: Path, *more: str) -> int:
    (place / "r.mcap").unlink(missing_ok=True)
    return main(["import", str(place / "log.daq"), "-o", str(place / "r.mcap"), *START, *more])


def test_a_reader_named_on_the_command_line_is_used_and_recorded(place: Path) -> None:
    assert imported(place, "--format", str(place / "my_reader.py")) == 0
    run = read_run(place / "r.mcap")
    assert run.pressure is not None
    np.testing.assert_allclose(run.pressure.pressure_pa, -100.0 * np.arange(50))
    np.testing.assert_allclose(run.pressure.time_s, 0.01 * np.arange(50), atol=1e-9)
    assert run.metadata["imported_by"].startswith("my_reader.py SHA-256 ")


@pytest.mark.parametrize("how", ["mapping", "straw file", "environment"])
def test_a_mapping_a_straw_file_and_the_environment_name_readers_too(
    place: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    assert imported(place) == 2  # no known format
    (place / "m.toml").write_text('[[table]]\nformat = "my_reader.py"\n')
    (place / "s.toml").write_text('readers = ["my_reader.py"]\n')
    more = {"mapping": ["--map", str(place / "m.toml")], "straw file": ["--straw", str(place / "s.toml")]}
    if how == "environment":
        monkeypatch.setenv(READERS.variable, str(place / "my_reader.py"))
    assert imported(place, *more.get(how, [])) == 0


def test_a_reader_of_an_installed_package_is_known(place: Path) -> None:
    site = place / "site"
    (site / "daq-1.0.dist-info").mkdir(parents=True)
    (site / "daq_pkg.py").write_text(READER)
    (site / "daq-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: daq\nVersion: 1.0\n")
    (site / "daq-1.0.dist-info" / "entry_points.txt").write_text("[straw.readers]\ndaq1 = daq_pkg\n")
    code = "from straw.rig.tables import read_table; t = read_table('log.daq'); print(t.format, t.reader)"
    environment = os.environ | {"PYTHONPATH": str(site)}
    done = subprocess.run([sys.executable, "-c", code], cwd=place, env=environment, capture_output=True, text=True)
    assert done.stdout.strip() == "daq1 daq 1.0", done.stderr


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (READER, "", "gives no reader; end it with READER = straw.Reader(...)"),
        (READER, "READER = 3", "READER = 3; expected straw.Reader(...)"),
        (READER, "x = (", "line 1"),
        ('name="daq1"', 'name="DAQ 1"', "a word of small letters"),
        ('about="the lab\'s own logger"', 'about=""', "about is empty"),
        ('(".daq",)', '".daq"', "write them with their point"),
        ('"t": "time"', '"t": "clock"', "roles: 't' is 'clock'; known: time"),
        ('"p": "mbar"', '"p": "furlong"', "'p' in 'furlong' is no pressure; known: Pa"),
        (RETURNS, "return 1 / 0", "read(log.daq) raises line 10: ZeroDivisionError"),
        (RETURNS, "return rows", "expected columns by their names"),
        (RETURNS, 'return {"t": rows["t"]}', "gives no column 'p'"),
        (RETURNS, 'return {"t": rows["t"], "p": rows["p"][:3]}', "'p' has 3 rows, 't' 50"),
        (RETURNS, 'return {"t": rows["t"], "p": np.ones((50, 2))}', "'p' has shape (50, 2); expected (n,)"),
        (RETURNS, 'return {"t": rows["t"], "p": np.full(50, np.nan)}', "'p' (pressure) has no finite number"),
        (RETURNS, 'return {"t": rows["t"], "p": [{}] * 50}', "expected numbers, words or moments"),
        (RETURNS, 'return {"t": [], "p": []}', "have no rows"),
    ],
)
def test_an_error_in_a_reader_is_one_line_with_its_file(place: Path, old: str, new: str, words: str) -> None:
    assert old in READER
    path = place / "my_reader.py"
    path.write_text(READER.replace(old, new))
    with pytest.raises(RigError) as refused:
        read_table(place / "log.daq", Reading(format=str(path)))
    said = str(refused.value)
    assert said.startswith(str(path))
    assert words in said
    assert "\n" not in said


def test_check_tries_a_reader_on_a_table_and_damaged_copies(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    check = ["check", str(place / "my_reader.py")]
    assert main(check) == 0
    assert main([*check, "--on", str(place / "log.daq")]) == 0
    said = capsys.readouterr().out
    assert "reader daq1 is good: the lab's own logger; takes .daq" in said
    assert "'p': 50 rows, mbar; pressure" in said
    (place / "log.daq").write_bytes(b"other")
    assert main([*check, "--on", str(place / "log.daq")]) == 2
    assert "ValueError: no DAQ1 at its start" in capsys.readouterr().err


def test_the_name_of_a_built_in_reader_is_refused(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (place / "my_reader.py").write_text(READER.replace('"daq1"', '"esi"'))
    monkeypatch.setenv(READERS.variable, str(place / "my_reader.py"))
    with pytest.raises(RigError, match="there is a format of this name"):
        read_table(place / "log.daq")
