"""GoPro over USB or Wi-Fi: start, stop, and fetch the video, by the Open GoPro HTTP API 2.0.

Source: the public specification, gopro.github.io/OpenGoPro/http (HERO9 Black and later; a HERO6 has no such API). Over
USB the camera is 172.2X.1YZ.51:8080, XYZ the last digits of its serial number, and wired control has to be switched on
first. A command is answered at once and carried out later: "system busy" (status 8) and "encoding" (status 10) of the
state show when. Downloads over a worn cable end early without an error, so a file is complete only when it has the
size in the camera's list.
"""

from __future__ import annotations

import json
import threading
import time
import urllib.error
import urllib.request
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from straw.rig.errors import LinkLostError, RigError

BUSY, ENCODING = "8", "10"
KEEP_ALIVE_S = 3.0
POLL_S = 0.1
#: How long the camera may take to begin, or to end and write its file.
PATIENCE_S = 10.0
CHUNK = 1 << 20
TRIES = 4
FILMS = (".MP4", ".360")


@dataclass(frozen=True)
class Clip:
    """One file on the card: its folder, name and size in bytes."""

    folder: str
    name: str
    size: int


class GoPro:
    """The camera at ``address`` (http://172.2X.1YZ.51:8080); LinkLostError where it does not answer, RigError else."""

    def __init__(self, address: str, timeout_s: float = 5.0) -> None:
        self.address, self.timeout_s = address.rstrip("/"), timeout_s
        self._ended = threading.Event()
        self._before: set[Clip] = set()

    def __enter__(self) -> Self:
        self._ask("/gopro/camera/control/wired_usb?p=1")
        self._wait(BUSY, False)
        self._ended.clear()
        threading.Thread(target=self._keep_alive, name="camera", daemon=True).start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._ended.set()

    def start(self) -> None:
        """Start filming, and return when it does."""
        if self._flag(ENCODING):
            raise RigError(f"the camera {self.address} is already filming; stop it first")
        self._wait(BUSY, False)
        self._before = set(self.clips())
        self._ask("/gopro/camera/shutter/start")
        self._wait(ENCODING, True)

    def stop(self) -> tuple[Clip, ...]:
        """Stop filming; the new clips, chapters of one film in their order, once the camera has written them."""
        self._ask("/gopro/camera/shutter/stop")
        self._wait(ENCODING, False)
        self._wait(BUSY, False)
        new = [clip for clip in self.clips() if clip not in self._before and clip.name.upper().endswith(FILMS)]
        return tuple(sorted(new, key=_chapter))

    def clips(self) -> list[Clip]:
        """What is on the card."""
        listed = self._ask("/gopro/media/list")
        try:
            return [Clip(d["d"], f["n"], int(f["s"])) for d in listed["media"] for f in d["fs"]]
        except (KeyError, TypeError, ValueError):
            raise RigError(f"the camera {self.address} lists its card in an unknown way: {listed!r:.120}") from None

    def fetch(self, clip: Clip, path: Path) -> Path:
        """Copy a clip to a path, whole or not at all; an interrupted download resumes where it ended."""
        if path.exists():
            raise RigError(f"{path} exists and is not overwritten; move it away, or fetch to another name")
        part = path.with_name(path.name + ".part")
        with suppress(RigError):  # only makes the download faster
            self._ask("/gopro/media/turbo_transfer?p=1")
        try:
            for _ in range(TRIES):
                try:
                    self._download(clip, part)
                except LinkLostError:
                    continue
                if part.stat().st_size == clip.size:
                    part.rename(path)
                    return path
                if part.stat().st_size > clip.size:
                    part.unlink()
        except OSError as error:
            raise RigError(f"{path} cannot be written: {error.strerror or error}; check space and rights") from None
        finally:
            with suppress(RigError):
                self._ask("/gopro/media/turbo_transfer?p=0")
        raise LinkLostError(
            f"the camera {self.address} interrupted {clip.name} {TRIES} times; what arrived is in {part}, the video is "
            "safe on its card: check the cable and fetch again"
        )

    def state(self) -> dict[str, Any]:
        """Status and settings as the camera gives them."""
        said: dict[str, Any] = self._ask("/gopro/camera/state")
        return said

    def _download(self, clip: Clip, part: Path) -> None:
        have = part.stat().st_size if part.exists() else 0
        request = urllib.request.Request(f"{self.address}/videos/DCIM/{clip.folder}/{clip.name}")
        if have:
            request.add_header("Range", f"bytes={have}-")
        try:
            with urllib.request.urlopen(request, timeout=self.timeout_s) as answer:
                if have and answer.status != 206:  # the camera ignored the range and sends the file from its start
                    have = 0
                with part.open("ab" if have else "wb") as stream:
                    while piece := answer.read(CHUNK):
                        stream.write(piece)
        except urllib.error.HTTPError as error:
            if error.code == 416:  # all of it is here
                return
            raise LinkLostError(f"{clip.name} is refused: {error.code}") from None
        except (urllib.error.URLError, TimeoutError, ConnectionError, EOFError):
            raise LinkLostError(f"{clip.name} was interrupted") from None
        except OSError as error:
            # disk full, read-only: our side, not the camera's
            if isinstance(error, PermissionError) or error.errno in (28, 30):
                raise
            raise LinkLostError(f"{clip.name} was interrupted") from None

    def _flag(self, number: str) -> bool:
        try:
            return bool(int(self.state()["status"][number]))
        except (KeyError, TypeError, ValueError):
            raise RigError(
                f"the camera {self.address} does not report its status {number}; is it an Open GoPro?"
            ) from None

    def _wait(self, number: str, value: bool) -> None:
        until_s = time.monotonic() + PATIENCE_S
        while self._flag(number) != value:
            if time.monotonic() > until_s:
                what = {BUSY: "busy", ENCODING: "filming"}[number]
                state = "is still" if not value else "is not"
                raise RigError(f"the camera {self.address} {state} {what} after {PATIENCE_S:g} s; check its display")
            time.sleep(POLL_S)

    def _keep_alive(self) -> None:
        while not self._ended.wait(KEEP_ALIVE_S):
            with suppress(RigError):  # the next request reports it
                self._ask("/gopro/camera/keep_alive")

    def _ask(self, path: str) -> Any:
        try:
            with urllib.request.urlopen(self.address + path, timeout=self.timeout_s) as answer:
                return json.loads(answer.read() or b"{}")
        except urllib.error.HTTPError as error:
            raise RigError(f"the camera {self.address} refused {path}: {error.code}; check its display") from None
        except (OSError, ValueError) as error:
            why = getattr(error, "reason", None) or error
            raise LinkLostError(
                f"the camera {self.address} does not answer: {why}; is it on, its USB connection set to GoPro Connect, "
                "and the address right?"
            ) from None


def _chapter(clip: Clip) -> tuple[str, str, str]:
    """GX010042, GX020042, ... are the chapters of video 0042."""
    return clip.folder, clip.name[4:8], clip.name[:4]
