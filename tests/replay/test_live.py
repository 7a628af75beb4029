"""The page of a running rig: it receives what is recorded, 30 times a second, on this machine only."""

from __future__ import annotations

import json
import threading
import time
import urllib.error
import urllib.request
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("uvicorn", reason="the lab's packages are not installed")

from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from straw.model.parameters import StrawParameters
from straw.replay.cli import main
from straw.replay.commands.rig_run import drive, emulation
from straw.replay.live.feed import Live
from straw.rig.drivers import make_controller
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.run_read import read_run
from tests.replay.test_replay_command import FOLD


def feed_of(url: str) -> str:
    """The socket of a live page, with the page's token."""
    return url.replace("http://", "ws://").replace("/?", "/feed?")


def listen(url: str, heard: list[tuple[float, Any]]) -> None:
    with connect(feed_of(url)) as feed:
        for text in feed:
            said = json.loads(text)
            if said.get("rows"):
                heard.append((time.monotonic(), said["rows"]))


def test_the_page_receives_what_is_recorded_thirty_times_a_second(tmp_path: Path) -> None:
    straw = StrawParameters()
    protocol = replace(protocol_from_toml(FOLD, "fold"), specimen="straw-9", cycle=4)  # as on the command line
    heard: list[tuple[float, Any]] = []
    with Live(straw, protocol) as live:
        assert live.url.startswith("http://127.0.0.1:")
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        with opener.open(live.url, timeout=10) as answer:
            page = answer.read().decode()
        with pytest.raises(urllib.error.HTTPError, match="403"):  # nothing is served without the token
            urllib.request.urlopen(live.url.split("?")[0], timeout=10)
        for token, origin in (("?token=guess", None), ("", None), ("", live.url.split("/?")[0])):
            with pytest.raises(InvalidStatus):
                connect(feed_of(live.url).split("?")[0] + token, origin=origin)
        listener = threading.Thread(target=listen, args=(live.url, heard))
        listener.start()
        with emulation(straw, protocol.initial_deployed, "ob1-mk4") as emulated:
            drive(make_controller("ob1-mk4", emulated.url), protocol, tmp_path / "run.mcap", straw.cells, live=live)
    listener.join(timeout=10)
    assert not listener.is_alive()
    assert '"live": true' in page
    assert '"specimen": "straw-9", "cycle": 4' in page
    assert "new WebSocket" in page
    rows = [row for _, rows in heard for row in rows]
    run = read_run(tmp_path / "run.mcap")
    assert run.pressure is not None
    assert len(rows) >= 0.9 * len(run.pressure)  # updates that a busy page cannot take are lost for that page alone
    told = np.array([row[1] for row in rows]) * 1e3
    np.testing.assert_allclose(told[-5:], run.pressure.pressure_pa[-5:], atol=1.0)
    assert len(heard) / (heard[-1][0] - heard[0][0]) <= 33  # no more often, whatever the loop's rate
    phi = np.array([row[8] for row in rows])
    assert (
        np.abs(phi[:, 0]).max() > 0.15
    )  # the model that runs in parallel bent cell 1, as it should under the run's pressure
    assert rows[-1][7][0] < 0 < rows[0][7][0]  # and folded it


def test_an_invalid_address_is_reported_before_the_rig_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "fold.toml").write_text(FOLD)
    run = ["rig", "run", str(tmp_path / "fold.toml"), "--emulate", "-o", str(tmp_path / "run.mcap")]
    assert main([*run, "--live", "127.0.0.1:none"]) == 2
    assert "HOST:PORT" in capsys.readouterr().err
    assert main([*run, "--live", "--fast"]) == 2
    assert "real time" in capsys.readouterr().err
    assert not list(tmp_path.glob("run.mcap*"))
