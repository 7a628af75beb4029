"""Times are exact, losses are counted, and a file that is no video is refused in one line."""

from __future__ import annotations

import wave
from fractions import Fraction

import numpy as np
import pytest

from straw.tracking.encode import GOPRO_RATE, VideoWriter
from straw.tracking.errors import TrackingError
from straw.tracking.video import VideoReader, ahead


def pictures(count: int, width: int = 320, height: int = 240) -> list[np.ndarray]:
    """Smooth pictures that differ: a bright bar that moves, from which their order can be read."""
    x = np.arange(width)
    return [np.tile((40 + 160 * (abs(x - 10 - 5 * k) < 8)).astype(np.uint8), (height, 1)) for k in range(count)]


def written(path, count=40, rate=GOPRO_RATE, skips=()):
    with VideoWriter(path, 320, 240, rate, 2e6) as video:
        for k, picture in enumerate(pictures(count)):
            video.write(picture, skip=dict(skips).get(k, 0))
    return path


def read(path):
    with VideoReader(path) as video:
        frames = [(frame.index, frame.time_s, frame.luma.copy()) for frame in ahead(video.frames())]
        return frames, video.report()


def test_what_is_written_is_read_back_in_order_at_exact_times(tmp_path):
    frames, report = read(written(tmp_path / "v.mp4"))
    assert str(report) == "decoded 40 of 40 frames"
    assert [index for index, _, _ in frames] == list(range(40))
    np.testing.assert_allclose([time for _, time, _ in frames], np.arange(40) * 1001 / 240000, rtol=1e-15)
    for (_, _, luma), truth in zip(frames, pictures(40), strict=True):
        assert np.abs(luma.astype(int) - truth).mean() < 3  # grey levels: the coding error of a clean bar at 2 Mbit/s


@pytest.mark.parametrize("rate", [Fraction(60), Fraction(30000, 1001)])
def test_other_rates_are_exact_too(tmp_path, rate):
    frames, _ = read(written(tmp_path / "v.mp4", 10, rate))
    np.testing.assert_allclose([time for _, time, _ in frames], np.arange(10) / float(rate), rtol=1e-14)


def test_missing_frames_show_as_gaps_and_later_times_stay_true(tmp_path):
    frames, report = read(written(tmp_path / "v.mp4", skips=((10, 3), (25, 1))))
    assert [gap.missing for gap in report.gaps] == [3, 1]
    assert report.gaps[0].after_s == pytest.approx(9 * 1001 / 240000)
    assert frames[-1][1] == pytest.approx(43 * 1001 / 240000)


def test_a_damaged_stretch_is_counted_and_the_rest_is_read(tmp_path):
    path = written(tmp_path / "v.mp4", 120)
    data = bytearray(path.read_bytes())
    middle = len(data) // 3
    data[middle : middle + 400] = np.random.default_rng(0).bytes(400)
    path.write_bytes(data)
    frames, report = read(path)
    assert report.corrupt > 0
    assert report.expected == 120
    assert len(frames) == report.decoded < 120
    assert frames[-1][1] == pytest.approx(119 * 1001 / 240000)  # the damage was not taken for the end


def test_a_corrupted_label_in_the_file_does_no_harm(tmp_path):
    path = written(tmp_path / "v.mp4", 5)
    path.write_bytes(path.read_bytes().replace(b"VideoHandler", b"Video\xffandler"))
    assert read(path)[1].decoded == 5


def sound(path):
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes(bytes(8000))


def cut_short(path):
    written(path)
    path.write_bytes(path.read_bytes()[:2000])  # the index (moov) is at the end of the file


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda path: None, "no such file"),
        (lambda path: path.mkdir(), "not a file"),
        (lambda path: path.write_bytes(b""), "0 bytes"),
        (lambda path: path.write_text("not a video at all\n" * 100), "not a readable video"),
        (sound, "no pictures"),
        (cut_short, "not a readable video"),
    ],
)
def test_a_file_that_is_no_video_is_refused_in_one_line(tmp_path, make, says):
    path = tmp_path / "v.mp4"
    make(path)
    with pytest.raises(TrackingError, match=f"v.mp4.*{says}") as caught:
        VideoReader(path)
    assert "\n" not in str(caught.value)


def test_a_reader_can_stop_early(tmp_path):
    with VideoReader(written(tmp_path / "v.mp4")) as video:
        frames = ahead(video.frames())
        assert next(frames).index == 0
        frames.close()


def test_an_abandoned_video_leaves_no_file(tmp_path):
    def abandon():
        with VideoWriter(tmp_path / "v.mp4", 320, 240) as video:
            video.write(pictures(1)[0])
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        abandon()
    assert not list(tmp_path.iterdir())


def test_a_video_that_cannot_be_written_is_refused_in_one_line(tmp_path):
    with pytest.raises(TrackingError, match="cannot write"):
        VideoWriter(tmp_path / "nowhere" / "v.mp4", 320, 240)
    with pytest.raises(TrackingError, match="even"):
        VideoWriter(tmp_path / "v.mp4", 321, 240)
    with (
        pytest.raises(TrackingError, match="expected uint8"),
        VideoWriter(tmp_path / "v.mp4", 320, 240) as video,
    ):
        video.write(np.zeros((10, 10), np.uint8))
    assert not list(tmp_path.iterdir())


def test_real_gopro_and_phone_files_decode_completely(realdata):
    for name, count in (
        ("gopro/hero7.mp4", 352),
        ("edihead_iphone1080p60_chess9x6/edihead_calibration_example.mp4", 27),
    ):
        frames, report = read(realdata / name)
        assert (report.decoded, report.expected, report.corrupt) == (count, count, 0)
        assert np.all(np.diff([time for _, time, _ in frames]) > 0)
