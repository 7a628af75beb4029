"""Chapters form one timeline; the camera's telemetry is read where present, and damage in it does no harm."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest

from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.chapters import Timeline, copies, in_order, siblings
from straw.tracking.encode import VideoWriter
from straw.tracking.errors import TrackingError
from straw.tracking.gpmf import parse_telemetry, read_telemetry
from straw.tracking.lens import Lens
from straw.tracking.track import track
from straw.tracking.video import VideoReader
from tests.painting.film import encode
from tests.tracking.test_video import pictures, written


def test_gopro_chapters_are_sorted_and_other_files_keep_their_order():
    names = ["GX030012.MP4", "GX010012.MP4", "GX020012.MP4"]
    assert [path.name for path in in_order(names)] == sorted(names)
    assert [path.name for path in in_order(["b.mp4", "a.mp4"])] == ["b.mp4", "a.mp4"]


@pytest.mark.parametrize(
    ("names", "says"),
    [
        (["GH010012.MP4", "GH030012.MP4"], "every chapter in between"),
        (["GH010012.MP4", "GH020013.MP4"], "two recordings"),
        (["GH010012.MP4", "GH010012.MP4"], "once"),
        ([], "no video"),
    ],
)
def test_chapters_that_do_not_belong_together_are_refused_in_one_line(names, says):
    with pytest.raises(TrackingError, match=says) as caught:
        in_order(names)
    assert "\n" not in str(caught.value)


def test_further_chapters_beside_the_first_are_reported(tmp_path):
    for name in ("GH010012.MP4", "GH020012.MP4", "GH020013.MP4", "notes.txt"):
        (tmp_path / name).touch()
    assert [path.name for path in siblings([tmp_path / "GH010012.MP4"])] == ["GH020012.MP4"]


def test_two_chapters_are_one_continuous_stream(tmp_path):
    for name in ("GH010001.MP4", "GH020001.MP4"):
        written(tmp_path / name, 20)
    with Timeline([tmp_path / "GH020001.MP4", tmp_path / "GH010001.MP4"]) as timeline:
        frames = [(frame.index, frame.time_s, frame.file) for frame in timeline.frames()]
        assert timeline.expected == 40
    assert [index for index, *_ in frames] == list(range(40))
    np.testing.assert_allclose(
        [time_s for _, time_s, _ in frames], np.arange(40) * 1001 / 240000, rtol=1e-9, atol=1e-12
    )
    assert [file for *_, file in frames] == [0] * 20 + [1] * 20


@pytest.mark.parametrize("done", [0, 7, 19, 20, 33])
def test_a_timeline_can_be_continued_after_any_frame(tmp_path, done):
    for name in ("GH010001.MP4", "GH020001.MP4"):
        written(tmp_path / name, 20)
    times = np.arange(40) * 1001 / 240000
    with Timeline([tmp_path / "GH010001.MP4", tmp_path / "GH020001.MP4"]) as timeline:
        again = [(frame.time_s, frame.luma.copy()) for frame in timeline.frames(after_s=times[done])]
    np.testing.assert_allclose([time_s for time_s, _ in again], times[done + 1 :], rtol=1e-9)
    for (_, luma), truth in zip(again, (pictures(20) * 2)[done + 1 :], strict=True):
        assert np.abs(luma.astype(int) - truth).mean() < 3


def test_files_of_two_picture_sizes_are_refused(tmp_path):
    written(tmp_path / "a.mp4", 5)
    with VideoWriter(tmp_path / "b.mp4", 160, 120) as video:
        video.write(np.zeros((120, 160), np.uint8))
    with pytest.raises(TrackingError, match=r"b\.mp4: pictures are 160x120"):
        Timeline([tmp_path / "a.mp4", tmp_path / "b.mp4"])


def test_a_real_gopros_telemetry_gives_its_model_and_exposure_time(realdata):
    found = read_telemetry(realdata / "gopro" / "hero7.mp4")
    assert found.camera == "Hero7 Black"
    assert 1 / 2000 < found.exposure_s < 1 / 200
    raw = parse_telemetry([(realdata / "gopro" / "hero6.raw").read_bytes()])
    assert raw.camera == "Hero6 Black"
    assert len(raw.exposures_s) == 30


def test_damaged_telemetry_does_not_stop_the_reading(realdata, tmp_path):
    data = (realdata / "gopro" / "hero6.raw").read_bytes()
    rng = np.random.default_rng(0)
    for length in (0, 3, 9, 1000):
        parse_telemetry([data[:length]])
    for _ in range(50):
        garbled = bytearray(data)
        for at in rng.integers(0, len(data), 30):
            garbled[at] = rng.integers(256)
        assert all(0 < value < 1 for value in parse_telemetry([bytes(garbled)]).exposures_s)
    assert read_telemetry(written(tmp_path / "v.mp4", 3)).camera == ""
    assert read_telemetry(Path(tmp_path / "none.mp4")).exposure_s is None


def test_slow_motion_is_recognised_by_the_files_tags_and_corrected_by_the_rate(tmp_path):
    """Phones save 240 frames/s for playback at 30."""
    with av.open(str(tmp_path / "v.mp4"), "w", options={"movflags": "use_metadata_tags"}) as container:
        container.metadata["com.android.capture.fps"] = "240.000000"
        stream = container.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
        for picture in pictures(24):
            frame = av.VideoFrame.from_ndarray(np.repeat(picture[..., None], 3, axis=2), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    with pytest.raises(TrackingError, match=r"filmed at 240.*run at 30.*--fps 240"):
        track(tmp_path / "v.mp4", camera_of(320, 240), Board())
    with Timeline([tmp_path / "v.mp4"], 240.0) as timeline:
        times = [frame.time_s for frame in timeline.frames()]
    np.testing.assert_allclose(times, np.arange(24) / 240, atol=1e-6)


def camera_of(width, height):
    return Camera(Lens("fisheye", width, height, 200, 200, width / 2, height / 2, (0, 0, 0, 0)), np.eye(4))


def test_an_excerpt_of_a_film_keeps_its_times(tmp_path):
    written(tmp_path / "v.mp4", 40)
    period = 1001 / 240000
    with Timeline([tmp_path / "v.mp4"], 0.0, 10 * period, 25 * period) as timeline:
        frames = [(frame.index, frame.time_s) for frame in timeline.frames()]
        assert timeline.expected == 15
    assert [index for index, _ in frames] == list(range(15))
    np.testing.assert_allclose([time_s for _, time_s in frames], np.arange(10, 25) * period, rtol=1e-9)
    with pytest.raises(TrackingError, match=r"no frame lies between 3.*0\.167 s long"):
        Timeline([tmp_path / "v.mp4"], 0.0, 3.0)


def test_a_file_named_twice_is_refused_and_a_copy_of_one_is_recognised(tmp_path):
    one = written(tmp_path / "a.mp4", 5)
    (tmp_path / "b.mp4").write_bytes(one.read_bytes())
    with pytest.raises(TrackingError, match="once"):
        Timeline([one, one])
    assert copies([one, tmp_path / "b.mp4"]) == [(tmp_path / "b.mp4", one)]


def test_a_variable_rate_is_not_taken_for_gaps(tmp_path):
    """Every fourth frame comes late by a third of a period, as phones' do: the library then guesses 90000 frames/s."""
    ticks = np.round(1001 * (np.arange(40) + np.where(np.arange(40) % 4 == 3, 0.3, 0.0))).astype(int)
    encode(tmp_path / "v.mp4", pictures(40), ticks=[tick / 1001 for tick in ticks])
    with VideoReader(tmp_path / "v.mp4") as video:
        assert len(list(video.frames())) == 40
        assert video.period_s == pytest.approx(1001 / 240000, rel=1e-3)
        assert video.report().gaps == ()
