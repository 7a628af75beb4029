"""The commands of README and of the command guide work as printed, the demo first, and write what they claim."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from straw.replay.cli import main
from straw.rig.run_read import read_run
from tests.printed_commands import PAPER, commands

#: Started as from a shell: the demo, a run with its guardian, what takes a moment only. The others are called in
#: this process, which saves their start-ups.
STARTED = ("straw demo", "straw rig run rig/protocols/fold-25kPa.toml --emulate -o run.mcap", "straw runs list")


@pytest.fixture(scope="module")
def place(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the files README names, in which all of README's commands have been run in order."""
    folder = tmp_path_factory.mktemp("readme")
    (folder / "rig").mkdir()
    shutil.copytree(repository / "rig" / "protocols", folder / "rig" / "protocols")
    shutil.copytree(repository / "model" / "samples", folder / "model" / "samples")
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    with contextlib.ExitStack() as servers:
        for command in commands(repository):
            if "pytest" in command or command == PAPER:
                continue  # the tests themselves, and what they run as printed
            assert command.startswith("straw "), f"README runs {command!r}, which this test does not know"
            argv = command.removesuffix(" &").split()
            where = shutil.which(argv[0], path=path)
            assert where, "straw is not installed beside this Python"
            if command.endswith(" &"):
                server = subprocess.Popen([where, *argv[1:]], cwd=folder, stdout=subprocess.PIPE, text=True)
                servers.callback(end, server)
                assert server.stdout is not None
                assert "socket://127.0.0.1:" in server.stdout.readline()
                continue
            code, said, errors = started(where, argv[1:], folder) if command in STARTED else called(argv[1:], folder)
            assert code == 0, f"{command}: {errors}"
            assert "Traceback" not in errors
            (folder / f"{argv[1]}.out").write_text(said, encoding="utf-8")
        yield folder


def started(straw: str, words: list[str], folder: Path) -> tuple[int, str, str]:
    """Exit status and output of a command as a process."""
    done = subprocess.run([straw, *words], cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


def called(words: list[str], folder: Path) -> tuple[int, str, str]:
    """The same of a command that is called in this process."""
    out, errors = io.StringIO(), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        code = main(words)
    return code, out.getvalue(), errors.getvalue()


def end(server: subprocess.Popen[str]) -> None:
    """Ctrl-C ends a server command with exit 0; in any case the process is ended."""
    try:
        server.send_signal(signal.SIGINT)
        said, _ = server.communicate(timeout=20)
        assert server.returncode == 0
        assert "ended" in said
    finally:
        server.kill()


def test_the_demo_tracks_nearly_every_frame_near_the_painted_truth(place: Path) -> None:
    """Required: end-on at 25 degrees with the planar constraint, X and Z <= 30 um, Phi <= 1 mrad RMS."""
    error = json.loads((place / "demo" / "demo.json").read_text())["tracking_error"]
    assert error["x_m"]["rms"] < 30e-6
    assert error["z_m"]["rms"] < 30e-6
    assert error["phi_rad"]["rms"] < 1e-3
    tip = read_run(place / "demo" / "tip.mcap").tip
    assert tip is not None
    assert tip.valid.mean() > 0.99


def test_the_demo_model_follows_the_track_to_within_one_pressure_sample(place: Path) -> None:
    """With the concealed cause found, twin and model agree: what is left is tracking error and the uncertainty of when,
    between two readings 10 ms apart, the pressure changed; the track shifted by 10 ms against itself differs by 2.9 %
    of its range in Phi, RMS.
    """
    told = json.loads((place / "demo" / "demo.json").read_text())
    filmed = told["model_residual"][0]
    for metrics in filmed["metrics"].values():
        assert metrics["nrmse_of_range"] < 0.029
    for channel, metrics in told["base_residual"][0]["metrics"].items():
        assert metrics["rmse"] > 2 * filmed["metrics"][channel]["rmse"]


def test_the_demo_seals_what_it_conceals_and_names_it(place: Path) -> None:
    told = json.loads((place / "demo" / "demo.json").read_text())["seal"]
    said = (place / "demo.out").read_text()
    opened = (place / "demo" / "opened.json").read_bytes()
    assert said.splitlines()[0].endswith(told["sha256"])
    assert hashlib.sha256(opened).hexdigest() == told["sha256"]
    assert json.loads(opened)["cause"] == told["concealed"]
    assert told["named"]
    assert "the diagnosis named it" in said


def test_the_demo_page_needs_no_network_and_says_where_it_is(place: Path) -> None:
    page = (place / "demo" / "replay.html").read_text(encoding="utf-8")
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", page)
    said = (place / "demo.out").read_text()
    assert "replay.html" in said
    assert "tracking error" in said
    assert "improved model" in said


def test_the_demos_steps_run_one_by_one_give_the_same_track(place: Path) -> None:
    whole, alone = (read_run(place / name).tip for name in ("demo/tip.mcap", "tip.mcap"))
    assert whole is not None
    assert alone is not None
    assert (whole.x_m == alone.x_m).all()


def test_a_recorded_run_vents_at_its_end(place: Path) -> None:
    run = read_run(place / "run.mcap")
    assert "vent" in {event.kind for event in run.events}
    assert run.command is not None
    assert run.command.pressure_pa[-1] == 0.0


def test_a_prediction_is_a_recording_under_its_own_topic(place: Path) -> None:
    predicted = read_run(place / "prediction.mcap").predictions["straw"]
    assert predicted.tip is not None
    assert predicted.pressure is not None
    # the paper: cells 1 and 4 deploy, each by 4.3 mm
    assert predicted.tip.x_m.max() - predicted.tip.x_m[0] > 2 * 4.3e-3
