"""The truth of a painted video is recovered by tracking; covered, missing and wrong boards are never guessed."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from straw.tracking.board import Board
from straw.tracking.camera import Camera
from straw.tracking.corners import find_boards, moved_by
from straw.tracking.encode import VideoWriter
from straw.tracking.errors import TrackingError
from straw.tracking.follow import Follower, Sighting
from straw.tracking.synthetic import camera_looking_at, paint_video
from straw.tracking.task import Track
from straw.tracking.track import track
from straw.tracking.video import VideoReader

REST = (0.0221, 0.0, 1.53)  # as at the start of the painted clips
SI = np.array((1e6, 1e6, 1e3))  # to um, um, mrad


def snap(time_s):
    since = np.clip(np.asarray(time_s) - 0.1, 0, None)
    swing = 1 - np.exp(-since / 0.03) * np.cos(2 * np.pi * 12 * since)
    return REST[0] - 0.005 * swing, REST[1] - 0.0012 * swing, REST[2] + 0.12 * swing


def errors(found: Track, motion) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors (3, n) in um, um, mrad and the same over their sigmas, valid frames only."""
    trace = found.trace
    measured = np.array((trace.x_m, trace.z_m, trace.phi_rad))[:, trace.valid]
    sigma = np.array((trace.sigma_x_m, trace.sigma_z_m, trace.sigma_phi_rad))[:, trace.valid]
    error = measured - np.array(motion(trace.time_s[trace.valid]))
    return error * SI[:, None], error / sigma


def rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt((values**2).mean(axis=-1))


def test_a_snap_is_tracked_from_a_rest_pose_alone(clip):
    found = track(clip.path, Camera(clip.camera.lens), Board(), rest_pose=clip.rest, start_s=100.0)
    # minus the board's row, for a row time of 0 +- 0.5 us
    assert found.trace.time_s == pytest.approx(100 + clip.time_s, abs=3e-4)
    assert found.trace.valid.all()
    assert not found.invalid
    assert found.rest_frames == pytest.approx(24, abs=1)  # 0.1 s of stillness
    # 0.02 px of corner error, 10 independent ones, 0.24 mm/px: 1.5 um across the view, 4 um along it (25 degrees);
    # sheared by sin 25 over 10 mm: 0.4 mrad. Three times that allows for the codec.
    error, ratio = errors(replace(found, trace=replace(found.trace, time_s=clip.time_s)), clip.motion)
    assert np.all(rms(error) < (15, 10, 1.0)), rms(error)
    moving = clip.time_s > 0.1
    # Sigmas are right if errors in units of them are about one: within a factor of two either way while moving.
    assert np.all((rms(ratio[:, moving]) > 0.3) & (rms(ratio[:, moving]) < 2.5)), rms(ratio[:, moving])
    np.testing.assert_allclose(found.camera.world_from_camera, clip.camera.world_from_camera, atol=3e-3)
    assert found.rms_px.max() < 0.1


def test_a_board_glued_askew_is_tracked_correctly(small, tmp_path):
    askew = replace(small, board_turn_rad=(np.radians(2.0), np.radians(-1.0)))
    paint_video(tmp_path / "v.mp4", askew, snap, 0.3, bitrate=15e6)
    found = track(tmp_path / "v.mp4", Camera(small.lens), Board(), rest_pose=REST)
    assert np.all(rms(errors(found, snap)[0]) < (40, 20, 2)), rms(errors(found, snap)[0])
    # 7 mm of motion and 0.02 px of common error: some milliradians, which its sigma must include
    miss = np.abs(np.array(found.camera.board_turn_rad) - askew.board_turn_rad)
    assert np.all(miss < (5e-3, 5e-3))
    assert np.all(miss < 5 * np.array(found.turn_sigma_rad))


def test_a_snap_is_tracked_with_the_cameras_pose_given(clip):
    calls = []
    found = track(clip.path, clip.camera, Board(), progress=lambda done, of: calls.append((done, of)))
    error, _ = errors(found, clip.motion)
    assert np.all(rms(error) < (15, 10, 1.0)), rms(error)
    n = len(clip.time_s)
    assert calls == [(k + 1, n) for k in range(n)]
    assert str(found.decode) == f"decoded {n} of {n} frames"
    assert found.rest_frames == 0


