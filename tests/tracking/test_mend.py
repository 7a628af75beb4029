"""Poses are corrected by hand with the reason recorded, and a printed dot on the tip is a second source of X and Z."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from straw.tracking.by_point import with_point
from straw.tracking.errors import TrackingError
from straw.tracking.mend import BY_HAND, Edit, load_edits, mended
from straw.tracking.point import follow_point
from tests.benchmarks.tracking_painted import end_on, errors, tracked
from tests.painting.film import RATE, encode, film
from tests.painting.motions import snaps
from tests.painting.scene import Camera

DOT_ON_BOARD_M = (0.0, 0.0235)  # beside the checkerboard, at the edge of its sheet
HIDDEN = range(45, 62)


def seen_at(camera, index, place_m):
    """Pixel of a point of the board's plane under a rolling shutter, by fixed-point iteration."""
    s = camera.scene
    row = s.height / 2
    for _ in range(5):
        ray = camera._boards(np.array([index / float(RATE) + s.row_s * row]))[0] @ (*place_m, 1.0)
        a, b = ray[:2] / ray[2]
        r2 = a * a + b * b
        k1, k2, p1, p2, k3 = s.brown
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        u = s.f * (a * radial + 2 * p1 * a * b + p2 * (r2 + 2 * a * a)) + s.centre[0]
        v = s.f * (b * radial + p1 * (r2 + 2 * b * b) + 2 * p2 * a * b) + s.centre[1]
        row = v
    return np.array((u, v))


def soft(away, radius):
    """A disc of 1 with the blurred edge of a lens."""
    return 0.5 * (1 - np.tanh((away - radius) / 1.2))


@pytest.fixture(scope="module")
def dotted(tmp_path_factory):
    """A film of a board with a dark dot beside it; in some frames a hand hides the board, not the dot."""
    scene = dataclasses.replace(
        end_on(5, 25, 0, 0.0), width=560, height=480, centre=(279.3, 238.8), f=620.0, motion=snaps(5, size=0.6)
    )
    camera, pictures, places = Camera(scene), [], []
    v, u = np.mgrid[0:480, 0:560].astype(float)
    rng = np.random.default_rng(1)
    for k, picture in enumerate(film(scene, 0.4)):
        at = seen_at(camera, k, DOT_ON_BOARD_M)
        away = np.hypot(u - at[0], v - at[1])
        ring = 200 * soft(away, 11)
        luma = np.maximum(picture.astype(float), ring) - 150 * soft(away, 4)
        if k in HIDDEN:
            middle = seen_at(camera, k, (0.0, 0.0))
            luma = np.where((np.abs(u - middle[0]) < 45) & (np.abs(v - middle[1]) < 75), 120.0, luma)
        places.append(at)
        pictures.append(np.clip(luma + rng.normal(0, 0.5, luma.shape), 0, 255).astype(np.uint8))
    path = encode(tmp_path_factory.mktemp("dot") / "v.mp4", pictures, bitrate=12e6)
    return scene, path, np.array(places), pictures, tracked(path, scene)


def test_a_dot_is_followed_within_its_sigma(dotted):
    _, _, places, pictures, _ = dotted
    found = list(follow_point(pictures, tuple(places[0].round())))
    assert all(point is not None for point in found)
    apart = np.array([point.at_px for point in found]) - places
    apart -= apart[:5].mean(axis=0)  # the click is accurate to a pixel
    sigma = np.sqrt([np.diag(point.covariance) for point in found])
    assert np.sqrt((apart**2).mean()) < 0.1
    assert np.mean((apart / sigma) ** 2) < 4


