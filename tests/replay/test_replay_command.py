"""straw replay from the command line: snaps and verdicts as JSON, roles, predictions, pictures, film, comparisons."""

from __future__ import annotations

import base64
import json
import math
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from mcap.reader import make_reader

from straw.model.parameters import StrawParameters
from straw.replay.cli import main
from straw.replay.compare.comparison import compare
from straw.replay.compare.gather import gather
from straw.replay.report.proxy import film
from straw.rig.run_read import read_run
from straw.tracking.camera import Camera, save_camera
from straw.tracking.encode import VideoWriter
from straw.tracking.lens import shipped_lens
from straw.tracking.synthetic import camera_looking_at
from tests.replay.test_report import unpacked

#: Cell 1 folds within a second.
FOLD = """
pressure_unit = "kPa"
initial_deployed = [1, 4]
prefix = [{ hold = 0, for_s = 0.2 }]
main = [{ hold = -25, for_s = 1.05 }]
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A run on the emulator and its tip as an ideal camera records it."""
    folder = tmp_path_factory.mktemp("rig")
    (folder / "fold.toml").write_text(FOLD)
    run, tip = folder / "run.mcap", folder / "tip.mcap"
    drive = ["rig", "run", str(folder / "fold.toml"), "--emulate", "--fast", "-o", str(run), "--tip", str(tip)]
    assert main(drive) == 0
    return run, tip


def replay(rig: tuple[Path, Path], folder: Path, *more: str) -> dict[str, Any]:
    said = folder / "said.json"
    command = ["replay", *map(str, rig), "--report", str(folder / "r.html"), "--json", str(said)]
    assert main([*command, *more]) == 0
    (run,) = json.loads(said.read_text())["runs"]
    return dict(run)


def refused(rig: tuple[Path, Path], capsys: pytest.CaptureFixture[str], folder: Path, *more: str) -> str:
    assert main(["replay", *map(str, rig), "--report", str(folder / "r.html"), *more]) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    assert said.splitlines()[-1].startswith("straw: ")
    return said


def test_an_emulated_straw_whose_walls_age_is_as_old_as_replay_takes_it_to_be(tmp_path: Path) -> None:
    """A tenth softer since a second of Unix time that has long passed; replayed without, it snaps at another time."""
    ages = [f"at_{n}_s = {n}.0\naged_{n} = -0.1\n" for n in range(1, 9)]
    ages[0] = "at_1_s = 1.0\naged_1 = 0.0\n"  # not yet
    aged = tmp_path / "aged.toml"
    aged.write_text("zero_time_s = 1e9\n[terms.missing_force]\namount = 1.0\n" + "".join(ages))
    (tmp_path / "fold.toml").write_text(FOLD)
    run, tip = tmp_path / "run.mcap", tmp_path / "tip.mcap"
    drive = ["rig", "run", str(tmp_path / "fold.toml"), "--emulate", "--fast", "-o", str(run), "--tip", str(tip)]
    assert main([*drive, "--straw", str(aged)]) == 0
    late_s = [replay((run, tip), tmp_path, *more)["snaps"][0]["late_s"] for more in (["--straw", str(aged)], [])]
    assert abs(late_s[0]) < 3e-3 < abs(late_s[1])


def test_the_snap_of_cell_1_is_in_both_at_the_same_time(rig: tuple[Path, Path], tmp_path: Path) -> None:
    """Readings at 100 Hz limit a snap's time to about a millisecond."""
    run = replay(rig, tmp_path)
    (snap,) = run["snaps"]
    assert (snap["measured"]["cell"], snap["predicted"]["cell"]) == (1, 1)
    assert abs(snap["late_s"]) < 3e-3
    names = [q["name"] for q in run["quantities"]]
    assert "snap 1 (cell 1) start" in names
    assert {q["verdict"] for q in run["quantities"]} <= {"off", "cannot be resolved", "no statement"}
    assert run["order"] == "Cells snap in the order 1; predicted: 1."


