"""The lab without a browser: its table agrees with the files, notes lie beside them, an error is one line."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import pytest

pytest.importorskip("uvicorn", reason="the lab's packages are not installed")

from straw.replay.cli import main
from straw.replay.lab.alone import check_alone
from straw.replay.lab.control import Control
from straw.replay.lab.queue import Queue
from straw.rig.errors import RigError
from straw.rig.notes import read_notes
from straw.rig.run_derived import write_tip
from straw.rig.run_read import read_run
from tests.replay.lab import ServedLab
from tests.rig.conftest import trace as _trace
from tests.rig.test_catalogue import recorded

trace = _trace
HOLD = 'pressure_unit = "kPa"\ninitial_deployed = [1]\nmain = [{ hold = 5, for_s = 1 }]\n'


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedLab]:
    """Two runs, one cut."""
    folder = tmp_path_factory.mktemp("lab")
    first = recorded(folder / "a.mcap")
    recorded(folder / "b.mcap", "s2", minute=5)
    (folder / "c.mcap.part").write_bytes(first.read_bytes()[:5000])
    with ServedLab(folder) as served:
        served.until(lambda: served.get("/api/runs")["total"] == 3)
        yield served


def test_the_table_is_filtered_sorted_grouped_and_shown_in_windows(lab: ServedLab) -> None:
    said = lab.get("/api/runs?sort=run&group=specimen&limit=2")
    assert (said["total"], [row["name"] for row in said["rows"]]) == (3, ["a.mcap", "c.mcap.part"])
    assert said["groups"] == [["s1", 2], ["s2", 1]]
    assert lab.get(f"/api/runs?where={quote('specimen = s2')}")["total"] == 1
    assert lab.get(f"/api/runs?where={quote('cut')}")["rows"][0]["kind"] == "part"
    assert [name for name, _ in lab.get("/api/runs?differs=1&where=a.mcap")["columns"]] == []
    assert lab.raw("GET", f"/api/runs?where={quote('specimn = 3')}")[1]["error"].endswith("did you mean specimen?")
    assert lab.raw("GET", "/api/runs?columns=nonsense")[0] == 400


def test_a_note_of_the_page_is_stored_beside_the_file_and_can_be_removed(lab: ServedLab) -> None:
    path = lab.lab.library.folder / "b.mcap"
    lab.post("say", names=["b.mcap"], kind="tag", text="good")
    lab.post("say", names=["b.mcap"], kind="note", text="leaks")
    lab.post("say", names=["b.mcap"], kind="note", text="does not leak", instead_of=2)
    lab.post("say", names=["b.mcap"], kind="mark", text="archive")
    assert read_notes(path).tags == ("good",)
    assert [text for _, text in read_notes(path).notes] == ["does not leak"]
    assert "leaks" in (path.parent / "b.mcap.notes.jsonl").read_text()  # the file is only appended to
    assert lab.get("/api/runs")["total"] == 2
    assert lab.get("/api/runs?where=archived")["total"] == 1
    lab.post("say", names=["b.mcap"], kind="unmark", text="archive")
    assert lab.get("/api/runs")["total"] == 3
    lab.post("say", names=["b.mcap"], kind="mark", text="lock")
    assert "is locked" in lab.post("say", names=["b.mcap"], kind="mark", text="archive")
    lab.post("say", names=["b.mcap"], kind="unmark", text="lock")


def test_lineage_goes_both_ways_by_hash(lab: ServedLab, trace: object) -> None:
    folder = lab.lab.library.folder
    parent = read_run(folder / "a.mcap")
    known = {**parent.metadata, "calibration": "lens.json", "calibration_sha256": "c0ffee" * 10}
    write_tip(folder / "a-tip.mcap", trace, known, parent.sha256, parent.zero_time_ns)  # type: ignore[arg-type]
    lab.lab.library.look()
    lab.until(lambda: lab.get("/api/runs?all=1")["of"] >= 4)
    down = lab.get("/api/run?name=a.mcap")
    track, lens = down["lineage"]
    assert (track["relation"], track["name"]) == ("track", "a-tip.mcap")
    assert (lens["relation"], lens["file"], lens["says"]) == ("calibration", "lens.json", "1 track with it")
    made = lab.get(f"/api/runs?all=1&where={quote('calibration_sha256 = ' + lens['sha256'])}")  # and back up
    assert [row["name"] for row in made["rows"]] == ["a-tip.mcap"]
    assert {"X", "Z", "Phi", "pressure 1"} <= set(down["signals"])  # the track's tip beside the run's pressure
    up = lab.get("/api/run?name=a-tip.mcap")
    assert (up["lineage"][0]["relation"], up["lineage"][0]["sha256"]) == ("derived from", parent.sha256)
    assert up["lineage"][1]["sha256"] == lens["sha256"]
    row = next(row for row in lab.get("/api/runs")["rows"] if row["name"] == "a.mcap")
    assert {"p", "x", "z"} <= set(row["preview"])
    life = lab.get("/api/specimen?name=s1")
    assert [r["name"] for r in life["runs"]] == ["a.mcap", "c.mcap.part"]
    assert life["cycles"] == 4
    beside = lab.get(f"/api/compare?runs={quote('a.mcap|b.mcap')}")
    assert beside["settings"]["specimen"] == ["s1", "s2"]


def test_a_cut_recording_is_made_whole_and_the_cut_one_stays(lab: ServedLab) -> None:
    done = lab.post("recover", name="c.mcap.part")
    folder = lab.lab.library.folder
    assert done["path"] == "c.mcap"
    assert (folder / "c.mcap.part").exists()
    assert read_run(folder / "c.mcap").metadata["exit_status"] == "fail"
    assert "exists" in lab.post("recover", name="c.mcap.part")


def test_files_added_and_removed_in_subfolders_are_noticed(lab: ServedLab) -> None:
    folder = lab.lab.library.folder
    recorded(folder / "new.mcap", "s9", minute=9)
    lab.lab.library.look()
    lab.until(lambda: lab.get("/api/runs?where=new.mcap")["total"] == 1)
    (folder / "new.mcap").rename(folder / "renamed.mcap")
    lab.lab.library.look()
    lab.until(lambda: lab.get("/api/runs?where=renamed")["total"] == 1)
    (folder / "renamed.mcap").unlink()
    lab.lab.library.look()
    lab.until(lambda: lab.get("/api/runs?where=renamed")["total"] == 0)
    assert "is not in" in lab.raw("GET", "/api/run?name=renamed.mcap")[1]["error"]


def test_a_film_is_stored_beside_its_run_and_entered_in_its_manifest(lab: ServedLab) -> None:
    headers = {**lab.own, "Content-Type": "application/octet-stream"}
    said = lab.raw("POST", "/api/film?name=a.mcap&file=..%2F..%2FGX01.MP4", headers, "frames")
    track = "straw track a-GX01.MP4 --run a.mcap --camera CAMERA.json --start S -o a-tip.mcap"
    assert said == (200, {"film": "a-GX01.MP4", "track": track})
    assert (lab.lab.library.folder / "a-GX01.MP4").read_text() == "frames"
    assert lab.raw("POST", "/api/film?name=a.mcap&file=GX01.MP4", headers, "again")[0] == 400
    assert lab.raw("POST", "/api/film?name=a.mcap&file=x.html", headers, "page")[0] == 400
    assert lab.raw("POST", "/api/film?name=a.mcap&file=y.MP4", {**headers, "Content-Type": "text/plain"}, "f")[0] == 415
    assert main(["runs", "verify", "a.mcap", "--dir", str(lab.lab.library.folder)]) == 0


def test_a_second_lab_of_a_folder_finds_the_first(lab: ServedLab, capsys: pytest.CaptureFixture[str]) -> None:
    assert check_alone(lab.lab.library.folder) == lab.door.url
    assert main(["lab", str(lab.lab.library.folder), "--no-browser"]) == 0
    assert f"open already: {lab.door.url}" in capsys.readouterr().out


def test_a_port_in_use_a_wrong_folder_and_a_public_address_are_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        assert main(["lab", str(tmp_path), "--no-browser", "--listen", address]) == 2
    assert main(["lab", str(tmp_path / "no"), "--no-browser"]) == 2
    assert main(["lab", str(tmp_path), "--no-browser", "--listen", "0.0.0.0:0"]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 3
    assert "port 0" in said[0]
    assert "not a folder" in said[1]
    assert "--remote" in said[2]


def test_a_read_only_folder_can_be_viewed(tmp_path: Path) -> None:
    recorded(tmp_path / "a.mcap")
    (tmp_path / ".straw-lab").write_text("in the way")  # root is refused nothing else
    (tmp_path / "a.mcap.notes.jsonl").mkdir()
    with ServedLab(tmp_path, emulate=True) as lab:
        lab.until(lambda: lab.get("/api/runs")["total"] == 1)
        assert "cannot be written" in lab.post("job", kind="replay", names=["a.mcap"])
        assert "cannot be written" in lab.post("say", names=["a.mcap"], kind="note", text="x")


def test_the_queue_survives_a_restart_and_then_waits_for_a_person(tmp_path: Path) -> None:
    queue = Queue(tmp_path / "queue.json")
    first = queue.add(HOLD, "s1", 2, 0.0)
    queue.add(HOLD, "s1", 1, 0.0)
    assert queue.next is None  # nothing starts by itself
    queue.release()
    assert queue.next == first
    queue.ended(first.id, True, "well")
    queue.ended(first.id, False, "stopped by Ada")
    assert queue.items[0].id == first.id  # a stopped one stays where it was
    again = Queue(tmp_path / "queue.json")
    assert [item.done for item in again.items] == [1, 0]
    assert (again.next, again.held) == (None, "the lab was started again")
    with pytest.raises(RigError, match="main is missing"):
        queue.add('pressure_unit = "kPa"\ninitial_deployed = []', "", 1, 0.0)


def test_nothing_starts_unless_armed_and_ordered_by_the_page_in_control(lab: ServedLab) -> None:
    assert "there is no rig" in lab.post("arm", on=True)
    bench = lab.lab.bench
    bench.emulated = True
    assert "not armed" in lab.post("start")
    assert "empty" in (lab.post("arm", on=True) and lab.post("start"))
    assert "T is in control" in lab.post("queue", who="another", do="add", toml=HOLD)
    assert lab.post("vent", who="another")["says"] == "nothing runs, nothing is under pressure"
    assert not bench.armed  # a vent disarms
    assert "limit of 60 kPa" in lab.post("queue", do="add", toml=HOLD.replace("= 5", "= 80"))


def test_control_passes_to_the_requesting_page_when_its_holder_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    from straw.replay.lab import control as module

    now = [0.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    control = Control()
    for who in ("a", "b"):
        control.heard(who, who.upper())
    control.take("a")
    control.take("b")
    assert control.holder == "a"
    control.give("a", keep=True)
    now[0] += module.ANSWER_S + 1
    for who in ("a", "b"):
        control.heard(who, who.upper())
    assert control.holder == "a"  # kept
    control.take("b")
    for _ in range(6):  # the page is open, but nobody answers
        now[0] += module.ANSWER_S / 5 + 0.1
        for who in ("a", "b"):
            control.heard(who, who.upper())
    assert control.holder == "b"
    now[0] += module.AWAY_S + 1  # its page is closed
    control.heard("a", "A")
    assert control.as_data("a")["holder"] == ""


@pytest.mark.skipif(os.name != "posix", reason="file modes")
def test_the_access_token_is_readable_by_its_owner_alone(lab: ServedLab) -> None:
    state = lab.lab.library.folder / ".straw-lab"
    assert state.stat().st_mode & 0o077 == 0
    assert json.loads((state / "lab.json").read_text())["url"] == lab.door.url
