"""The closed loop on the lab's page: shown round by round, approved or refused, stopped, continued after a crash."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

import pytest

pytest.importorskip("uvicorn", reason="the lab's packages are not installed")

from straw.replay.cli import main
from straw.replay.errors import ReplayError
from straw.replay.investigate.ask import answer, from_elsewhere
from straw.replay.investigate.budget import Budget
from straw.replay.investigate.log import Log
from straw.replay.investigate.loop import Loop
from straw.replay.investigate.pulse import PULSE, Pulse, read_pulse
from straw.replay.investigate.steps import Ahead, Plan, Proposal
from straw.replay.investigate.stop import Stop
from tests.replay.driven import Browser
from tests.replay.lab import ServedLab
from tests.replay.loop_fakes import Fakes

TOML = 'name = "a"\npressure_unit = "kPa"\ninitial_deployed = [1, 4]\nmain = [{ hold = -5, for_s = 1 }]\n'
LOG = "investigate-s.jsonl"


class AskingOtherProcess(Fakes):
    """Steps with made-up experiments, whose approval comes from another process."""

    def __init__(self, place: Path, pulse: Pulse, named_after: int) -> None:
        super().__init__(named_after, [Proposal(TOML, (1, 4), "folding", 0.5, 9.0, 0.1, 3, chances=(0.1, 0.9))])
        self.asks = from_elsewhere(place, pulse, emulated=True)

    def dry_run(self, proposal: Proposal, left: Sequence[int] | None) -> Plan:
        time_s = [0.0, 0.5, 1.0]
        columns = {"pressure_pa": [0.0, -5e3, -5e3], "x_m": [0.0, 1e-3, 2e-3], "z_m": [0.08] * 3, "phi_rad": [0.0] * 3}
        return Plan(0.1, 3, "a: -5 to 0 kPa", "", (1,), {"time_s": time_s, **columns})

    def ask(self, proposal: Proposal, plan: Plan, ahead: Ahead) -> str:
        return self.asks(proposal, plan, ahead)


class LoopInThread:
    """A loop that runs in a thread, in a folder; ``stop`` is how it ended."""

    def __init__(self, folder: Path, named_after: int = 2) -> None:
        self.folder, self.named_after, self.stop = folder, named_after, Stop("", "")
        self.place = folder / LOG.removesuffix(".jsonl")
        self.place.mkdir(exist_ok=True)
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        with Log(self.folder / LOG) as log, Pulse(self.place) as pulse:
            log.write("began", specimen="s", certainty=0.9, rounds=4)
            loop = Loop(log, AskingOtherProcess(self.place, pulse, self.named_after), Budget(4))
            self.stop = loop.run()


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[ServedLab]:
    with ServedLab(tmp_path, emulate=True) as served:
        yield served


def waits(lab: ServedLab) -> bool:
    return bool(lab.get("/api/loops")["logs"]) and bool(lab.get(f"/api/loop?log={LOG}")["waits"])


def test_a_loop_is_shown_answered_and_its_end_reported(lab: ServedLab, tmp_path: Path) -> None:
    going = LoopInThread(tmp_path)
    lab.until(lambda: waits(lab))
    said = lab.get(f"/api/loop?log={LOG}")
    assert (said["specimen"], said["asked_for"]["rounds"], said["next"]["runs"]) == ("s", 4, 2)
    assert said["next"]["signals"]["X"] == {"time_s": [0.0, 0.5, 1.0], "values": [0.0, 1.0, 2.0], "unit": "mm"}
    assert [name for name, _ in said["rounds"][0]["probability"]] == ["cohesion", "squeeze_film", "complete"]
    assert "T says yes" in lab.post("investigate", do="answer", log=LOG, yes=True)["says"]
    lab.until(lambda: len(lab.get(f"/api/loop?log={LOG}")["rounds"]) == 2)
    lab.until(lambda: waits(lab))
    lab.post("investigate", do="answer", log=LOG, yes=True)
    lab.until(lambda: lab.get(f"/api/loop?log={LOG}")["stopped"])
    said = lab.get(f"/api/loop?log={LOG}")
    assert (said["stopped"]["reason"], said["spent"]["rounds"], said["next"]) == ("named", 2, None)
    assert [row.get("ran", {}).get("status") for row in said["rounds"]] == ["success", "success", None]
    going.thread.join(5)
    assert going.stop.reason == "named"
    assert lab.get("/api/loops")["logs"] == [{"name": LOG, "alive": False, "reason": "named", "rounds": 2}]


def test_approving_takes_control_refusing_does_not_and_only_the_open_question_is_answered(
    lab: ServedLab, tmp_path: Path
) -> None:
    going = LoopInThread(tmp_path)
    lab.until(lambda: waits(lab))
    lab.lab.bench.control.heard("other", "Ada")
    lab.lab.bench.control.take("other")
    assert "Ada is in control" in lab.post("investigate", do="answer", log=LOG, yes=True)
    (going.place / "answer.json").write_text('{"round": 7, "key": "other", "yes": true, "who": "stale"}')
    lab.until(lambda: not (going.place / "answer.json").exists())
    assert waits(lab)
    lab.post("investigate", do="answer", log=LOG, yes=False)
    going.thread.join(10)
    assert going.stop.reason == "refused"


def test_another_terminal_answers_as_the_page_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["investigate", str(tmp_path), "--specimen", "s", "--operator", "Ada", "--answer"]
    assert main([*words, "yes"]) == 2
    assert "none is running" in capsys.readouterr().err
    going = LoopInThread(tmp_path, named_after=1)
    ServedLab.until(lambda: (read_pulse(going.place) or {}).get("asked"))
    assert main([*words, "yes"]) == 0
    going.thread.join(10)
    assert going.stop.reason == "named"
    assert '"who": "Ada"' in (tmp_path / LOG).read_text()


def test_a_loop_whose_process_died_is_distinguished_from_a_running_one(lab: ServedLab, tmp_path: Path) -> None:
    place = tmp_path / LOG.removesuffix(".jsonl")
    place.mkdir()
    with Log(tmp_path / LOG) as log:
        log.write("began", specimen="s")
        log.write("diagnosed", verdict="too_few", says="0 runs", recordings=[])
    (place / PULSE).write_text('{"pid": 1, "doing": "diagnose"}')
    assert not lab.get(f"/api/loop?log={LOG}")["cut"]
    import os

    os.utime(place / PULSE, (0, 0))  # more than an hour ago
    assert lab.get(f"/api/loop?log={LOG}")["cut"]
    assert "is not running" in lab.post("investigate", do="stop", log=LOG)
    with pytest.raises(ReplayError, match="none is running"):
        answer(place, True, "Ada")


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({}, "which specimen"),
        ({"specimen": "s", "rounds": "many"}, "rounds = 'many'"),
        ({"specimen": "s", "minutes": "inf"}, "expected a number"),
    ],
)
def test_an_invalid_start_is_one_line_and_starts_nothing(lab: ServedLab, asked: dict[str, str], says: str) -> None:
    assert says in lab.post("investigate", do="start", **asked)
    assert lab.get("/api/loops")["logs"] == []


def test_the_page_shows_why_a_process_ended_at_once(lab: ServedLab) -> None:
    assert lab.post("investigate", do="start", specimen="s", tolerance="nonsense") == {"log": LOG}
    lab.until(lambda: "--tolerance nonsense" in lab.get(f"/api/loop?log={LOG}")["complaint"], 60)


def test_nothing_outside_a_loops_own_folder_is_shown(lab: ServedLab, tmp_path: Path) -> None:
    (tmp_path / "secret.html").write_text("secret")
    with Log(tmp_path / LOG) as log:
        log.write("began", specimen="s")
    for path in (f"/found/{LOG}/{quote('../secret.html', safe='')}", "/found/secret.html/secret.html"):
        assert lab.raw("GET", path)[0] == 404
    assert lab.raw("GET", f"/api/loop?log={quote('../x')}")[0] == 400


def test_the_page_shows_posterior_and_prediction_accepts_an_approval_and_fits_a_phone(
    lab: ServedLab, tmp_path: Path
) -> None:
    with Browser(tmp_path / "chromium") as browser:
        going = LoopInThread(tmp_path, named_after=1)
        lab.until(lambda: waits(lab))
        tab = browser.tab(lab.door.url)
        tab.call("Emulation.setDeviceMetricsOverride", width=390, height=800, deviceScaleFactor=1, mobile=True)
        tab.goto(f"http://127.0.0.1:{lab.door.port}/investigate")
        tab.until("loop && loop.waits && !document.getElementById('yes').disabled")
        assert tab.js("document.querySelectorAll('#curves .plot').length") == 4
        assert "0.50" in tab.js("document.querySelector('.bar').textContent")
        assert tab.js("document.documentElement.scrollWidth <= innerWidth")
        tab.js("document.getElementById('yes').click()")
        tab.until("loop.stopped && document.getElementById('doing').textContent.includes('named')")
        assert tab.js("document.getElementById('nextCard').hidden")
        assert tab.errors == []
    going.thread.join(10)
    assert going.stop.reason == "named"