def altered(source, target, change):
    """Copy a video frame by frame through ``change(index, luma) -> luma``."""
    with VideoReader(source) as old, VideoWriter(target, old.width, old.height, bitrate=15e6) as new:
        for frame in old.frames():
            new.write(change(frame.index, frame.luma.copy()))
    return target


@pytest.mark.parametrize("grey", [0, 120, 255])
def test_a_covered_board_is_invalid_and_reacquired_afterwards(small_clip, tmp_path, grey):
    def cover(index, luma):
        if 30 <= index < 36:
            luma[100:380, 180:460] = grey
        return luma

    found = track(altered(small_clip.path, tmp_path / "v.mp4", cover), small_clip.camera, Board())
    assert not found.trace.valid[30:36].any()
    assert np.isnan(found.trace.x_m[30:36]).all()
    assert found.trace.valid[:30].all()
    assert sum(found.invalid.values()) == (~found.trace.valid).sum()
    late = np.flatnonzero(found.trace.valid[36:])
    assert len(late) == 0 or late[0] <= 24  # searched for at most every 24 frames
    assert np.all(rms(errors(found, small_clip.motion)[0]) < (40, 20, 2))


def test_a_short_flash_invalidates_only_its_own_frames(small_clip, tmp_path):
    def flash(index, luma):
        return np.full_like(luma, 255) if index in (20, 21) else luma

    found = track(altered(small_clip.path, tmp_path / "v.mp4", flash), small_clip.camera, Board())
    assert np.flatnonzero(~found.trace.valid).tolist() == [20, 21]


def test_a_finger_over_a_few_corners_invalidates_no_frame(small_clip, tmp_path, seen_by_opencv):
    x, y = seen_by_opencv(small_clip.camera, *small_clip.rest)[0].astype(int)

    def finger(index, luma):
        if index >= 5:  # the detector that starts the track needs the whole board, the follower does not
            luma[y - 25 : y + 28, x - 25 : x + 28] = 90
        return luma

    found = track(altered(small_clip.path, tmp_path / "v.mp4", finger), small_clip.camera, Board())
    assert found.trace.valid.all()
    assert np.all(rms(errors(found, small_clip.motion)[0]) < (40, 20, 2))


def test_lost_frames_leave_a_gap_and_the_board_is_followed_across_it(small_clip, tmp_path):
    with VideoReader(small_clip.path) as old, VideoWriter(tmp_path / "v.mp4", 640, 480, bitrate=15e6) as new:
        for frame in old.frames():
            if frame.index not in (28, 29, 30):
                new.write(frame.luma, skip=3 if frame.index == 31 else 0)
    found = track(tmp_path / "v.mp4", replace(small_clip.camera, line_s=0.0), Board())
    assert [gap.missing for gap in found.decode.gaps] == [3]
    assert found.trace.valid.all()
    np.testing.assert_allclose(found.trace.time_s, np.delete(small_clip.time_s, (28, 29, 30)), rtol=1e-12)
    assert np.all(rms(errors(found, small_clip.motion)[0]) < (40, 20, 2))


def test_a_search_that_skips_rows_of_the_board_is_repeated_at_once(small_clip, monkeypatch):
    """OpenCV's search does so in some states of the process, on a picture whose board it finds in all others."""
    searched = []

    def skipping(picture):
        searched.append(len(searched))
        for grid in find_boards(picture):
            yield grid if len(searched) > 1 else (grid[:, [0, 2, 4, 6]] + grid[:, [0, 1, 3, 5]]) / 2

    monkeypatch.setattr("straw.tracking.follow.find_boards", skipping)
    found = track(small_clip.path, small_clip.camera, Board())
    assert not found.trace.valid[0]
    assert found.trace.valid[1:].all()
    assert len(searched) == 2


def test_a_prediction_one_square_off_is_refused_or_corrected(small_clip):
    """The pattern is periodic: a grid slipped by a square fits almost as well, and must not be accepted."""
    with VideoReader(small_clip.path) as video:
        first = next(video.frames()).luma.copy()
    for squares in ((0, 1), (1, 1), (-1, 1), (2, 0), (1, 2), (0, -2), (4, 4)):
        follower = Follower(small_clip.camera, Board(), None)
        true = follower.look(first, 0.0)
        assert isinstance(true, Sighting)
        before = moved_by(true.homography, -np.array(squares, float))
        follower.recent = [
            (-0.004, replace(true, homography=before)),
            (0.0, true),
        ]  # so the prediction keeps moving at this rate
        seen = follower.look(first, 0.004)
        assert isinstance(seen, str) or np.abs(seen.grid - true.grid).max() < 0.1  # px; a slip: 20


