"""A GoPro is started and stopped, and its film downloaded whole over an unreliable cable; after its specification."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from straw.rig.camera import gopro
from straw.rig.camera.gopro import GoPro
from straw.rig.camera.gopro_emulator import GoProEmulator
from straw.rig.errors import LinkLostError, RigError


@pytest.fixture
def camera() -> Iterator[GoProEmulator]:
    with GoProEmulator(film=lambda seconds: bytes(k % 251 for k in range(300_000)), delay_s=0.05) as emulator:
        yield emulator


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gopro, "POLL_S", 0.01)
    monkeypatch.setattr(gopro, "PATIENCE_S", 1.0)


def test_the_film_of_a_run_is_the_new_file_on_the_card(camera: GoProEmulator, tmp_path: Path) -> None:
    camera.card["GX010099.MP4"] = b"of yesterday"
    with GoPro(camera.url) as told:
        told.start()
        assert told.state()["status"]["10"] == 1  # it returns when the camera films, not when it acknowledges
        clips = told.stop()
        assert [clip.name for clip in clips] == ["GX010001.MP4"]
        film = told.fetch(clips[0], tmp_path / "run.MP4")
    assert film.read_bytes() == camera.card["GX010001.MP4"]
    assert camera.asked[0] == "/gopro/camera/control/wired_usb?p=1"


def test_chapters_are_downloaded_in_order(camera: GoProEmulator) -> None:
    camera.chapter_bytes = 100_000
    with GoPro(camera.url) as told:
        told.start()
        assert [clip.name for clip in told.stop()] == ["GX010001.MP4", "GX020001.MP4", "GX030001.MP4"]


def test_a_download_that_ends_early_is_resumed_where_it_ended(camera: GoProEmulator, tmp_path: Path) -> None:
    with GoPro(camera.url) as told:
        told.start()
        (clip,) = told.stop()
        camera.break_off_at = [70_000, 50_000]
        film = told.fetch(clip, tmp_path / "run.MP4")
    assert film.read_bytes() == camera.card[clip.name]
    assert not list(tmp_path.glob("*.part"))


def test_a_connection_that_fails_repeatedly_leaves_no_file_that_looks_complete(
    camera: GoProEmulator, tmp_path: Path
) -> None:
    with GoPro(camera.url) as told:
        told.start()
        (clip,) = told.stop()
        camera.break_off_at = [1000] * 10
        with pytest.raises(LinkLostError, match="safe on its card"):
            told.fetch(clip, tmp_path / "run.MP4")
    assert not (tmp_path / "run.MP4").exists()


def test_refusals_are_one_line(camera: GoProEmulator, tmp_path: Path) -> None:
    with GoPro(camera.url) as told:
        told.start()
        with pytest.raises(RigError, match="is already filming"):
            told.start()
    with pytest.raises(LinkLostError, match="does not answer"), GoPro("http://127.0.0.1:1", timeout_s=0.5):
        pass
