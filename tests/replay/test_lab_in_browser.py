"""The lab in Chromium: attacks from foreign pages, two operators, many tabs, and a vent despite a frozen server."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

pytest.importorskip("uvicorn", reason="the lab's packages are not installed")

from straw.rig.catalogue import catalogue
from tests.replay.driven import Browser, Tab
from tests.replay.lab import ServedLab

READY = "document.documentElement.dataset.ready"
ATTACK = Path(__file__).with_name("attack.js").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("chromium")) as started:
        yield started


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedLab]:
    with ServedLab(tmp_path_factory.mktemp("lab"), emulate=True) as served:
        yield served


@pytest.fixture(scope="module")
def foreign() -> Iterator[int]:
    """The port of another server on this machine."""

    class Page(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><body>elsewhere</body>")

        def log_message(self, *_: object) -> None:
            """Nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Page)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server.server_port
    server.shutdown()
    server.server_close()


def opened(browser: Browser, lab: ServedLab, page: str = "panel") -> Tab:
    tab = browser.tab(lab.door.url)
    tab.goto(f"http://127.0.0.1:{lab.door.port}/{page}")
    tab.until(READY)
    return tab


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])  # the same site, whose cookies are sent; and another one
def test_no_foreign_page_moves_the_rig_or_reads_the_catalogue(
    browser: Browser, lab: ServedLab, foreign: int, host: str
) -> None:
    own = opened(browser, lab)  # this browser has the cookie
    before = list(lab.lab.bench.said)
    evil = browser.tab(f"http://{host}:{foreign}/")
    tried = evil.js(ATTACK.replace("PORT", str(lab.door.port)))
    got_through = [what for what in tried if not what.endswith(":refused") and what != "plain:opaque"]
    assert got_through == []  # "opaque": the browser sent it but hides the answer; the lab's own log has it
    assert lab.lab.bench.said == before
    assert not lab.lab.bench.armed
    assert own.errors == []


def test_the_list_of_protocols_marks_the_one_that_is_shown(browser: Browser, lab: ServedLab) -> None:
    tab = opened(browser, lab)
    tab.until("document.documentElement.dataset.ready")
    chosen = "document.getElementById('protocols').selectedOptions[0].textContent"
    assert tab.js(f"field('toml').includes({chosen}.split(' ')[0])")
    tab.js("const t = document.getElementById('toml'); t.value += '# mine'; t.dispatchEvent(new Event('input'))")
    assert tab.js(chosen) == "as written below"
    tab.js("sessionStorage.clear()")


def test_one_page_is_in_control_and_the_other_may_request_control_and_always_vent(
    browser: Browser, lab: ServedLab
) -> None:
    first, second = opened(browser, lab), opened(browser, lab)
    for tab, name in ((first, "Ada"), (second, "Bea")):
        tab.js(f"localStorage.strawName = '{name}'; line.send(JSON.stringify({{ id: me, name: '{name}' }}))")
    first.until("!document.getElementById('arm').disabled")
    first.js("document.getElementById('arm').click()")
    first.until("state.bench.control.mine && state.bench.armed")
    second.until("state.bench.control.holder === 'Ada' && document.getElementById('arm').disabled")
    assert "Ada is in control" in second.js("tell('arm', { on: false }).catch((e) => e.message)")
    second.js("document.querySelector('#control [data-control=take]').click()")
    first.until("document.getElementById('control').textContent.includes('Bea requests')")
    first.js("document.querySelector('#control b ~ [data-control=give]').click()")
    second.until("state.bench.control.mine")
    first.until("state.bench.control.holder === 'Bea'")
    assert second.js("tell('arm', { on: true }).then(() => 'armed')") == "armed"
    first.key("v")  # without control and without confirmation
    second.until("!state.bench.armed")
    assert "VENT by" in lab.lab.bench.said[-1][1]
    second.js("tell('control', { do: 'give' })")


def test_a_ninth_tab_vents_at_once_and_escape_twice_does_from_a_text_field(browser: Browser, lab: ServedLab) -> None:
    tabs = [opened(browser, lab, "") for _ in range(9)]
    for tab in tabs:
        tab.until("state.bench && line.readyState === 1")
    took_ms = tabs[-1].js(
        "(async () => { const t = performance.now(); await tell('vent', {}); return performance.now() - t; })()"
    )
    assert took_ms < 1000  # six event streams would block it for ever
    said = len(lab.lab.bench.said)
    lab.lab.bench.said.append(("", "a line between"))
    tabs[0].js("document.getElementById('where').focus()")
    tabs[0].key("v")  # a letter typed into a filter is no shortcut
    assert lab.lab.bench.said[-1][1] == "a line between"
    tabs[0].key("Escape")
    tabs[0].key("Escape")
    lab.until(lambda: len(lab.lab.bench.said) > said + 1)
    assert tabs[0].errors == []


SLOW = """
name = "slow"
pressure_unit = "kPa"
initial_deployed = [1, 4]
main = [{ hold = -5, for_s = 60 }]
"""


@pytest.mark.skipif(os.name != "posix", reason="freezes the server with SIGSTOP")
def test_the_page_vents_the_run_although_the_server_is_frozen_and_says_so(browser: Browser, tmp_path: Path) -> None:
    (tmp_path / "slow.toml").write_text(SLOW)
    command = [sys.executable, "-m", "straw.replay.cli", "lab", str(tmp_path), "--emulate", "--no-browser"]
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True) as started:
        try:
            assert started.stdout is not None
            found = re.search(r"http://\S+", started.stdout.readline())
            assert found
            url = found[0]
            tab = browser.tab(url)
            tab.goto(url.split("?")[0] + "panel")
            tab.until(READY)
            tab.until("line.readyState === 1 && state.bench")
            tab.js(f"tell('queue', {{ do: 'add', toml: {json.dumps(SLOW)} }})")
            tab.js("tell('arm', { on: true }).then(() => tell('start', {}))")
            tab.until("state.bench.run && direct && direct.readyState === 1", 60)
            server = json.loads((tmp_path / ".straw-lab" / "lab.json").read_text())["pid"]
            os.kill(server, signal.SIGSTOP)
            tab.until("!document.getElementById('lost').hidden")
            said = tab.js("document.getElementById('lost').textContent")
            assert "VENT still reaches the run" in said
            assert "straw rig tell vent" in said
            tab.key("v")
            ServedLab.until(lambda: list(tmp_path.glob("*slow.mcap")))
            os.kill(server, signal.SIGCONT)
            tab.until("document.getElementById('lost').hidden")
            tab.until("!state.bench.run && state.bench.queue.held.includes('vented')")
        finally:
            started.terminate()
    (entry,) = [e for e in catalogue(tmp_path) if e.protocol == "slow"]
    assert entry.status == "abort"
    assert entry.metadata["vent"] == "confirmed"
    assert "vented by" in entry.metadata["exit_reason"]


@pytest.mark.parametrize("page", ["run", "specimen"])
def test_a_page_of_what_is_not_there_says_so_and_shows_nothing_to_fill_in(
    browser: Browser, lab: ServedLab, page: str
) -> None:
    tab = browser.tab(lab.door.url)
    tab.goto(f"http://127.0.0.1:{lab.door.port}/{page}?name=nobody")
    said = tab.until("document.getElementById('title').textContent")
    assert "nobody" in said
    assert tab.js("document.querySelectorAll('main input').length") == 0
    assert tab.errors == []
