"""Interrupted tracking continues where it stopped and gives the same result; copies and losses are reported."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from straw.tracking.board import Board
from straw.tracking.camera import Camera, save_camera
from straw.tracking.doubt import REPEATED
from straw.tracking.encode import VideoWriter
from straw.tracking.synthetic import paint_video
from straw.tracking.track import track
from straw.tracking.video import VideoReader
from tests.tracking.test_track import REST, errors, rms


def stop_after(count):
    def progress(done, of):
        if done == count:
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize("stops", [(1,), (20,), (26, 27, 45)])
def test_an_interrupted_track_continues_and_gives_the_same_result(small_clip, tmp_path, stops):
    camera, record = Camera(small_clip.camera.lens), tmp_path / "record"
    for stop in stops:
        with pytest.raises(KeyboardInterrupt):
            track(small_clip.path, camera, Board(), rest_pose=REST, record=record, progress=stop_after(stop))
        assert record.exists()
    seen = []
    again = track(
        small_clip.path, camera, Board(), rest_pose=REST, record=record, progress=lambda n, of: seen.append(n)
    )
    assert seen[0] == stops[-1] + 1
    again.record.remove()
    assert not list(tmp_path.iterdir())
    whole = track(small_clip.path, camera, Board(), rest_pose=REST)
    np.testing.assert_array_equal(again.trace.valid, whole.trace.valid)
    # corners are stored as float32: a ten-thousandth of a pixel, 0.1 um
    np.testing.assert_allclose(again.trace.x_m, whole.trace.x_m, atol=3e-7)
    assert str(again.decode) == str(whole.decode)


def test_a_record_of_another_camera_is_not_continued(small_clip, tmp_path):
    record = tmp_path / "record"
    with pytest.raises(KeyboardInterrupt):
        track(small_clip.path, small_clip.camera, Board(), record=record, progress=stop_after(10))
    other = replace(small_clip.camera, lens=replace(small_clip.camera.lens, fx=880.0))
    seen = []
    track(small_clip.path, other, Board(), record=record, progress=lambda n, of: seen.append(n)).record.remove()
    assert seen[0] == 1


def test_a_killed_track_leaves_a_record_that_can_be_continued(small_clip, tmp_path):
    record = tmp_path / "record"
    with pytest.raises(KeyboardInterrupt):
        track(small_clip.path, small_clip.camera, Board(), record=record, progress=stop_after(30))
    record.write_bytes(record.read_bytes()[:-100])  # cut in the middle of a row
    seen = []
    found = track(small_clip.path, small_clip.camera, Board(), record=record, progress=lambda n, of: seen.append(n))
    found.record.remove()
    assert seen[0] == 30
    assert found.trace.valid.all()


def test_a_repeated_picture_is_not_counted_as_a_frame(small_clip, tmp_path):
    """Some cameras fill a gap with a copy: its time is wrong, and a moving board would appear to stop."""
    with VideoReader(small_clip.path) as old, VideoWriter(tmp_path / "v.mp4", 640, 480, bitrate=15e6) as new:
        last = None
        for frame in old.frames():
            new.write(last if frame.index == 28 else frame.luma)
            last = frame.luma.copy()
    found = track(tmp_path / "v.mp4", small_clip.camera, Board())
    assert dict(found.invalid) == {REPEATED: 1}
    assert np.flatnonzero(~found.trace.valid).tolist() == [28]
    assert np.all(rms(errors(found, small_clip.motion)[0]) < (40, 20, 2))


def test_frames_of_a_still_scene_are_not_taken_for_copies(small, tmp_path):
    paint_video(tmp_path / "v.mp4", small, lambda t: tuple(np.full(t.shape, v) for v in REST), 0.1, bitrate=2e6)
    assert track(tmp_path / "v.mp4", small, Board()).trace.valid.all()


def test_damage_in_the_middle_is_counted_and_bridged(small_clip, tmp_path):
    data = bytearray(small_clip.path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 2000] = np.random.default_rng(0).bytes(2000)
    (tmp_path / "v.mp4").write_bytes(data)
    found = track(tmp_path / "v.mp4", small_clip.camera, Board())
    assert found.decode.decoded < found.decode.expected == len(small_clip.time_s)
    assert found.decode.corrupt > 0
    assert found.trace.valid.sum() > 0.3 * len(small_clip.time_s)
    error = np.abs(errors(found, small_clip.motion)[0])
    assert (error.max(axis=1) < (600, 600, 60)).all()  # a blurred picture may be off, but not by a whole square


def test_one_frame_is_enough_when_the_cameras_pose_is_known(small_clip, tmp_path):
    with VideoReader(small_clip.path) as old, VideoWriter(tmp_path / "v.mp4", 640, 480, bitrate=15e6) as new:
        new.write(next(old.frames()).luma)
    found = track(tmp_path / "v.mp4", small_clip.camera, Board())
    assert found.trace.valid.tolist() == [True]


def test_memory_does_not_grow_with_the_video(small_clip, tmp_path):
    """Three times the frames, in a separate process: the trace itself is 0.1 kB a frame, pictures would be 300 kB."""
    with VideoReader(small_clip.path) as old:
        lumas = [frame.luma.copy() for frame in old.frames()]
    peaks = []
    for name, times in (("a", 1), ("b", 3)):
        with VideoWriter(tmp_path / f"{name}.mp4", 640, 480, bitrate=15e6) as new:
            for luma in (lumas + lumas[::-1]) * times:
                new.write(luma)
        script = (
            "import resource, sys; from straw.tracking.track import track; from straw.tracking.board import Board;"
            "from straw.tracking.camera import load_camera;"
            "track(sys.argv[1], load_camera(sys.argv[2]), Board());"
            "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
        )
        save_camera(tmp_path / "c.json", small_clip.camera)
        command = [sys.executable, "-c", script, str(tmp_path / f"{name}.mp4"), str(tmp_path / "c.json")]
        peaks.append(int(subprocess.run(command, capture_output=True, text=True, check=True).stdout))
    assert peaks[1] - peaks[0] < 25_000  # kB; 208 more frames, 60,000 kB of pictures
