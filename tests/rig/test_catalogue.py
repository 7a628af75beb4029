"""The catalogue agrees with the files, keeps notes beside them, and detects every changed byte."""

import hashlib
import json
import shutil
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from straw.replay.cli import main
from straw.rig.catalogue import INDEX, Entry, catalogue, find, latest_tracks
from straw.rig.errors import RigError
from straw.rig.manifest import check, manifest_of, read_manifest, seal
from straw.rig.notes import Notes, notes_of, read_notes, say
from straw.rig.run_derived import write_tip
from straw.rig.run_read import read_fitting, read_run
from straw.rig.run_write import RunWriter
from straw.tracking.trace import TipTrace

ZERO_NS = 1_795_000_000_000_000_000


def recorded(path: Path, specimen: str = "s1", offset_pa: float = 0.0, minute: int = 0) -> Path:
    zero_ns = ZERO_NS + minute * 60 * 10**9
    meta = {"run_id": path.stem, "specimen": specimen, "initial_deployed": "1,4", "cycle": "3", "cells": "9"}
    with RunWriter(path, {**meta, "zero_time_ns": str(zero_ns), "rate_hz": "100"}, {"protocol.toml": b"x = 1"}) as w:
        w.event("start", "go", zero_ns)
        for k in range(200):
            at_ns = zero_ns + k * 10_000_000
            w.add("/pressure/measured", at_ns, pressure_pa=offset_pa - 100.0 * k, sigma_pa=30.0, channel=1)
    return path


