"""The command line: quick to answer, and bad input is one line and exit 2."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.replay.cli import main
from straw.rig.notes import read_notes
from straw.rig.run_read import read_run
from straw.rig.run_write import RunWriter
from straw.tracking.camera import Camera, save_camera
from straw.tracking.encode import VideoWriter
from straw.tracking.lens import shipped_lens

PROTOCOL = 'name = "p"\npressure_unit = "kPa"\ninitial_deployed = [1, 4]\n[[main]]\nhold = {p}\nfor_s = {t}\n'
ZERO_NS = 1_795_000_000_000_000_000


def test_help_loads_none_of_the_heavy_libraries() -> None:
    """Loading none of them keeps the answer under 0.3 s, on any machine."""
    code = (
        "import sys; from straw.replay.cli import parser; parser().format_help(); "
        "print(*{'numpy', 'scipy', 'cv2', 'numba', 'av', 'mcap', 'serial', 'google', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_version_names_the_installed_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert capsys.readouterr().out.startswith(f"straw {metadata.version('straw')}")


@pytest.fixture
def good(tmp_path: Path) -> Path:
    """A folder with one good file of each kind."""
    (tmp_path / "p.toml").write_text(PROTOCOL.format(p=-5, t=0.2))
    save_camera(tmp_path / "camera.json", Camera(shipped_lens("gopro_hero6_wide_1080p240")))
    with VideoWriter(tmp_path / "blank.mp4", 1920, 1080) as video:
        for _ in range(6):
            video.write(np.full((1080, 1920), 90, np.uint8))
    recording(tmp_path / "run.mcap")
    return tmp_path


def recording(path: Path, *, pressure: bool = True, tip: bool = True, deployed: str | None = "1,4") -> None:
    metadata = {"run_id": path.stem, "specimen": "s", "cycle": "0", "zero_time_ns": str(ZERO_NS), "cells": "9"}
    if deployed is not None:
        metadata["initial_deployed"] = deployed
    with RunWriter(path, metadata) as writer:
        for i in range(200):
            now_ns = ZERO_NS + i * 5_000_000
            if pressure:
                writer.add("/pressure/measured", now_ns, pressure_pa=0.0, sigma_pa=30.0, channel=1)
            if tip:
                pose = {"x_m": 0.0221, "z_m": -8e-5, "phi_rad": 1.577, "valid": True, "frame": i}
                writer.add("/tip/state", now_ns, **pose, sigma_x_m=2.5e-5, sigma_z_m=2.5e-5, sigma_phi_rad=1.5e-3)


def refused(capsys: pytest.CaptureFixture[str], *argv: str | Path) -> str:
    """The one line with which a command refuses its input; it must leave no new file behind."""
    folder = Path(str(argv[-1])).parent
    before = {p for p in folder.rglob("*") if p.suffix in (".part", ".mcap", ".html", ".json")}
    try:
        code = main([str(a) for a in argv])
    except SystemExit as stop:  # argparse exits this way
        code = stop.code  # type: ignore[assignment]
    said = capsys.readouterr()
    assert code == 2, said
    lines = said.err.strip().splitlines()
    assert len(lines) == 1, said.err
    assert "Traceback" not in said.err
    assert {p for p in folder.rglob("*") if p.suffix in (".part", ".mcap", ".html", ".json")} == before
    return lines[0]


def no_file(folder: Path, suffix: str) -> Path:
    return folder / f"none{suffix}"


def a_directory(folder: Path, suffix: str) -> Path:
    (folder / f"folder{suffix}").mkdir()
    return folder / f"folder{suffix}"


def an_empty_file(folder: Path, suffix: str) -> Path:
    (folder / f"empty{suffix}").touch()
    return folder / f"empty{suffix}"


def random_bytes(folder: Path, suffix: str) -> Path:
    (folder / f"random_bytes{suffix}").write_bytes(bytes(range(256)) * 40)
    return folder / f"random_bytes{suffix}"


def a_truncated_recording(folder: Path, suffix: str) -> Path:
    whole = (folder / "run.mcap").read_bytes()
    path = folder / f"cut{suffix}"
    path.write_bytes(whole[: len(whole) * 2 // 3])
    return path


FILES = [no_file, a_directory, an_empty_file, random_bytes, a_truncated_recording]


@pytest.mark.parametrize("make", FILES)
@pytest.mark.parametrize(
    "command",
    [
        ("replay", "{bad.mcap}", "--report", "{out.html}"),
        ("replay", "run.mcap", "--straw", "{bad.toml}", "--report", "{out.html}"),
        ("simulate", "--protocol", "{bad.toml}", "-o", "{out.mcap}"),
        ("simulate", "--protocol", "p.toml", "--straw", "{bad.toml}", "-o", "{out.mcap}"),
        ("rig run", "{bad.toml}", "--emulate", "-o", "{out.mcap}"),
        ("track", "{bad.mp4}", "--camera", "camera.json", "--rest", "22,0,90", "-o", "{out.mcap}"),
        ("track", "blank.mp4", "--camera", "{bad.json}", "--rest", "22,0,90", "-o", "{out.mcap}"),
        ("track", "blank.mp4", "--camera", "camera.json", "--run", "{bad.mcap}", "-o", "{out.mcap}"),
    ],
    ids=lambda c: " ".join(c) if isinstance(c, tuple) else None,
)
def test_a_bad_file_in_any_place_is_named_in_one_line_with_exit_2(
    good: Path, make: Callable[[Path, str], Path], command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    argv: list[str | Path] = []
    bad = None
    for word in command:
        if word.startswith("{bad"):
            bad = make(good, word[4:-1])
            argv.append(bad)
        elif word.startswith("{out"):
            argv.append(good / word[1:-1])
        elif word.endswith((".toml", ".mcap", ".json", ".mp4")):
            argv.append(good / word)
        else:
            argv += word.split() if word.startswith("rig") else [word]
    assert bad is not None
    assert bad.name in refused(capsys, *argv)


@pytest.mark.parametrize(
    ("pressure", "duration", "words"),
    [("nan", "1", "hold"), ("-500", "1", "limit"), ("5", "nan", "for_s"), ("5", "-1", "for_s"), ("'x'", "1", "hold")],
)
@pytest.mark.parametrize("command", [("simulate", "--protocol"), ("rig", "run", "--emulate")])
def test_a_protocol_that_is_not_safe_numbers_is_refused_before_anything_moves(
    good: Path, pressure: str, duration: str, words: str, command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    (good / "bad.toml").write_text(PROTOCOL.format(p=pressure, t=duration))
    line = refused(capsys, *command, good / "bad.toml", "-o", good / "out.mcap")
    assert "bad.toml" in line
    assert words in line


@pytest.mark.parametrize("port", ["/dev/ttyNONE", "socket://127.0.0.1:9", "nonsense://x"])
def test_a_port_that_does_not_open_is_named(good: Path, port: str, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(capsys, "rig", "run", good / "p.toml", "--port", port, "-o", good / "out.mcap")
    assert port.removeprefix("nonsense:") in line


def test_an_unknown_controller_is_answered_with_the_known_ones(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for where in (["--emulate"], ["--port", "x"]):
        line = refused(capsys, "rig", "run", good / "p.toml", *where, "--controller", "ob2", "-o", good / "out.mcap")
        assert "ob1-mk4" in line


def test_a_video_that_shows_no_board_is_refused(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ("track", good / "blank.mp4", "--camera", good / "camera.json", "--rest", "22,0,90", "-o", good / "t.mcap")
    assert "no board" in refused(capsys, *argv)


def test_tracking_without_the_cameras_pose_names_the_three_ways_to_give_it(
    good: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refused(capsys, "track", good / "blank.mp4", "--camera", good / "camera.json", "-o", good / "t.mcap")
    for way in ("--rest", "--run", "world_from_camera"):
        assert way in line


@pytest.mark.parametrize(
    ("lacking", "words"),
    [
        ({"pressure": False}, "/pressure/measured"),
        ({"tip": False}, "/tip/state"),
        ({"deployed": None}, "initial_deployed"),
        ({"deployed": "1,44"}, "initial_deployed"),
    ],
)
def test_a_recording_that_lacks_what_a_prediction_needs_is_refused_with_the_cure(
    good: Path, lacking: dict[str, object], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    recording(good / "lacking.mcap", **lacking)  # type: ignore[arg-type]
    line = refused(capsys, "replay", good / "lacking.mcap", "--report", good / "r.html")
    assert "lacking.mcap" in line
    assert words in line


def test_a_straw_with_another_number_of_cells_does_not_predict_a_run(
    good: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (good / "s.toml").write_text(StrawParameters(cells=7).to_toml())
    line = refused(capsys, "replay", good / "run.mcap", "--straw", good / "s.toml", "--report", good / "r.html")
    assert "9 cells" in line


def test_a_cut_recording_can_be_replayed_when_asked_and_says_what_was_lost(
    good: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cut = a_truncated_recording(good, ".mcap")
    assert main(["replay", "--partial", str(cut), "--report", str(good / "r.html")]) == 0
    assert "never finished" in capsys.readouterr().err


def test_a_report_that_cannot_be_written_is_named(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(capsys, "replay", good / "run.mcap", "--report", good / "no" / "where" / "r.html")
    assert "cannot be written" in line


def test_a_demo_never_clears_a_folder_that_is_not_its_own(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "not an earlier demo" in refused(capsys, "demo", "--out", good)
    assert (good / "run.mcap").exists()


@pytest.mark.parametrize("argv", [[], ["replay"], ["nothing"], ["rig"], ["track", "x.mp4"]])
def test_an_invalid_command_line_is_one_line_too(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(argv)
    assert stop.value.code == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_a_repeated_demo_leaves_files_that_it_did_not_make(tmp_path: Path) -> None:
    from straw.replay.commands.demo import MADE, clear_folder

    folder = clear_folder(tmp_path / "demo")
    for name in (*MADE, "tip.mcap.part", "mine.mcap"):
        (folder / name).touch()
    clear_folder(folder)
    assert sorted(p.name for p in folder.iterdir()) == [".straw-demo", "mine.mcap"]


def test_filling_tests_and_readings_become_a_straw_that_simulates(
    good: Path, repository: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = repository / "model" / "samples" / "filling.csv"
    lengths = ("--folded-length-mm", "1.5", "--deployed-length-mm", "5.8")
    pressures = ("--fold-pressure-kpa", "-13.5", "--deploy-pressure-kpa", "22.5")
    channel, straw = str(good / "channel.toml"), str(good / "straw.toml")
    assert main(["identify", "filling", str(table), "-o", channel]) == 0
    assert main(["identify", "geometry", *lengths, *pressures, "--straw", channel, "-o", straw]) == 0
    said = capsys.readouterr().out
    assert "r_ch = 0.5196 mm" in said
    assert "0.9200 ± 0.0114 GPa" in said
    assert main(["simulate", "--straw", straw, "--protocol", str(good / "p.toml"), "-o", str(good / "p.mcap")]) == 0
    assert "straw.toml" in refused(capsys, "identify", "filling", table, "-o", straw)


@pytest.mark.parametrize("make", [no_file, a_directory, an_empty_file, random_bytes])
def test_a_bad_table_of_filling_tests_is_named(
    good: Path, make: Callable[[Path, str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    bad = make(good, ".csv")
    assert bad.name in refused(capsys, "identify", "filling", bad, "-o", good / "straw.toml")


def test_operator_notes_tags_and_facts_are_on_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "p.toml").write_text(PROTOCOL.format(p=-1, t=0.1))
    run = ["rig", "run", str(tmp_path / "p.toml"), "--emulate", "--fast", "-o", str(tmp_path / "r.mcap")]
    assert main([*run, "--meta", "cycles=3"]) == 2
    assert "cycles is the recording's own" in capsys.readouterr().err
    assert main([*run, "--tag", "two words"]) == 2
    assert "expected one word" in capsys.readouterr().err
    assert not (tmp_path / "r.mcap").exists()
    about = ["--operator", "Ada", "--note", "pump was loud", "--note", "new tube", "--tag", "good"]
    assert main([*run, *about, "--meta", "fluid=water 20 C", "--meta", "specimen=s-9"]) == 0
    recorded = read_run(tmp_path / "r.mcap")
    assert recorded.specimen == "s-9"
    assert [recorded.metadata[key] for key in ("operator", "note", "fluid")] == [
        "Ada",
        "pump was loud / new tube",
        "water 20 C",
    ]
    notes = read_notes(tmp_path / "r.mcap")
    assert notes.tags == ("good",)
    assert [text for _, text in notes.notes] == ["pump was loud", "new tube"]
