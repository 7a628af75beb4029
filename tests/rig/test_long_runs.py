"""Recordings larger than the memory: recovered chunk by chunk, read into arrays only, or refused in one line."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from straw.replay.cli import main
from straw.rig.catalogue import entry_of
from straw.rig.errors import RigError
from straw.rig.manifest import check, seal
from straw.rig.mcap_summary import summary_of
from straw.rig.mcap_write import CHUNK_BYTES
from straw.rig.memory import PEAK, TooLongError
from straw.rig.recover import recover
from straw.rig.run_channels import details
from straw.rig.run_decode import empty
from straw.rig.run_file import RunFile
from straw.rig.run_read import read_run
from straw.rig.schema import encode
from straw.rig.tables import export_table

ZERO_NS = 1_795_000_000_000_000_000
METADATA = {
    "run_id": "r1",
    "specimen": "s1",
    "initial_deployed": "1,4",
    "cycle": "0",
    "cells": "9",
    "zero_time_ns": str(ZERO_NS),
}
STEP_NS = 10_000_000  # 100 Hz
READINGS = 60_000
#: A chunk, compressed and not, being read and being written, times the copies that the code makes of each, and the
#: writer's index of its messages in Python integers; it does not grow with the file.
A_FEW_CHUNKS = 8 * CHUNK_BYTES


def recording(path: Path, count: int, raw_bytes: int = 0) -> Path:
    """A run whose pressure is noise with one peak and one trough of one sample each; ``raw_bytes`` do not compress."""
    noise = np.random.default_rng(0)
    pressures = noise.normal(0.0, 100.0, count)
    pressures[count // 3], pressures[count // 2] = 5000.0, -4000.0
    file = RunFile(path, METADATA)
    for k, pressure_pa in enumerate(pressures.tolist()):
        at_ns = ZERO_NS + k * STEP_NS
        values = {"pressure_pa": pressure_pa, "sigma_pa": 30.0, "channel": 1, "raw": noise.bytes(raw_bytes)}
        file.add("/pressure/measured", at_ns, encode("/pressure/measured", at_ns, values), log_time_ns=at_ns)
    file.add("/events", ZERO_NS, encode("/events", ZERO_NS, {"kind": "start", "text": ""}))
    file.finish({"exit_status": "success"})
    return path


def peak_bytes(do: Callable[[], object]) -> int:
    """Peak memory during the call."""
    tracemalloc.start()
    try:
        do()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file four times as large as the memory allowed for its recovery: its bytes do not compress."""
    return recording(tmp_path_factory.mktemp("noisy") / "run.mcap", 4 * A_FEW_CHUNKS // 4096, raw_bytes=4096)


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten minutes of plain readings: many messages in few bytes."""
    return recording(tmp_path_factory.mktemp("long") / "run.mcap", READINGS)


def test_a_run_is_recovered_in_the_memory_of_a_few_chunks(noisy: Path, tmp_path: Path) -> None:
    data = noisy.read_bytes()
    part = tmp_path / "cut.mcap.part"
    part.write_bytes(data[: len(data) * 9 // 10])
    assert part.stat().st_size > 3 * A_FEW_CHUNKS
    del data
    assert peak_bytes(lambda: recover(part)) < A_FEW_CHUNKS
    whole, cut = read_run(noisy).pressure, read_run(tmp_path / "cut.mcap").pressure
    assert whole is not None
    assert cut is not None
    assert len(cut) > 0.89 * len(whole)
    np.testing.assert_array_equal(cut.pressure_pa, whole.pressure_pa[: len(cut)])


def test_a_manifest_is_checked_in_the_memory_of_a_few_chunks(noisy: Path) -> None:
    seal(noisy)
    assert peak_bytes(lambda: check(noisy)) < A_FEW_CHUNKS


@pytest.mark.parametrize(
    "read", [read_run, lambda path: entry_of(path, path.name), details], ids=["read_run", "catalogue", "page"]
)
def test_a_run_is_read_in_the_memory_of_its_samples(long: Path, read: Callable[[Path], object]) -> None:
    sample_bytes = empty("/pressure/measured").sample_bytes
    assert sample_bytes == 4 * 8  # time, pressure, sigma, channel
    # A page reads the file for the run and again for all its channels, while it holds the run's arrays.
    assert peak_bytes(lambda: read(long)) < PEAK * READINGS * sample_bytes + A_FEW_CHUNKS


def test_a_files_summary_states_its_contents(long: Path, tmp_path: Path) -> None:
    said = summary_of(long)
    assert said is not None
    assert said.counts == {"/pressure/measured": READINGS, "/events": 1}
    data = bytearray(long.read_bytes())
    cut, changed = tmp_path / "cut.mcap", tmp_path / "changed.mcap"
    cut.write_bytes(data[:-1])
    data[-100] ^= 1  # in the summary
    changed.write_bytes(data)
    assert [summary_of(path) for path in (cut, changed, tmp_path / "none.mcap")] == [None] * 3


def test_what_does_not_fit_into_memory_is_refused_in_one_line_with_a_step_that_fits(
    long: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    room = READINGS * 20
    monkeypatch.setattr("straw.rig.memory.available_bytes", lambda: room)
    monkeypatch.setattr("straw.rig.run_read.available_bytes", lambda: room)
    monkeypatch.setattr("straw.rig.run_decode.available_bytes", lambda: room)
    monkeypatch.setattr("straw.rig.run_decode._CHECKED", 1000)
    data = long.read_bytes()
    part = tmp_path / "run.mcap.part"
    part.write_bytes(data[: len(data) * 9 // 10])  # has no summary with the number of messages
    for path in (long, part):
        with pytest.raises(TooLongError, match=r"holds [0-9,]+ samples.*read it thinned: read_run.*every_s=") as caught:
            read_run(path)
        assert "\n" not in str(caught.value)
        assert str(path) in str(caught.value)
        read_run(path, every_s=caught.value.every_s)
    assert entry_of(long, long.name).kind == "run"
    assert details(long)["signals"]["pressure 1"]["values"]
    monkeypatch.setattr("straw.rig.tables.own.available_bytes", lambda: room)
    with pytest.raises(RigError, match="export fewer topics"):
        export_table(long, csv=tmp_path / "run.csv")


def test_a_run_that_does_not_fit_into_memory_is_shown_thinned_and_says_so(
    long: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in ("memory", "run_read", "run_decode"):
        monkeypatch.setattr(f"straw.rig.{module}.available_bytes", lambda: READINGS * 20)
    assert main(["runs", "show", long.name, "--dir", str(long.parent)]) == 0
    assert "it was read thinned, at steps of " in capsys.readouterr().out


def test_a_thinned_run_keeps_its_span_its_peaks_and_its_events(long: Path) -> None:
    whole, thin = read_run(long), read_run(long, every_s=60.0)
    assert whole.pressure is not None
    assert thin.pressure is not None
    minutes = int(np.ceil(READINGS * 0.01 / 60.0)) + 1  # intervals count from 1970, not from the run's start
    assert minutes <= len(thin.pressure) <= 3 * minutes
    assert thin.pressure.pressure_pa.max() == whole.pressure.pressure_pa.max() == 5000.0
    assert thin.pressure.pressure_pa.min() == whole.pressure.pressure_pa.min() == -4000.0
    assert thin.pressure.time_s[0] == whole.pressure.time_s[0]
    assert whole.pressure.time_s[-1] - thin.pressure.time_s[-1] < 60.0
    assert set(thin.pressure.time_s) <= set(whole.pressure.time_s)
    assert thin.events == whole.events
    assert thin.lost == ("it was read thinned, at steps of 60 s",)
    assert thin.damage == ()
