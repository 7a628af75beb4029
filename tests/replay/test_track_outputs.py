"""straw track writes all its outputs (recording with corners and camera, table, page, overlay), or none."""

from __future__ import annotations

import csv
import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

import straw
from straw.replay.cli import main
from straw.rig.run_read import read_run
from straw.rig.schema import message_class
from straw.tracking.board import Board
from straw.tracking.camera import Camera, load_camera, save_camera
from straw.tracking.encode import VideoWriter
from straw.tracking.lens import shipped_lens
from straw.tracking.mend import load_edits
from straw.tracking.synthetic import camera_looking_at, paint_video
from straw.tracking.video import VideoReader
from tests.replay.browser import asked

REST = "22.1,0,87.6620"  # mm, mm, deg


def motion(time_s):
    since = np.clip(np.asarray(time_s) - 0.05, 0, None)
    return 0.0221 - 0.02 * since, 0.03 * since, 1.53 + 1.0 * since


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("track")
    lens = replace(shipped_lens("gopro_hero6_wide_1080p240"), width=640, height=480, cx=319.2, cy=240.4)
    camera = Camera(lens, camera_looking_at((0.0251, 0, 0), 0.212, np.radians(25), 0.0))
    paint_video(folder / "v.mp4", camera, motion, 0.15, bitrate=15e6)
    save_camera(folder / "lens.json", Camera(lens))
    save_camera(folder / "placed.json", camera)
    options = (
        "--csv",
        "t.csv",
        "--overlay",
        "o.mp4",
        "--report",
        "r.html",
        "--save-camera",
        "found.json",
        "--json",
        "j.json",
    )
    named = [str(folder / word) if "." in word else word for word in options]
    command = ["track", str(folder / "v.mp4"), "--camera", str(folder / "lens.json"), "--rest", REST]
    assert main([*command, "-o", str(folder / "tip.mcap"), *named]) == 0
    return folder


def messages(path: Path) -> dict[str, list]:
    found: dict[str, list] = {}
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            found.setdefault(channel.topic, []).append(message_class(schema.name, schema.data).FromString(message.data))
    return found


def test_the_track_names_its_calibration_by_hash_and_the_calibration_its_tracks(place, capsys):
    said = read_run(place / "tip.mcap").metadata
    sha256 = hashlib.sha256((place / "lens.json").read_bytes()).hexdigest()
    assert (said["calibration"], said["calibration_sha256"]) == ("lens.json", sha256)
    assert main(["runs", "show", str(place / "lens.json"), "--dir", str(place)]) == 0
    assert "  tip.mcap\n" in capsys.readouterr().out
    assert main(["runs", "show", str(place / "placed.json"), "--dir", str(place)]) == 0
    assert "tracks: -" in capsys.readouterr().out


def test_the_recording_holds_the_tip_its_quality_the_corners_and_the_camera(place):
    found = messages(place / "tip.mcap")
    frames = len(found["/tip/state"])
    assert frames == len(found["/tip/quality"]) == len(found["/camera/annotations"]) == 36
    (camera,) = found["/camera/calibration"]
    assert (camera.width, camera.distortion_model, len(camera.K)) == (640, "kannala_brandt", 9)
    assert sum(len(group.points) for group in found["/camera/annotations"][0].points) == 49
    assert found["/tip/quality"][0].corners == 49
    run = read_run(place / "tip.mcap")
    assert run.tip.valid.all()
    assert not run.damage
    assert b"world_from_camera" in run.attachments["camera.json"]
    assert run.metadata["decode"] == "decoded 36 of 36 frames"


def test_from_python_the_same_track_is_an_object(place):
    rest = 0.0221, 0.0, np.radians(87.6620)
    steps = []
    found = straw.track(
        place / "v.mp4", place / "lens.json", rest=rest, to_s=0.08, progress=lambda done, total: steps.append(done)
    )
    written = read_run(place / "tip.mcap").tip
    assert steps[-1] == len(found.trace) == 19
    # the shorter part determines the board's mounting angle and the row time from fewer frames
    np.testing.assert_allclose(found.trace.x_m, written.x_m[:19], atol=5 * np.median(written.sigma_x_m))
    assert {"time_s", "x_m", "sigma_phi_rad", "rms_px"} <= set(found.to_dataframe().columns)
    assert "<svg" in found._repr_html_()
    assert len(repr(found)) < 200
    for wrong, words in (({"rest": (22.1, 0, 87.7)}, "looks like mm and degrees"), ({"rest": (1, 2)}, "give .x_m"),
                         ({}, "the camera's place is unknown; give rest=")):  # fmt: skip
        with pytest.raises(straw.ReplayError, match=words):
            straw.track(place / "v.mp4", place / "lens.json", **wrong)