def test_a_constants_uncertainty_is_part_of_the_validation_uncertainty(
    rig: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (start,) = (q for q in replay(rig, tmp_path)["quantities"] if q["name"].endswith("start"))
    assert start["u_input"] == 0.0
    known = replay(rig, tmp_path, "--uncertain", "r_ch_m=1e-6")
    (start,) = (q for q in known["quantities"] if q["name"].endswith("start"))
    # flow goes with the square of the radius: 0.5 % of 0.58 s to the snap
    assert start["u_input"] == pytest.approx(2.7e-3, rel=0.5)
    assert known["uncertain_inputs"] == ["r_ch_m"]
    assert "expected a constant and its sigma" in refused(rig, capsys, tmp_path, "--uncertain", "r_ch_m")
    assert "nonsense is not a constant" in refused(rig, capsys, tmp_path, "--uncertain", "nonsense=1")


def test_runs_are_marked_as_fitted_or_held_out(
    rig: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert replay(rig, tmp_path)["role"] == ""
    assert replay(rig, tmp_path, "--fitted", "run")["role"] == "fitted"
    fit = tmp_path / "fit.json"
    fit.write_text('{"joint": {"runs": ["another"]}}')
    assert replay(rig, tmp_path, "--fitted", str(fit))["role"] == "held out"
    assert "none of the runs given" in refused(rig, capsys, tmp_path, "--fitted", "nobody")
    fit.write_text("[]")
    assert "holds no fit" in refused(rig, capsys, tmp_path, "--fitted", str(fit))


def test_a_prediction_is_a_recording_of_its_own_on_the_same_clock(
    rig: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    replay(rig, tmp_path, "--predictions", str(tmp_path))
    recorded, written = read_run(rig[0]), read_run(tmp_path / "run-prediction.mcap")
    predicted = written.predictions["straw"]
    assert written.zero_time_ns == recorded.zero_time_ns
    assert written.metadata["parent_sha256"] == recorded.sha256
    assert "r_ch_m" in written.metadata["straw"]
    assert "git_commit" in written.software
    assert predicted.tip is not None
    assert predicted.pressure is not None
    (comparison,) = (compare(run, StrawParameters()) for run in gather(rig))
    np.testing.assert_allclose(predicted.tip.x_m, comparison.prediction.x_m, atol=1e-12)
    with (tmp_path / "run-prediction.mcap").open("rb") as stream:  # as any other program reads it
        messages = list(make_reader(stream, validate_crcs=True).iter_messages())
    assert {(schema.encoding, channel.topic) for schema, channel, _ in messages if schema} == {
        ("protobuf", "/sim/straw/tip/state"),
        ("protobuf", "/sim/straw/pressure"),
    }
    assert all(message.log_time == message.publish_time for _, _, message in messages)
    assert "not overwritten" in refused(rig, capsys, tmp_path, "--predictions", str(tmp_path))


def test_the_overlay_is_drawn_at_publication_quality(
    rig: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    replay(rig, tmp_path, "--png", str(tmp_path / "o.png"))
    assert (tmp_path / "o.png").read_bytes().startswith(b"\x89PNG")
    assert "unknown kind of picture" in refused(rig, capsys, tmp_path, "--png", str(tmp_path / "o.xyz"))
    assert not list(tmp_path.glob("o.xyz*"))


def test_model_emulator_and_recording_of_one_protocol_differ_by_what_lies_between_them(
    rig: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The recording is the emulator's own; the model alone lacks the wire's delay and the sampling, half a sample."""
    found = {(d["one"], d["other"], d["signal"]): d for d in replay(rig, tmp_path, "--protocol")["three_ways"]}
    assert len(found) == 3 * 4
    assert found["recording", "emulator", "X"]["rmse"] < 1e-6
    assert abs(found["recording", "model", "Phi"]["lag_s"]) < 0.01
    assert found["recording", "model", "X"]["rmse"] < 1e-4
    (tmp_path / "other.toml").write_text(FOLD.replace("[1, 4]", "[2]"))
    said = refused(rig, capsys, tmp_path, "--protocol", str(tmp_path / "other.toml"))
    assert "give the protocol of that run" in said


def test_the_film_has_every_frame_and_both_tips_where_a_pinhole_would_have_them(
    rig: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (run,) = gather(rig)
    assert run.tip is not None
    frames = len(run.tip)
    comparison = compare(run, StrawParameters())
    lens = shipped_lens("gopro_hero6_wide_1080p240")
    place = camera_looking_at((float(run.tip.x_m[0]), 0.0, 0.0), 0.2, -math.pi / 2, 0.0)  # from the side
    save_camera(tmp_path / "camera.json", Camera(lens, place))
    with VideoWriter(tmp_path / "v.mp4", 1920, 1080, Fraction(240), 1e6) as video:
        for k in range(frames):
            video.write(np.full((1080, 1920), k % 200, np.uint8))
    made = film(comparison, [tmp_path / "v.mp4"], tmp_path / "camera.json")
    data = base64.b64decode(made["src"].partition(",")[2])
    with av.open(BytesIO(data)) as proxy:
        stream = proxy.streams.video[0]
        assert stream.codec_context.name == "h264"
        packets = [packet for packet in proxy.demux(stream) if packet.pts is not None]
        assert [p.pts for p in packets] == sorted(p.pts for p in packets)  # no B-frames: decoded as shown
        assert all(p.dts == p.pts for p in packets)
        assert len(packets) == frames
    np.testing.assert_allclose(unpacked(made["time"]), run.tip.time_s, atol=1e-6)
    tips = unpacked(made["measured"]).reshape(-1, 2)
    # near the axis the lens is a pinhole: along the picture a tip moves by f / distance a metre, in the proxy's pixels
    x_m = run.tip.x_m - run.tip.x_m[0]
    assert np.abs(x_m).max() > 2e-3
    width = made["width"] / (
        np.ptp(tips[:, 0]) / np.ptp(run.tip.x_m) * 0.2 / lens.fx
    )  # of the crop, in the camera's px
    assert width == pytest.approx(2 * 0.12 * 1920 + np.ptp(run.tip.x_m) * lens.fx / 0.2, rel=0.05)
    assert np.corrcoef(tips[:, 0], x_m)[0, 1] == pytest.approx(1.0, abs=1e-4)
    assert "names no camera" in refused(rig, capsys, tmp_path, "--video", str(tmp_path / "v.mp4"))
