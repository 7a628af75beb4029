"""Films: stores a video that was dropped on a run's page beside the recording and enters it in the manifest."""

from __future__ import annotations

import asyncio
from pathlib import Path

from starlette.requests import Request

from straw.replay.lab.library import Library
from straw.rig.errors import RigError
from straw.rig.manifest import seal
from straw.rig.rig_file import RigFile

FILMS = (".mp4", ".mov", ".avi", ".mkv", ".360")


async def taken(library: Library, request: Request) -> dict[str, str]:
    """Store the video of a request; RigError where it is none, or cannot be stored. No partial file is left."""
    recording = library.path(library.entry(request.query_params["name"]))
    film = film_of(recording, request.query_params["file"])
    part = film.with_name(film.name + ".part")
    try:
        with part.open("wb") as stream:
            async for chunk in request.stream():
                await asyncio.to_thread(stream.write, chunk)
        part.rename(film)
    except OSError as error:
        raise RigError(f"the video cannot be written: {error.strerror}; check the space") from None
    finally:
        part.unlink(missing_ok=True)
    await asyncio.to_thread(seal, recording, [film])
    return {"film": film.name}


def how_to_track(recording: str, film: str, rig: RigFile | None) -> str:
    """The command that tracks a video, with the rig's lens and straw: with another straw the camera would be placed by
    the wrong rest pose."""
    lens = rig.camera.lens if rig and rig.camera else None
    stem = recording.removesuffix(".mcap")
    words = ["straw", "track", film, "--run", recording, "--camera", str(lens or "CAMERA.json"), "--start", "S"]
    words += ["-o", f"{stem}-tip.mcap", *(["--straw", str(rig.straw)] if rig and rig.straw else [])]
    return " ".join(words)


def film_of(recording: Path, name: str) -> Path:
    """The path of a video: beside its recording, its own name after the run's; RigError where that is taken."""
    plain = Path(name.replace("\\", "/")).name
    if Path(plain).suffix.lower() not in FILMS:
        raise RigError(f"{plain!r} is not a video; expected one of {', '.join(FILMS)}")
    film = recording.with_name(f"{recording.name.removesuffix('.part').removesuffix('.mcap')}-{plain}")
    if film.exists():
        raise RigError(f"{film.name} is there already and is not overwritten")
    return film