def test_corrections_by_hand_are_recorded_with_their_reasons(place, tmp_path, capsys):
    text = """[[invalid]]
frames = "20-22"
reason = "a fly on the board"
[[pose]]
frame = 25
x_mm = 20.0
z_mm = 1.5
phi_deg = 90
sigma_mm = 0.5
sigma_deg = 1
reason = "read off the picture"
"""
    (tmp_path / "mend.toml").write_text(text, encoding="utf-8")
    command = ["track", str(place / "v.mp4"), "--camera", str(place / "placed.json"), "-o", str(tmp_path / "t.mcap")]
    assert main([*command, "--mend", str(tmp_path / "mend.toml"), "--report", str(tmp_path / "r.html")]) == 0
    run, grades = read_run(tmp_path / "t.mcap"), messages(tmp_path / "t.mcap")["/tip/quality"]
    assert np.flatnonzero(~run.tip.valid).tolist() == [20, 21, 22]
    assert grades[21].reason == "by hand: a fly on the board"
    assert run.tip.x_m[25] == pytest.approx(0.02)
    assert grades[25].reason == "by hand: read off the picture"
    assert run.attachments["mend.toml"].decode() == text
    assert "3 frames without a trustworthy board: by hand: a fly on the board" in capsys.readouterr().err
    assert "read off the picture" in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_a_page_steps_through_frames_and_writes_corrections(place, tmp_path):
    """In a browser: a frame is refused with a reason, a point is clicked. The file it writes is read by --mend."""
    page = tmp_path / "s.html"
    command = ["track", str(place / "v.mp4"), "--camera", str(place / "placed.json"), "-o", str(tmp_path / "t.mcap")]
    assert main([*command, "--step", str(page), "--step-frames", "4-9"]) == 0
    text = page.read_text(encoding="utf-8")
    assert "http" not in text
    script = """
      const press = (id) => document.getElementById(id).click();
      dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
      press("refuse");
      const unsaid = text.value;
      why.value = 'a "fly"';
      last.value = 7;
      press("refuse");
      press("set");
      press("point");
      await new Promise((done) => { picture.complete ? done() : picture.onload = done; });
      const box = picture.getBoundingClientRect();
      picture.dispatchEvent(new MouseEvent("click", { clientX: box.left + box.width / 2, clientY: box.top }));
      return { unsaid, text: text.value, says: says.textContent };"""
    found = asked(text, script, tmp_path)
    assert not found["errors"]
    assert found["answer"]["unsaid"] == ""
    assert found["answer"]["says"].startswith("frame 5, ")
    (tmp_path / "mend.toml").write_text(found["answer"]["text"], encoding="utf-8")
    refused, posed, point = load_edits(tmp_path / "mend.toml")
    assert (refused.first, refused.last, refused.reason) == (5, 7, 'a "fly"')
    tip = read_run(tmp_path / "t.mcap").tip
    np.testing.assert_allclose(posed.pose[:2], (tip.x_m[5], tip.z_m[5]), atol=1e-6)
    assert (point.first, point.last) == (5, 9)
    assert 0 < point.at_px[0] < 640


@pytest.mark.parametrize("frames", ["9", "5-2", "0-36", "0-500"])
def test_frames_that_no_page_can_show_are_refused(place, tmp_path, capsys, frames):
    command = ["track", str(place / "v.mp4"), "--camera", str(place / "placed.json"), "-o", str(tmp_path / "t.mcap")]
    assert main([*command, "--step", str(tmp_path / "s.html"), "--step-frames", frames]) == 2
    assert f"--step-frames {frames}" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []  # before the film is tracked


def test_a_correction_of_missing_frames_leaves_no_file(place, tmp_path, capsys):
    (tmp_path / "mend.toml").write_text('[[invalid]]\nframes = "30-36"\nreason = "r"\n', encoding="utf-8")
    command = ["track", str(place / "v.mp4"), "--camera", str(place / "placed.json"), "-o", str(tmp_path / "t.mcap")]
    assert main([*command, "--mend", str(tmp_path / "mend.toml")]) == 2
    assert capsys.readouterr().err.strip().endswith("names frames 30-36, the video has 0 to 35")
    assert not (tmp_path / "t.mcap").exists()