def test_where_the_board_hides_the_dot_gives_x_and_z_with_their_sigma(dotted):
    scene, path, places, _, found = dotted
    hidden = np.flatnonzero(~found.trace.valid)
    assert len(hidden) >= len(HIDDEN) - 2
    edit = Edit("point", 10, 90, "hand before the board", at_px=tuple(places[10].round()))
    more = with_point(found, [path], edit, 0.0)
    assert more.trace.valid[hidden].all()
    assert all(text.startswith(BY_HAND) and "hand before the board" in text for text in more.said[hidden])
    only = dataclasses.replace(more, trace=dataclasses.replace(more.trace, valid=np.isin(more.trace.frame, hidden)))
    error, ratio = errors(only, scene)
    # 0.1 px at 0.34 mm a pixel, twice that towards the camera; phi, interpolated, shifts it by an arm of about 24 mm
    assert np.all(np.sqrt((error**2).mean(axis=0))[:2] < 1.5e-3)
    assert np.all((ratio[:, :2] ** 2).mean(axis=0) < 3)
    assert np.abs(ratio[:, :2]).max() < 6
    untouched = found.trace.valid
    np.testing.assert_array_equal(more.trace.x_m[untouched], found.trace.x_m[untouched])


def test_anything_but_a_dot_is_not_followed(dotted):
    _, _, _, pictures, _ = dotted
    flat = [np.full((480, 560), 128, np.uint8)]
    with pytest.raises(TrackingError, match="choose another"):
        list(follow_point(flat, (200, 200)))
    with pytest.raises(TrackingError, match="edge"):
        list(follow_point(pictures, (2, 2)))


def test_a_point_never_seen_with_the_board_is_refused(dotted):
    _, path, places, _, found = dotted
    edit = Edit("point", 47, 55, "hand", at_px=tuple(places[47].round()))
    with pytest.raises(TrackingError, match="widen its frames"):
        with_point(found, [path], edit, 0.0)


def test_poses_set_and_refused_by_hand_record_their_reason(dotted, tmp_path):
    found = dotted[-1]
    (tmp_path / "m.toml").write_text(
        '[[invalid]]\nframes = "3-5"\nreason = "a fly"\n[[pose]]\nframe = 50\nx_mm = 21.0\nz_mm = -1.0\n'
        'phi_deg = 88.0\nsigma_mm = 0.5\nsigma_deg = 2.0\nreason = "read off the picture"\n'
    )
    changed = mended(found, load_edits(tmp_path / "m.toml"))
    assert not changed.trace.valid[3:6].any()
    assert np.isnan(changed.trace.x_m[3:6]).all()
    assert set(changed.said[3:6]) == {BY_HAND + "a fly"}
    assert changed.trace.valid[50]
    assert changed.trace.x_m[50] == pytest.approx(0.021)
    assert changed.trace.sigma_phi_rad[50] == pytest.approx(np.radians(2))
    assert changed.said[50] == BY_HAND + "read off the picture"
    others = np.delete(np.arange(len(found.trace)), (3, 4, 5, 50))
    np.testing.assert_array_equal(changed.trace.x_m[others], found.trace.x_m[others])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "contains no correction"),
        ("[[wrong]]\nframes = '1'", "unknown change 'wrong'"),
        ("[[invalid]]\nframes = '1-2'", "'reason' is missing"),
        ("[[invalid]]\nframes = 'x'\nreason = 'r'", "'frames' is 'x'"),
        ("[[invalid]]\nframes = '5-9999'\nreason = 'r'", "the video has 0 to"),
        ("[[invalid]]\nframes = '5'\nreason = 'r'\ncolour = 1", "'colour' is not known"),
        (
            "[[pose]]\nframe=1\nx_mm=1\nz_mm=1\nphi_deg=1\nsigma_mm=0\nsigma_deg=1\nreason='r'",
            "more than 0",
        ),
        ("[[point]]\nframes = '1-9'\nreason = 'r'\nat = [1]", "'at' is [1]"),
        ("frames = [", "is not TOML"),
    ],
)
def test_an_invalid_file_of_corrections_is_refused_in_one_line(dotted, tmp_path, text, said):
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(TrackingError, match=r"m\.toml|mend:") as caught:
        mended(dotted[-1], load_edits(tmp_path / "m.toml"))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
