"""straw import and straw export: no guess is written without consent, and a recording comes back bit for bit."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from straw.replay.cli import main
from straw.replay.tables.options import COLUMNS
from straw.rig.mcap_scan import scan
from straw.rig.run_derived import write_tip
from straw.rig.run_read import read_run
from straw.rig.run_track import write_track
from straw.rig.run_write import RunWriter
from straw.rig.tables.roles import ROLES
from straw.tracking.trace import TipTrace

ZERO_NS = 1_795_000_000_000_000_000
STATED = ["--start", "2026-05-03 12:00:00Z", "--deployed", "1,4", "--specimen", "s7"]


def contents(path: Path) -> tuple[Any, ...]:
    """Messages in order, bit for bit, with topic, both times and schema; metadata and attachments."""
    taken: list[tuple[int, int, bytes, int]] = []
    found = scan(path, lambda *message: taken.append(message))
    assert not found.lost
    messages = []
    for channel_id, ns, data, log_ns in taken:
        channel = found.channels[channel_id]
        schema = found.schemas[channel.schema_id]
        messages.append((channel.topic, channel.message_encoding, channel.metadata, schema.data, ns, log_ns, data))
    ours = ("straw.software", "straw.software.recorded")  # the software that wrote the file
    return messages, {k: v for k, v in found.metadata.items() if k not in ours}, found.attachments


def a_run(path: Path) -> None:
    """Every topic, with values that are hard to write as text: NaN, minus zero, bytes, line ends, commas, quotes."""
    metadata = {"run_id": "r", "specimen": "s, 7", "initial_deployed": "1,4", "cells": "9"}
    metadata["zero_time_ns"] = str(ZERO_NS)
    with RunWriter(path, metadata, {"p.toml": b'name = "\xc3\xa4"\n'}) as writer:
        for k in range(40):
            now_ns = ZERO_NS + 4_166_667 * k
            writer.add("/pressure/command", now_ns, pressure_pa=-0.0, channel=2)
            writer.add(
                "/pressure/measured", now_ns, pressure_pa=0.1 * k, sigma_pa=float("nan"), channel=1,
                monotonic_ns=2**62 + k, raw=b">PINGA?|OK|\r\n\x00\xff\\n" + bytes([k]), flow_m3_s=1e-300,
            )  # fmt: skip
            pose = {"x_m": k / 3, "z_m": float("inf"), "phi_rad": float("nan"), "valid": k % 2 == 0, "frame": k}
            writer.add("/tip/state", now_ns, **pose, sigma_x_m=5e-324, sigma_z_m=0.0, sigma_phi_rad=0.0)
        writer.event("note", 'snap, "cell 4"\r\nleapt; \\n ä 漢 \u2028 =1+1', ZERO_NS + 5)
        writer.event("stop", "", ZERO_NS + 7)


def a_track(path: Path) -> None:
    """Messages of flat fields beyond the contract's, and some with fields inside fields."""
    n = 6
    line = np.linspace(0.0, 1.0, n)
    trace = TipTrace(line, line, line, line, line, line, line, np.ones(n, dtype=bool), np.arange(n))
    grades: dict[str, Any] = dict.fromkeys(("rms_px", "contrast", "blur_px"), line)
    corners = [(np.ones((3, 2)), np.ones(3, dtype=bool))] * n
    quality = grades | {"corners": np.arange(n), "reason": [""] * n}
    camera = ((1920, 1080), "plumb_bob", [0.0] * 5, np.eye(3))
    write_track(path, trace, quality, corners, camera, {"run_id": "t"}, {"camera.json": b"{}"}, "ab" * 32, ZERO_NS)


def a_prediction(path: Path) -> None:
    line = np.linspace(0.0, 1.0, 4)
    trace = TipTrace(line, line, line, line, line, line, line, np.ones(4, dtype=bool), np.arange(4))
    write_tip(path, trace, {"run_id": "p"}, "cd" * 32, ZERO_NS)


