"""Drives headless Chromium over its DevTools protocol: opens tabs, evaluates scripts, sends keys, takes screenshots."""

from __future__ import annotations

import base64
import json
import subprocess
import time
import urllib.request
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from websockets.sync.client import connect

from tests.replay.browser import QUIET, chromium

READY = "document.readyState === 'complete'"


class Tab:
    """One page; ``js`` evaluates and waits for promises, ``until`` waits for a condition."""

    def __init__(self, url: str) -> None:
        self.stack = ExitStack()
        self._socket = self.stack.enter_context(connect(url, max_size=2**26, open_timeout=20))
        self._count = 0
        self.errors: list[str] = []
        self.call("Page.enable")
        self.call("Runtime.enable")

    def call(self, method: str, **parameters: Any) -> Any:
        self._count += 1
        self._socket.send(json.dumps({"id": self._count, "method": method, "params": parameters}))
        while True:
            said = json.loads(self._socket.recv(timeout=30))
            if said.get("method") == "Runtime.exceptionThrown":
                self.errors.append(said["params"]["exceptionDetails"].get("exception", {}).get("description", "?"))
            if said.get("id") == self._count:
                assert "error" not in said, said["error"]
                return said["result"]

    def goto(self, url: str) -> None:
        self.call("Page.navigate", url=url)
        time.sleep(0.1)
        self.until(READY)

    def js(self, script: str) -> Any:
        said = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in said, said["exceptionDetails"]
        return said["result"].get("value")

    def until(self, truth: str, seconds: float = 20.0) -> Any:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = self.js(truth)
            if found:
                return found
            time.sleep(0.05)
        raise AssertionError(f"{truth} did not come true in {seconds:g} s")

    def key(self, key: str) -> None:
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent", type=kind, key=key, text=key if len(key) == 1 and kind == "keyDown" else ""
            )

    def picture(self, path: Path, width: int = 1400, height: int = 900, dark: bool = False) -> None:
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        features = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=features)
        time.sleep(0.5)
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))


class Browser:
    """Chromium without a window, while entered."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._tabs = ExitStack()

    def __enter__(self) -> Self:
        profile = self.folder / "profile"
        command = [chromium(), *QUIET.split(), f"--user-data-dir={profile}", "--remote-debugging-port=0", "about:blank"]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        told = profile / "DevToolsActivePort"
        end = time.monotonic() + 30
        while not (told.is_file() and told.read_text().count("\n")):
            assert time.monotonic() < end, "Chromium did not start"
            time.sleep(0.05)
        self._port = int(told.read_text().split("\n")[0])
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._tabs.close()
        self._process.terminate()
        self._process.wait(timeout=10)

    def tab(self, url: str = "about:blank") -> Tab:
        request = urllib.request.Request(f"http://127.0.0.1:{self._port}/json/new?about:blank", method="PUT")
        with urllib.request.urlopen(request, timeout=20) as answer:
            tab = Tab(json.loads(answer.read())["webSocketDebuggerUrl"])
        self._tabs.push(tab.stack)
        if url != "about:blank":
            tab.goto(url)
        return tab
