"""An emulated Open GoPro behind HTTP, written from the public specification.

``python -m straw.rig.camera.gopro_emulator`` serves one. Commands are answered at once and carried out after
``delay_s``.
``film`` makes the bytes of a clip from its duration in seconds; chapters end at ``chapter_bytes``. Faults are injected
by ``break_off_at``: the next downloads end there.
"""

from __future__ import annotations

import argparse
import json
import re
import threading
import time
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Any, Self

FOLDER = "100GOPRO"


def grey(seconds: float) -> bytes:
    """Bytes in place of a video: a megabyte a second that differ from place to place."""
    return bytes(k % 251 for k in range(4096)) * max(1, round(256 * seconds))


class GoProEmulator:
    """Serves on ``address`` while entered; ``url`` is what ``straw.rig.camera.gopro.GoPro`` opens."""

    def __init__(
        self,
        address: tuple[str, int] = ("127.0.0.1", 0),
        *,
        film: Callable[[float], bytes] = grey,
        delay_s: float = 0.1,
        chapter_bytes: int = 4_000_000_000,
    ) -> None:
        self.film, self.delay_s, self.chapter_bytes = film, delay_s, chapter_bytes
        self.wired = False
        self.card: dict[str, bytes] = {}
        self.asked: list[str] = []
        self.break_off_at: list[int] = []
        self._filming_since_s: float | None = None
        self._busy_until_s = self._encoding_from_s = 0.0
        self._number = 0
        emulator = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                emulator.answer(self)

            def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
                """Nothing."""

        self._server = ThreadingHTTPServer(address, Handler)
        self.url = f"http://{address[0]}:{self._server.server_port}"

    def __enter__(self) -> Self:
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._server.shutdown()
        self._server.server_close()

    def answer(self, request: BaseHTTPRequestHandler) -> None:
        """One GET: 404 for unknown paths, 409 for what the state does not allow, JSON otherwise."""
        path = request.path
        self.asked.append(path)
        if path.startswith("/gopro/camera/control/wired_usb?p="):
            self.wired = path.endswith("1")
            self._json(request, {})
        elif not self.wired:
            request.send_error(403)
        elif path == "/gopro/camera/state":
            encoding = self._filming_since_s is not None and time.monotonic() >= self._encoding_from_s
            busy = time.monotonic() < self._busy_until_s
            self._json(request, {"status": {"8": int(busy), "10": int(encoding)}, "settings": {"2": 9, "3": 0}})
        elif path == "/gopro/media/list":
            files = [{"n": n, "cre": "1795000000", "mod": "1795000000", "s": str(len(b))} for n, b in self.card.items()]
            self._json(request, {"id": "1", "media": [{"d": FOLDER, "fs": files}] if files else []})
        elif path in ("/gopro/camera/shutter/start", "/gopro/camera/shutter/stop"):
            self._shutter(request, path.endswith("start"))
        elif path == "/gopro/camera/keep_alive" or path.startswith("/gopro/media/turbo_transfer?p="):
            self._json(request, {})
        elif (match := re.fullmatch(rf"/videos/DCIM/{FOLDER}/(\w+\.MP4)", path)) and match[1] in self.card:
            self._send_film(request, self.card[match[1]])
        else:
            request.send_error(404)

    def _shutter(self, request: BaseHTTPRequestHandler, on: bool) -> None:
        now_s = time.monotonic()
        if now_s < self._busy_until_s:
            request.send_error(409)
            return
        if on and self._filming_since_s is None:
            self._filming_since_s, self._encoding_from_s = now_s, now_s + self.delay_s
        elif not on and self._filming_since_s is not None:
            whole = self.film(now_s - self._filming_since_s)
            self._filming_since_s, self._busy_until_s = None, now_s + self.delay_s
            self._number += 1
            for chapter, at in enumerate(range(0, len(whole), self.chapter_bytes), 1):
                self.card[f"GX{chapter:02d}{self._number:04d}.MP4"] = whole[at : at + self.chapter_bytes]
        self._json(request, {})

    def _send_film(self, request: BaseHTTPRequestHandler, data: bytes) -> None:
        match = re.fullmatch(r"bytes=(\d+)-", request.headers.get("Range", ""))
        start = int(match[1]) if match else 0
        if start >= len(data) and match:
            request.send_error(416)
            return
        rest = data[start:]
        request.send_response(206 if match else 200)
        request.send_header("Content-Type", "video/mp4")
        if not self.break_off_at:  # a worn cable: no length, then nothing
            request.send_header("Content-Length", str(len(rest)))
        request.end_headers()
        request.wfile.write(rest[: self.break_off_at.pop(0)] if self.break_off_at else rest)

    @staticmethod
    def _json(request: BaseHTTPRequestHandler, data: Any) -> None:
        body = json.dumps(data).encode()
        request.send_response(200)
        request.send_header("Content-Type", "application/json")
        request.send_header("Content-Length", str(len(body)))
        request.end_headers()
        request.wfile.write(body)


def main() -> None:
    """Serve until Ctrl-C."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--port", type=int, default=0)
    with GoProEmulator(("127.0.0.1", asked.parse_args().port)) as emulator:
        print(emulator.url, flush=True)
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            return


if __name__ == "__main__":
    main()
