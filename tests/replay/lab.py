"""A lab for tests: served in this process, on a folder of the test's own, and queried without a browser."""

from __future__ import annotations

import http.client
import json
import time
from pathlib import Path
from typing import Any

from straw.replay.lab.guard import Door
from straw.replay.lab.server import make


class ServedLab:
    """``with ServedLab(folder) as lab``: its ``door``, and ``get`` and ``post`` send what its own pages send."""

    def __init__(self, folder: Path, *, rig: Path | None = None, emulate: bool = False) -> None:
        task = {"folder": str(folder), "rig": str(rig) if rig else "", "emulate": emulate}
        self._server, self.door, self.lab = make({**task, "address": "127.0.0.1:0", "remote": False})

    def __enter__(self) -> ServedLab:
        self._thread = self._server.start()
        self.lab.library.open()
        self.lab.bench.open()
        self.until(lambda: self.raw("GET", "/")[0] == 200)
        return self

    def __exit__(self, *_: object) -> None:
        self.lab.bench.close()
        self.lab.library.close()
        self.lab.predictor.close()
        self._server.stop()
        self._thread.join(timeout=10)

    @property
    def own(self) -> dict[str, str]:
        """Headers that one of the lab's own pages sends."""
        return headers_of(self.door)

    def raw(self, method: str, path: str, headers: dict[str, str] | None = None, body: str = "") -> tuple[int, Any]:
        asking = http.client.HTTPConnection("127.0.0.1", self.door.port, timeout=20)
        try:
            asking.request(method, path, body or None, self.own if headers is None else headers)
            answer = asking.getresponse()
            text = answer.read().decode()
            return answer.status, json.loads(text) if text.startswith(("{", "[")) else text
        except ConnectionRefusedError:
            return 0, ""
        finally:
            asking.close()

    def get(self, path: str) -> Any:
        status, said = self.raw("GET", path)
        assert status == 200, said
        return said

    def post(self, action: str, **asked: Any) -> Any:
        status, said = self.raw("POST", f"/api/{action}", body=json.dumps({"who": "tester", "name": "T", **asked}))
        return said if status == 200 else f"{status} {said}"

    @staticmethod
    def until(truth: Any, seconds: float = 20.0) -> Any:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if found := truth():
                return found
            time.sleep(0.02)
        raise AssertionError(f"did not come true in {seconds:g} s")


def headers_of(door: Door) -> dict[str, str]:
    """What a browser sends for a page that a door has served, and the page itself."""
    return {
        "Host": f"127.0.0.1:{door.port}",
        "Origin": f"http://127.0.0.1:{door.port}",
        "Cookie": f"other=1; {door.cookie}={door.token}",
        "Content-Type": "application/json",
        "X-Straw": "1",
    }
