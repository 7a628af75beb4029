"""Filming: starts the rig's camera before a run, stops it after, and stores the video beside the recording."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

from straw.replay.progress import say
from straw.rig.camera.gopro import GoPro
from straw.rig.errors import RigError
from straw.rig.manifest import seal
from straw.rig.rig_file import CameraFile


class Filming:
    """``with Filming(camera, recording)`` films what happens inside, then fetches it.

    A camera that does not start is an error before anything moves; a later failure is reported and does not end the
    run, and the video remains on the camera's card.
    """

    def __init__(self, camera: CameraFile | None, recording: Path) -> None:
        self.camera, self.recording = camera, recording
        self.films: tuple[Path, ...] = ()
        self._gopro: GoPro | None = None

    def __enter__(self) -> Self:
        if self.camera is None:
            return self
        if self.camera.kind != "gopro":
            say("press the camera's shutter now, and again when the run has ended")
            return self
        self._gopro = GoPro(self.camera.address).__enter__()
        try:
            self._gopro.start()
        except BaseException:
            self._gopro.__exit__(None, None, None)
            raise
        say(f"the camera {self.camera.address} films")
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if self.camera is not None and self._gopro is None:
            say(f"press the shutter again; add the video to the run with: straw runs attach {self.recording.stem} FILM")
        if self._gopro is None:
            return
        try:
            with self._gopro as camera:
                clips = camera.stop()
                names = [self.recording.with_name(f"{self.recording.stem}-{clip.name}") for clip in clips]
                self.films = tuple(camera.fetch(clip, path) for clip, path in zip(clips, names, strict=True))
            if self.films and self.recording.exists():
                seal(self.recording, self.films)
            say(f"the video: {', '.join(map(str, self.films)) or 'the camera wrote none'}")
        except RigError as failed:
            say(f"{failed}; the run is recorded all the same")
