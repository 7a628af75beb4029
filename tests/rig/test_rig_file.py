"""A rig file describes the set-up, or is refused in one line that says what is wrong."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from straw.replay.cli import main
from straw.rig.errors import RigError
from straw.rig.rig_file import load_rig
from straw.rig.run_channels import details
from straw.rig.run_read import read_run

BENCH = """
name = "bench 1"
folder = "recordings"
[controller]
emulate = true
channels = [1, 2]
[limits]
min = -30
max = 40
max_rate = 500
"""
TWO = """
pressure_unit = "kPa"
initial_deployed = [1, 4]
prefix = [{ hold = 0, for_s = 0.1 }]
main = [{ ramp = [0, -5], for_s = 0.3 }]
[[also]]
channel = 2
main = [{ ramp = [0, 6], for_s = 0.3 }]
"""


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(BENCH)
    return path


def test_a_rig_file_describes_the_whole_set_up(bench: Path) -> None:
    rig = load_rig(bench)
    assert (rig.name, rig.folder, rig.channels, rig.emulated) == ("bench 1", bench.parent / "recordings", (1, 2), True)
    assert (rig.limits.min_pa, rig.limits.max_pa, rig.limits.max_rate_pa_s) == (-30e3, 40e3, 500e3)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("emulate = true", ""), r"rig\.toml: \[controller\]: write either port"),
        (("emulate = true", 'emulate = true\nport = "/dev/x"'), "write either port"),
        (("[1, 2]", "[1, 1]"), "names a channel twice"),
        (("[1, 2]", '["one"]'), "must be a whole number"),
        (("min = -30", "min = 30"), "contain 0, the vented state"),
        (("min = -30", "lowest = -30"), "unknown key 'lowest'"),
        (('name = "bench 1"', 'straw = "no.toml"'), "is not a file"),
        (("[limits]", '[camera]\nkind = "gopro"\n[limits]'), "address is missing"),
        (("[limits]", "[limits"), "not valid TOML"),
    ],
)
def test_an_error_is_reported_with_its_place(bench: Path, change: tuple[str, str], said: str) -> None:
    bench.write_text(BENCH.replace(*change))
    with pytest.raises(RigError, match=said) as error:
        load_rig(bench)
    assert "\n" not in str(error.value)


def test_a_protocol_drives_two_channels_and_every_channel_and_flow_is_recorded(bench: Path, tmp_path: Path) -> None:
    (tmp_path / "two.toml").write_text(TWO)
    run = tmp_path / "run.mcap"
    told = ["rig", "run", str(tmp_path / "two.toml"), "--rig", str(bench), "--fast", "-o", str(run)]
    assert main([*told, "--specimen", "s9", "--cycle", "4"]) == 0
    signals = details(run)["signals"]
    assert {"command 1", "command 2", "pressure 1", "pressure 2", "flow 1", "flow 2"} <= set(signals)
    for channel, end in ((1, -5.0), (2, 6.0)):
        reached = [
            v
            for t, v in zip(*(signals[f"pressure {channel}"][k] for k in ("time_s", "values")), strict=True)
            if t > 0.25
        ]
        assert reached[-1] == pytest.approx(end, abs=0.7)  # a lag of 20 ms on a ramp of 20 kPa/s, and 0.1 kPa of noise
    found = read_run(run)
    assert (found.specimen, found.cycle) == ("s9", 4)
    assert found.pressure is not None
    assert found.pressure.pressure_pa.min() < 0 < 600  # the straw's channel is the one that drives the model


def test_the_rig_files_limits_hold_whatever_a_flag_says(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "two.toml").write_text(TWO.replace("-5]", "-35]"))
    told = ["rig", "run", str(tmp_path / "two.toml"), "--rig", str(bench), "--fast", "-o", str(tmp_path / "run.mcap")]
    assert main([*told, "--limits=-60,60"]) == 2
    assert "below the limit of -30 kPa" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.mcap*"))


def test_check_reads_every_channel_and_vents_without_and_with_pressure(
    bench: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["rig", "check", "--rig", str(bench)]) == 0
    said = capsys.readouterr().out
    for channel in (1, 2):
        assert re.search(
            rf"channel {channel}: ok: vented from 0 kPa .* at a command of 2 kPa .* vented from 2 kPa", said
        )
    assert "flow" in said