def json_of_another_logger(path: Path) -> None:
    """Written with the mcap package: JSON with fields absent, null and of whole numbers, in another order."""
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("other", "other logger")
        ids = [
            writer.register_channel(topic, "json", writer.register_schema(name, "jsonschema", b"{}"))
            for topic, name in (("/tip/state", "tip"), ("/pressure/measured", "p"), ("/other", "o"))
        ]
        rows = [
            (0, {"z_m": 0.5, "x_m": 1, "phi_rad": None, "valid": True, "frame": 3}),
            (0, {"x_m": 2.5, "z_m": 0.1, "phi_rad": 1e-7}),
            (1, {"pressure_pa": 12.25}),
            (2, {"deep": {"er": [1, 2]}}),
            (1, {"pressure_pa": "torn"}),
        ]
        for k, (at, values) in enumerate(rows):
            writer.add_message(
                ids[at], ZERO_NS + k + 9, json.dumps(values, separators=(",", ":")).encode(), ZERO_NS + k
            )
        writer.add_metadata("straw.run", {"run_id": "j", "zero_time_ns": str(ZERO_NS)})
        writer.finish()


@pytest.mark.parametrize("kind", ["csv", "parquet"])
@pytest.mark.parametrize("make", [a_run, a_track, a_prediction, json_of_another_logger])
def test_what_is_exported_comes_back_bit_for_bit(make: Any, kind: str, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    make(tmp_path / "run.mcap")
    table, again = tmp_path / f"t.{kind}", tmp_path / "again.mcap"
    assert main(["export", str(tmp_path / "run.mcap"), f"--{kind}", str(table)]) == 0
    assert main(["import", str(table), "-o", str(again)]) == 0
    assert contents(again) == contents(tmp_path / "run.mcap")


def test_an_edited_cell_takes_precedence(tmp_path: Path) -> None:
    for make, old, new in ((a_run, ",0.1,1,", ",77.5,1,"), (json_of_another_logger, "12.25", "77.5")):
        folder = tmp_path / make.__name__
        folder.mkdir()
        make(folder / "run.mcap")
        assert main(["export", str(folder / "run.mcap"), "--csv", str(folder / "t.csv")]) == 0
        text = (folder / "t.csv").read_text(encoding="utf-8")
        assert old in text
        (folder / "t.csv").write_text(text.replace(old, new, 1), encoding="utf-8")
        assert main(["import", str(folder / "t.csv"), "-o", str(folder / "again.mcap")]) == 0
        pressure = read_run(folder / "again.mcap").pressure
        assert pressure is not None
        assert 77.5 in pressure.pressure_pa


def test_a_table_without_its_sidecar_file_gives_the_contracts_messages_and_reports_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a_run(tmp_path / "run.mcap")
    main(["export", str(tmp_path / "run.mcap"), "--csv", str(tmp_path / "t.csv")])
    (tmp_path / "t.csv.json").unlink()
    assert main(["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "again.mcap"), "--deployed", "1,4"]) == 0
    assert "t.csv.json is not beside it" in capsys.readouterr().out
    assert [m[-1] for m in contents(tmp_path / "again.mcap")[0]] == [m[-1] for m in contents(tmp_path / "run.mcap")[0]]
    assert read_run(tmp_path / "again.mcap").initial_deployed == (1, 4)


def test_one_topic_alone_is_a_table_without_empty_columns(tmp_path: Path) -> None:
    a_run(tmp_path / "run.mcap")
    table = tmp_path / "t.csv"
    assert main(["export", str(tmp_path / "run.mcap"), "--csv", str(table), "--topic", "/events"]) == 0
    assert table.read_text(encoding="utf-8").splitlines()[0] == "time_s,topic,time_ns,log_time_ns,kind,text"


def test_a_guess_is_printed_and_drawn_but_not_written_until_it_is_confirmed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, run = tmp_path / "t.csv", tmp_path / "run.mcap"
    table.write_text("Time [ms];Druck\n0;0,5\n10;-20,25\n20;-21,5\n", encoding="utf-8")
    assert main(["import", str(table), "-o", str(run), *STATED, "--json", str(tmp_path / "i.json")]) == 1
    said = capsys.readouterr().out
    assert "GUESSED" in said
    assert '--pressure "Druck in kPa"' in said
    assert not run.exists()
    assert (tmp_path / "run.import.png").read_bytes().startswith(b"\x89PNG")
    assert len(json.loads((tmp_path / "i.json").read_text(encoding="utf-8"))["guesses"]) == 3
    stated = ["--time", "Time [ms]", "--pressure", "Druck in kPa"]
    assert main(["import", str(table), "-o", str(run), *STATED, *stated, "--save-map", str(tmp_path / "m.toml")]) == 0
    found = read_run(run)
    assert found.pressure is not None
    assert found.pressure.pressure_pa.tolist() == [500.0, -20250.0, -21500.0]
    assert found.pressure.time_s.tolist() == [0.0, 0.01, 0.02]
    assert (found.initial_deployed, found.specimen) == ((1, 4), "s7")
    again = tmp_path / "again.mcap"
    assert main(["import", str(table), "-o", str(again), "--map", str(tmp_path / "m.toml")]) == 0
    assert contents(again)[0] == contents(run)[0]
    assert main(["import", str(table), "-o", str(tmp_path / "yes.mcap"), "--yes"]) == 0


def test_a_dry_run_shows_and_never_writes(tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    table.write_text("time [s],pressure [kPa]\n0,1\n1,2\n", encoding="utf-8")
    argv = ["import", str(table), "--dry-run", "--yes", "--picture", str(tmp_path / "p.png")]
    assert main(argv) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["p.png", "t.csv"]


def test_pressure_and_tip_of_two_loggers_are_joined_by_a_stated_offset(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("t [s],P [mbar]\n0,0\n1,250\n", encoding="utf-8")
    (tmp_path / "tip.csv").write_text("t [s],x [mm],z [mm],phi [deg]\n0,10,20,90\n1,11,21,91\n", encoding="utf-8")
    run = tmp_path / "run.mcap"
    columns = [w for r, c in (("time", "t [s]"), ("pressure", "P [mbar]")) for w in (f"--{r}", c)]
    columns += [w for c in ("x [mm]", "z [mm]", "phi [deg]") for w in (f"--{c.split()[0]}", c)]
    tables = [str(tmp_path / "p.csv"), str(tmp_path / "tip.csv"), "-o", str(run), *columns, *STATED]
    assert main(["import", *tables]) == 1  # whether both clocks began together is a guess
    assert main(["import", *tables, "--offset", "tip.csv:0.25"]) == 0
    found = read_run(run)
    assert found.tip is not None
    assert found.tip.time_s.tolist() == [0.25, 1.25]


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--pressure", "p in Pa"], "looks like kPa"),
        (["--pressure", "nothing"], "no column 'nothing'"),
        (["--pressure", "p in kPa", "--time-zone", "Mars"], "time zone 'Mars'"),
        (["--pressure", "p in kPa", "--start", "yesterday"], "yesterday"),
        (["--pressure", "p in kPa", "--offset", "soon"], "--offset soon"),
        (["--pressure", "p in kPa", "--deployed", "all"], "--deployed all"),
        (["--pressure", "p in kPa", "--back", "up"], "expected one of drop"),
        (["--pressure", "p in kPa", "--format", "xls"], "no format 'xls'"),
        (["--pressure", "p in kPa", "--map", "none.toml"], "none.toml"),
        (["--pressure", "p in kPa", "--meta", "zero_time_ns=3"], "--meta"),
        (["--pressure", "p in kPa", "--rate", "0"], "above 0"),
        (["--pressure", "p in kPa", "--cells", "nine"], "nine"),
    ],
)
def test_bad_input_is_one_line_with_exit_2_and_leaves_no_file(
    argv: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "t.csv").write_text("t [s],p\n0,0\n1,25\n", encoding="utf-8")
    try:
        code: Any = main(
            ["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "run.mcap"), "--time", "t [s]", *argv]
        )
    except SystemExit as stop:
        code = stop.code
    error = capsys.readouterr().err.strip()
    assert code == 2
    assert words in error
    assert "\n" not in error
    assert [p.name for p in tmp_path.iterdir()] == ["t.csv"]


def test_a_damaged_exported_table_is_named_by_its_row(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a_prediction(tmp_path / "run.mcap")
    main(["export", str(tmp_path / "run.mcap"), "--csv", str(tmp_path / "t.csv")])
    lines = (tmp_path / "t.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "t.csv").write_text("\n".join([*lines[:2], lines[2].replace("true", "perhaps"), *lines[3:]]))
    assert main(["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "again.mcap")]) == 2
    assert "row 2: valid = 'perhaps' is not true or false" in capsys.readouterr().err
    assert not list(tmp_path.glob("again*"))


def test_a_damaged_recording_is_not_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a_run(tmp_path / "run.mcap")
    whole = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    assert main(["export", str(tmp_path / "cut.mcap"), "--csv", str(tmp_path / "t.csv")]) == 2
    assert "straw runs recover" in capsys.readouterr().err
    assert not list(tmp_path.glob("t.csv*"))


def test_every_role_has_its_flag_and_the_help_needs_no_numpy() -> None:
    assert set(COLUMNS) == set(ROLES)
    code = "import sys; from straw.replay.tables import options; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