def test_an_upside_down_camera_needs_only_board_x_in_image(small, tmp_path):
    """The board looks the same turned by 180 degrees: only ``board_x_in_image`` distinguishes up from down."""

    def rising(time_s):
        return 0.02 + 0 * time_s, 0.03 * np.clip(time_s - 0.05, 0, None), 1.55 + 0 * time_s

    place = camera_looking_at((0.028, 0, 0), 0.212, np.radians(25), 0.0) @ np.diag((-1.0, -1.0, 1.0, 1.0))
    paint_video(tmp_path / "v.mp4", replace(small, world_from_camera=place), rising, 0.12, bitrate=15e6)
    rest = (0.02, 0.0, 1.55)
    right = track(tmp_path / "v.mp4", Camera(small.lens, board_x_in_image="up"), Board(), rest_pose=rest)
    assert np.all(rms(errors(right, rising)[0]) < (40, 20, 2))
    wrong = track(tmp_path / "v.mp4", Camera(small.lens), Board(), rest_pose=rest)
    assert wrong.trace.z_m[-1] == pytest.approx(-right.trace.z_m[-1], abs=2e-4)


def test_a_video_without_a_board_is_refused_in_one_line(small, tmp_path):
    with VideoWriter(tmp_path / "v.mp4", 640, 480) as video:
        for k in range(5):
            video.write(np.full((480, 640), 100 + k, np.uint8))
    with pytest.raises(TrackingError, match=r"v\.mp4.*no board") as caught:
        track(tmp_path / "v.mp4", small, Board())
    assert "\n" not in str(caught.value)


def test_a_smaller_board_is_not_accepted_as_part_of_a_larger_one(small_clip):
    with pytest.raises(TrackingError, match="only 8x8 squares are ever visible"):
        track(small_clip.path, Camera(small_clip.camera.lens), Board(squares=10), rest_pose=REST)
    with pytest.raises(TrackingError, match="no board of 6x6"):
        track(small_clip.path, Camera(small_clip.camera.lens), Board(squares=6), rest_pose=REST)


def test_a_side_that_is_always_covered_is_reported_and_invalidates_no_frame(small_clip, tmp_path, seen_by_opencv):
    left = int(seen_by_opencv(small_clip.camera, *small_clip.rest)[:, 0].min()) - 40

    def curtain(index, luma):
        luma[:, : left + 48] = 120
        return luma

    found = track(altered(small_clip.path, tmp_path / "v.mp4", curtain), small_clip.camera, Board())
    assert 0 < found.never_seen <= 14
    assert found.trace.valid.all()


def test_a_lens_for_another_picture_size_is_refused(small_clip, clip):
    with pytest.raises(TrackingError, match=r"640x480.*1920x1080"):
        track(small_clip.path, clip.camera, Board())


def test_without_a_camera_pose_or_a_rest_pose_tracking_is_refused(small_clip):
    with pytest.raises(TrackingError, match="rest pose"):
        track(small_clip.path, Camera(small_clip.camera.lens), Board())
    with pytest.raises(TrackingError, match="finite"):
        track(small_clip.path, small_clip.camera, Board(), rest_pose=(0.02, float("nan"), 1.5))


def test_a_board_that_is_never_at_rest_cannot_determine_the_cameras_pose(small, tmp_path):
    def moving(time_s):
        return 0.02 - 0.1 * time_s, 0.2 * time_s, 1.55 + 0 * time_s

    paint_video(tmp_path / "v.mp4", small, moving, 0.06, bitrate=15e6)
    with pytest.raises(TrackingError, match="still frames"):
        track(tmp_path / "v.mp4", Camera(small.lens), Board(), rest_pose=(0.02, 0, 1.55))


def test_importing_the_tracking_types_loads_no_heavy_library():
    heavy = (
        "import sys, straw.tracking.trace, straw.tracking.errors; "
        "print([m for m in ('cv2', 'av', 'numba') if m in sys.modules])"
    )
    assert (
        subprocess.run([sys.executable, "-c", heavy], capture_output=True, text=True, check=True).stdout.strip() == "[]"
    )
