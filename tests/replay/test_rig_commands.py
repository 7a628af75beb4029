"""The rig's commands as an experimentalist uses them: show, run, emulate."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from straw.replay.cli import main
from straw.rig.drivers import make_controller
from straw.rig.errors import RigError
from straw.rig.run_read import read_run

SHORT = """
pressure_unit = "kPa"
initial_deployed = [1, 4]
prefix = [{ hold = 0, for_s = 0.2 }]
main = [{ hold = -15, for_s = 0.6 }, { sine = { mean = -10, amplitude = 5, frequency_hz = 2 }, for_s = 0.5 }]
"""


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    return path


def test_show_draws_the_protocol_and_prints_its_range_and_rates(
    protocol: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture, said = tmp_path / "p.png", tmp_path / "p.json"
    assert main(["rig", "show", str(protocol), "-o", str(picture), "--json", str(said)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    data = json.loads(said.read_text())
    assert (data["min_pa"], data["max_pa"], data["duration_s"]) == (-15e3, 0.0, 1.3)
    assert data["fastest_ramp_pa_per_s"] == pytest.approx(2 * np.pi * 2 * 5e3, rel=2e-3)
    assert "every point is within -40..60 kPa" in capsys.readouterr().out
    assert main(["rig", "show", str(protocol), "-o", str(tmp_path / "no" / "p.png")]) == 2
    assert main(["rig", "show", str(protocol), "-o", str(tmp_path / "p.xyz")]) == 2
    assert not (tmp_path / "p.xyz").exists()


@pytest.mark.parametrize("controller", ["ob1-mk4", "alicat"])
def test_one_protocol_runs_on_model_and_emulator_and_replay_overlays_them(
    controller: str, protocol: Path, tmp_path: Path
) -> None:
    run, tip, said = tmp_path / "run.mcap", tmp_path / "tip.mcap", tmp_path / "m.json"
    command = ["rig", "run", str(protocol), "--emulate", "--fast", "--controller", controller]
    assert main([*command, "-o", str(run), "--tip", str(tip)]) == 0
    assert main(["simulate", "--protocol", str(protocol), "-o", str(tmp_path / "sim.mcap")]) == 0
    report = ["--report", str(tmp_path / "r.html"), "--json", str(said)]
    assert main(["replay", str(run), str(tip), *report]) == 0
    driven, predicted = read_run(run), read_run(tmp_path / "sim.mcap").predictions["straw"].tip
    seen = read_run(tip).tip
    assert driven.pressure is not None
    assert predicted is not None
    assert seen is not None
    assert read_run(tip).metadata["parent_sha256"] == driven.sha256
    # No hardware, no noise in the straw: what is left is that the rig is commanded a new pressure every 10 ms.
    inside = (predicted.time_s > 0) & (predicted.time_s < 1.0)
    apart_m = np.interp(predicted.time_s[inside], seen.time_s, seen.x_m) - predicted.x_m[inside]
    assert np.sqrt(np.mean(apart_m**2)) < 0.02 * np.ptp(predicted.x_m)


def test_limits_and_settings_of_the_command_line_reach_the_controller(protocol: Path, tmp_path: Path) -> None:
    base = ["rig", "run", str(protocol), "--emulate", "--fast", "-o", str(tmp_path / "run.mcap")]
    assert main([*base, "--limits=-10,10"]) == 2
    assert main([*base, "--limits=-10"]) == 2
    assert main([*base, "--setting", "timeout"]) == 2
    assert list(tmp_path.iterdir()) == [protocol]
    assert main([*base, "--limits=-20,10", "--setting", "timeout_s=0.4"]) == 0
    assert read_run(tmp_path / "run.mcap").metadata["limits"] == "-20..10 kPa"


def test_options_of_the_emulator_are_refused_on_a_port(protocol: Path, tmp_path: Path) -> None:
    on = ["rig", "run", str(protocol), "--port", "socket://127.0.0.1:1", "-o", str(tmp_path / "run.mcap")]
    for option in (["--fast"], ["--tip", str(tmp_path / "t.mcap")], ["--setting", "nonsense=1"]):
        assert main([*on, *option]) == 2


@pytest.mark.skipif(os.name != "posix", reason="ends the emulator with SIGTERM")
def test_an_emulator_with_faults_serves_any_client_and_reports_its_faults(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "straw.replay.cli", "rig", "emulate", "--faults", "0.2", "--seed", "3"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2]) as server:
        try:
            assert server.stdout is not None
            url = server.stdout.readline().split(" at ")[1].split(";")[0]
            controller, good = make_controller("ob1-mk4", url, timeout_s=0.1), 0
            for _ in range(40):
                try:
                    controller.read() if controller.is_open else controller.open()
                    good += 1
                except RigError:
                    continue
            assert good > 3
            server.send_signal(signal.SIGTERM)
            said = server.stdout.read()
        finally:
            server.kill()
    assert "faults: " in said
    assert "the tip stood at" in said