def test_the_table_agrees_with_the_recording(place):
    rows = list(csv.DictReader((place / "t.csv").read_text(encoding="utf-8").splitlines()))
    tip = read_run(place / "tip.mcap").tip
    np.testing.assert_allclose([float(row["x_m"]) for row in rows], tip.x_m, rtol=1e-8)
    assert {row["valid"] for row in rows} == {"1"}


def test_the_overlay_shows_every_frame_and_the_page_needs_no_network(place):
    with VideoReader(place / "o.mp4") as video:
        assert video.expected == 36
    text = (place / "r.html").read_text(encoding="utf-8")
    assert "36 of 36 frames are valid" in text
    assert "http" not in text


def test_the_camera_pose_found_in_one_video_is_used_for_the_next(place):
    found, truth = load_camera(place / "found.json"), load_camera(place / "placed.json")
    np.testing.assert_allclose(found.world_from_camera, truth.world_from_camera, atol=5e-3)
    output = place / "again.mcap"
    assert main(["track", str(place / "v.mp4"), "--camera", str(place / "found.json"), "-o", str(output)]) == 0
    first, again = read_run(place / "tip.mcap").tip, read_run(output).tip
    np.testing.assert_allclose(again.x_m, first.x_m, atol=3e-5)


def test_a_failed_command_leaves_no_files(place, capsys):
    before = sorted(place.iterdir())
    command = ["track", str(place / "v.mp4"), "--camera", str(place / "placed.json"), "-o", str(place / "n.mcap")]
    for wrong in (
        ["--board", "10x7,48"],
        ["--board", "eight"],
        ["--near", "5"],
        ["--csv", str(place / "no" / "t.csv")],
    ):
        assert main([*command, *wrong]) == 2
        said = capsys.readouterr().err.strip()
        assert said.startswith("straw: ")
        assert "\n" not in said
        assert sorted(place.iterdir()) == before


def test_a_reference_board_gives_the_cameras_pose(place, tmp_path):
    lens = replace(load_camera(place / "lens.json").lens, width=960, height=480)
    where = camera_looking_at((0.0251, 0, 0), 0.212, np.radians(25), 0.0)
    fixed = np.eye(4)
    fixed[:3, :3] = np.array(((0, 0, 1.0), (0, 1, 0), (-1, 0, 0)))  # faces +X, x down
    fixed[:3, 3] = (0.02, 0.062, 0.0)
    paint_video(tmp_path / "v.mp4", Camera(lens, where), motion, 0.06, decoys=((Board(6, 0.036), fixed),), bitrate=30e6)
    save_camera(tmp_path / "lens.json", Camera(lens))
    (tmp_path / "ref.json").write_text(
        f'{{"squares": 6, "size_m": 0.036, "board_x_in_image": "down", "world_from_board": {fixed.tolist()}}}'
    )
    command = [
        "track",
        str(tmp_path / "v.mp4"),
        "--camera",
        str(tmp_path / "lens.json"),
        "-o",
        str(tmp_path / "t.mcap"),
    ]
    assert main([*command, "--reference", str(tmp_path / "ref.json")]) == 0
    tip = read_run(tmp_path / "t.mcap").tip
    # the small board's own pose: 0.01 px in 25 corners; its tilt, some mrad, at 62 mm from it
    np.testing.assert_allclose(tip.z_m[tip.valid], motion(np.arange(14) * 1001 / 240000)[1], atol=1e-3)
    assert tip.valid.all()


def test_a_picture_without_a_reference_board_is_refused(place, capsys):
    (place / "ref.json").write_text(
        '{"squares": 12, "size_m": 0.1, "world_from_board": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}'
    )
    command = ["track", str(place / "v.mp4"), "--camera", str(place / "lens.json"), "-o", str(place / "n.mcap")]
    assert main([*command, "--reference", str(place / "ref.json")]) == 2
    assert "reference board" in capsys.readouterr().err


def test_stills_without_a_board_are_an_error(tmp_path, capsys):
    with VideoWriter(tmp_path / "v.mp4", 320, 240) as video:
        video.write(np.full((240, 320), 100, np.uint8))
    assert main(["calibrate", str(tmp_path / "v.mp4"), "-o", str(tmp_path / "c.json")]) == 2
    assert "0 checkerboards" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["v.mp4"]