@pytest.fixture
def folder(tmp_path: Path, trace: TipTrace) -> Path:
    """Two runs, a track of the first, a cut one and a foreign file."""
    first = recorded(tmp_path / "a.mcap")
    (tmp_path / "later").mkdir()
    recorded(tmp_path / "later" / "b.mcap", "s2", 500.0, minute=5)
    parent = read_run(first)
    write_tip(tmp_path / "a-tip.mcap", trace, dict(parent.metadata), parent.sha256, parent.zero_time_ns)
    data = first.read_bytes()
    (tmp_path / "c.mcap.part").write_bytes(data[: len(data) // 2])
    (tmp_path / "d.mcap").write_bytes(b"no recording")
    return tmp_path


def test_the_catalogue_agrees_with_the_files_with_or_without_its_index(folder: Path) -> None:
    entries = catalogue(folder)
    assert {entry.name: entry.kind for entry in entries} == {
        "a.mcap": "run",
        "a-tip.mcap": "track",
        "later/b.mcap": "run",
        "c.mcap.part": "part",
        "d.mcap": "unreadable",
    }
    by_name = {entry.name: entry for entry in entries}
    assert by_name["a-tip.mcap"].parent == by_name["a.mcap"].sha256
    assert by_name["a.mcap"].duration_s == pytest.approx(1.99)
    assert (by_name["later/b.mcap"].specimen, by_name["later/b.mcap"].start_ns) == ("s2", ZERO_NS + 300 * 10**9)
    assert "never finished" in by_name["c.mcap.part"].problem
    assert [e.start_ns for e in entries] == sorted(e.start_ns for e in entries)
    assert catalogue(folder) == entries
    (folder / INDEX).unlink()
    assert catalogue(folder) == entries
    (folder / INDEX).write_text('{"version": 1, "recordings": [{"name": 3}')
    assert catalogue(folder) == entries


def test_with_the_index_a_file_is_read_again_only_when_it_changes(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    catalogue(folder)
    read: list[str] = []
    monkeypatch.setattr("straw.rig.catalogue.read_fitting", lambda path: read.append(path.name) or read_fitting(path))
    catalogue(folder)
    assert read == []
    recorded(folder / "new.mcap")
    catalogue(folder)
    assert read == ["new.mcap"]
    catalogue(folder, rebuild=True)
    assert len(read) == 1 + 6


def test_a_run_is_found_by_file_id_or_digest(folder: Path) -> None:
    sha = read_run(folder / "later" / "b.mcap").sha256
    for wanted in ("b", "later/b.mcap", sha, sha[:8], str(folder / "later" / "b.mcap")):
        assert find(folder, wanted) == folder / "later" / "b.mcap"
    assert find(folder, "a") == folder / "a.mcap"  # rather than its track, or the cut copy
    with pytest.raises(RigError, match="is not in"):
        find(folder, "nobody")
    shutil.copy(folder / "later" / "b.mcap", folder / "copy.mcap")
    with pytest.raises(RigError, match=r"name of 2 recordings"):
        find(folder, "b")


def test_tags_and_notes_are_kept_beside_the_run_and_leave_it_unchanged(folder: Path) -> None:
    run = folder / "a.mcap"
    before = run.read_bytes()
    for kind, text in [
        ("tag", "good"),
        ("note", "pump was loud"),
        ("tag", "first"),
        ("untag", "good"),
        ("tag", "good"),
    ]:
        say(run, kind, text)
    assert read_notes(run).tags == ("first", "good")
    assert [text for _, text in read_notes(run).notes] == ["pump was loud"]
    assert run.read_bytes() == before
    with notes_of(run).open("a") as stream:
        stream.write('{"time": "cut in the mid')
    assert read_notes(run).tags == ("first", "good")
    assert next(e for e in catalogue(folder) if e.name == "a.mcap").tags == ("first", "good")
    assert read_notes(folder / "nothing.mcap") == Notes()
    for kind, text in [("tag", "two words"), ("tag", ""), ("note", "  ")]:
        with pytest.raises(RigError, match="expected"):
            say(run, kind, text)


def test_the_manifest_is_sha256sums_and_shows_every_change(folder: Path) -> None:
    run, video = folder / "a.mcap", folder / "video.mp4"
    video.write_bytes(b"moving pictures")
    seal(run, [video])
    assert read_manifest(run) == {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in (run, video)}
    if shutil.which("sha256sum"):
        subprocess.run(["sha256sum", "--quiet", "-c", manifest_of(run).name], cwd=folder, check=True)
    assert [one.problem for one in check(run)] == [None, None]
    video.write_bytes(b"moving Pictures")
    assert [one.problem for one in check(run)] == [None, "was changed"]
    with pytest.raises(RigError, match="was changed since it was entered"):
        seal(run, [video])
    video.unlink()
    assert [one.problem for one in check(run)] == [None, "is missing"]


def test_opening_a_run_that_was_changed_reports_the_change(folder: Path) -> None:
    run = folder / "a.mcap"
    other = recorded(folder / "other.mcap", offset_pa=1.0).read_bytes()
    assert read_run(run).damage == ()
    run.write_bytes(other)  # whole, with good checksums of its own: only the manifest shows the change
    assert "SHA-256 is not the one in its manifest" in read_run(run).damage[0]
    assert main(["runs", "compare", str(run), str(folder / "other.mcap")]) == 2


def test_verify_fails_when_anything_is_wrong(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    at = ["--dir", str(folder)]
    assert main(["runs", "verify", "a", "b", *at]) == 0
    assert "2 files as recorded, 0 changed or damaged, 0 unknown" in capsys.readouterr().out
    assert main(["runs", "verify", *at, "--json", str(folder / "v.json")]) == 1
    problems = json.loads((folder / "v.json").read_text())["problems"]
    assert len(problems) == 2  # the part and the foreign file
    capsys.readouterr()
    data = bytearray((folder / "a.mcap").read_bytes())
    data[len(data) // 2] ^= 1
    (folder / "a.mcap").write_bytes(data)
    assert main(["runs", "verify", "a.mcap", *at]) == 1
    said = capsys.readouterr().out
    assert "a.mcap" in said
    assert main(["runs", "verify", "a-tip.mcap", *at]) == 1
    assert "derived from" in capsys.readouterr().out


def test_list_show_tag_note_from_the_command_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    at = ["--dir", str(folder)]
    assert main(["runs", "tag", "b", "good", *at]) == 0
    assert main(["runs", "note", "b", "hello", "there", *at]) == 0
    capsys.readouterr()
    assert main(["runs", "list", *at, "--tag", "good", "--json", str(folder / "l.json")]) == 0
    assert [row["run_id"] for row in json.loads((folder / "l.json").read_text())] == ["b"]
    assert "later/b.mcap" in capsys.readouterr().out
    assert main(["runs", "show", "b", *at]) == 0
    said = capsys.readouterr().out
    for words in ("s2", "hello there", "good", "git_commit", "as recorded", "pressure             200"):
        assert words in said, words
    assert main(["runs", "show", "nobody", *at]) == 2


def test_compare_finds_the_planted_difference(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "c.json"
    assert main(["runs", "compare", str(folder / "a.mcap"), "b", "--dir", str(folder), "--json", str(out)]) == 0
    data = json.loads(out.read_text())
    assert data["settings"] == {"specimen": ["s1", "s2"]}
    signal = data["signals"]["pressure"]
    assert (signal["n"], signal["bias"], signal["rmse"]) == (200, pytest.approx(500.0), pytest.approx(500.0))
    assert signal["reduced_chi2"] == pytest.approx(500.0**2 / (2 * 30.0**2))
    assert "s1 | s2" in capsys.readouterr().out


def test_an_export_is_an_ro_crate_with_every_file_of_the_run(folder: Path) -> None:
    (folder / "video.mp4").write_bytes(b"moving pictures")
    at = ["--dir", str(folder)]
    assert main(["runs", "attach", str(folder / "a.mcap"), str(folder / "video.mp4"), *at]) == 0
    assert main(["runs", "note", str(folder / "a.mcap"), "first light", *at]) == 0
    crate = folder / "crate"
    assert main(["runs", "export", str(folder / "a.mcap"), "-o", str(crate), "--licence", "CC-BY-4.0", *at]) == 0
    graph = {e["@id"]: e for e in json.loads((crate / "ro-crate-metadata.json").read_text())["@graph"]}
    held = {path.name for path in crate.iterdir()} - {"ro-crate-metadata.json"}
    assert held == {"a.mcap", "a.mcap.sha256", "a.mcap.notes.jsonl", "a-tip.mcap", "video.mp4", "protocol.toml"}
    assert {part["@id"] for part in graph["./"]["hasPart"]} == held
    assert graph["ro-crate-metadata.json"]["conformsTo"] == {"@id": "https://w3id.org/ro/crate/1.1"}
    for name in held:
        assert graph[name]["sha256"] == hashlib.sha256((crate / name).read_bytes()).hexdigest()
    for entity in graph.values():  # flat, as the specification requires: nested entities are references
        for value in entity.values():
            for one in value if isinstance(value, list) else [value]:
                if isinstance(one, dict):
                    assert set(one) == {"@id"}
                    assert one["@id"] in graph or "://" in one["@id"]
    assert read_run(crate / "a.mcap").damage == ()
    assert main(["runs", "export", str(folder / "a.mcap"), "-o", str(crate), *at]) == 2
    assert main(["runs", "export", str(folder / "a.mcap"), "-o", str(folder / "crate.zip"), *at]) == 0
    assert "ro-crate-metadata.json" in zipfile.ZipFile(folder / "crate.zip").namelist()
    assert [p.name for p in folder.glob("*.part")] == ["c.mcap.part"]


def test_an_independent_reader_accepts_the_crate(folder: Path) -> None:
    pytest.importorskip("rocrate", reason="the PyPI package rocrate, an independent reader, is not installed")
    assert main(["runs", "export", str(folder / "a.mcap"), "-o", str(folder / "crate"), "--dir", str(folder)]) == 0
    code = f"from rocrate.rocrate import ROCrate; print(len(ROCrate({str(folder / 'crate')!r}).data_entities))"
    assert int(subprocess.check_output([sys.executable, "-c", code], text=True)) == 4


def test_recover_from_the_command_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["runs", "recover", str(folder / "c.mcap.part")]) == 0
    assert "lost: the file was never finished" in capsys.readouterr().out
    assert read_run(folder / "c.mcap").damage == ()
    assert main(["runs", "recover", str(folder / "a.mcap")]) == 2


def test_traces_with_gaps_are_compared_only_where_both_have_samples(folder: Path) -> None:
    short = TipTrace(
        *(np.array([0.0, 1.0]) for _ in range(4)),
        *(np.full(2, np.nan) for _ in range(3)),
        valid=np.ones(2, bool),
        frame=np.arange(2),
    )
    write_tip(folder / "s.mcap", short, {"run_id": "s"}, "", ZERO_NS + 10**12)
    assert main(["runs", "compare", str(folder / "a.mcap"), str(folder / "s.mcap")]) == 2  # nothing in common


def test_a_tag_after_a_torn_line_is_kept_and_found(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = folder / "a.mcap"
    say(run, "tag", "first")
    with notes_of(run).open("ab") as stream:
        stream.write(b'{"time": "2026-11-24T00:00:00+00:00", "tag": "cut in the mi\xc3')
    assert main(["runs", "tag", str(run), "good"]) == 0
    assert "tags first, good" in capsys.readouterr().out
    assert read_notes(run).tags == ("first", "good")


def test_verify_distinguishes_recorded_unknown_and_changed_files(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    at = ["--dir", str(folder), "--json", str(folder / "v.json")]
    manifest_of(folder / "later" / "b.mcap").unlink()
    for name in ("c.mcap.part", "d.mcap"):
        (folder / name).unlink()
    assert main(["runs", "verify", *at]) == 0
    said = json.loads((folder / "v.json").read_text())
    assert [Path(name).name for name in said["recorded"]] == ["a.mcap"]
    assert sorted(Path(name).name for name in said["unknown"]) == ["a-tip.mcap", "b.mcap"]
    assert "all as recorded" not in (out := capsys.readouterr().out)
    assert "1 files as recorded, 0 changed or damaged, 2 unknown: no checksum was kept of" in out
    assert main(["runs", "attach", str(folder / "a.mcap"), str(folder / "a-tip.mcap")]) == 0
    assert main(["runs", "verify", *at]) == 0
    assert [Path(name).name for name in json.loads((folder / "v.json").read_text())["unknown"]] == ["b.mcap"]
    shutil.copy(folder / "a.mcap", folder / "copy.mcap")
    capsys.readouterr()
    assert main(["runs", "verify", *at]) == 0
    assert "copy.mcap: the same recording as" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["", "no digest at all\n"])
def test_a_damaged_checksum_file_is_reported_as_such_and_its_run_can_be_read(
    folder: Path, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run = folder / "a.mcap"
    manifest_of(run).write_text(text)
    assert read_run(run).damage == ()
    assert "whether the run is as recorded cannot be told" in read_run(run).lost[-1]
    assert {e.name: e.kind for e in catalogue(folder)}["a.mcap"] == "run"
    assert main(["runs", "show", "a", "--dir", str(folder)]) == 0
    capsys.readouterr()
    assert main(["runs", "verify", "a", "--dir", str(folder)]) == 1
    said = capsys.readouterr().out
    assert f"manifest {manifest_of(run)}" in said
    assert "0 files as recorded, 1 changed or damaged, 1 unknown" in said


def test_recovering_nothing_is_an_error(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = (folder / "a.mcap").read_bytes()
    (folder / "head.mcap.part").write_bytes(data[:900])
    assert main(["runs", "recover", str(folder / "head.mcap.part")]) == 2
    assert "no message that can be read" in capsys.readouterr().err
    assert not (folder / "head.mcap").exists()


def test_of_two_tracks_of_a_run_the_one_made_last_counts_unless_it_is_archived() -> None:
    first = Entry("z-tip.mcap", 1, 100, "track", parent="run")
    second = Entry("a-tip.mcap", 1, 200, "track", parent="run")
    others = [Entry("p.mcap", 1, 300, "prediction", parent="run"), Entry("t.mcap", 1, 300, "track")]
    assert latest_tracks([second, first, *others]) == {"run": second}
    assert latest_tracks([replace(second, marks=("archive",)), first]) == {"run": first}
