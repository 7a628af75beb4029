"""Damaged recordings: what is on disk is read, what is lost is reported, and only RigErrors are raised."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from straw.rig.errors import RigError
from straw.rig.run import Run
from straw.rig.run_file import RunFile
from straw.rig.run_read import read_run
from straw.rig.schema import encode

ZERO_NS = 1_795_000_000_000_000_000
METADATA = {
    "run_id": "r1",
    "specimen": "s1",
    "initial_deployed": "1,4",
    "cycle": "3",
    "cells": "9",
    "zero_time_ns": str(ZERO_NS),
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Five chunks of noise, as a live run makes them."""
    path = tmp_path_factory.mktemp("whole") / "run.mcap"
    file = RunFile(path, METADATA, {"protocol.toml": b"name = 'a protocol'"})
    noise = np.random.default_rng(0).standard_normal((5, 40))
    for chunk in range(5):
        for i in range(40):
            at_ns = ZERO_NS + (chunk * 40 + i) * 10_000_000
            file.add("/pressure/measured", at_ns, encode("/pressure/measured", at_ns, {"pressure_pa": noise[chunk, i]}))
        file.flush()
    file.finish({"exit_status": "success"})
    return path.read_bytes()


def read_bytes(data: bytes, folder: Path) -> Run | None:
    """The run, or None for a RigError of one line; anything else is a failure of the test."""
    path = folder / "damaged.mcap"
    path.write_bytes(data)
    try:
        return read_run(path)
    except RigError as error:
        message = str(error)
    assert "\n" not in message
    assert str(path) in message
    return None


def _nth(data: bytes, mark: bytes, n: int) -> int:
    position = data.index(mark)
    for _ in range(n):
        position = data.index(mark, position + 1)
    return position


def pressures(run: Run | None) -> list[float]:
    return [] if run is None or run.pressure is None else run.pressure.pressure_pa.tolist()


def test_a_file_cut_anywhere_gives_the_data_before_the_cut(whole: bytes, tmp_path: Path) -> None:
    truth = pressures(read_bytes(whole, tmp_path))
    assert len(truth) == 200
    counts = []
    for cut in [*range(0, 1200, 7), *range(1200, len(whole), 41)]:
        run = read_bytes(whole[:cut], tmp_path)
        found = pressures(run)
        assert found == truth[: len(found)]
        assert run is None or any("never finished" in line for line in run.lost)
        assert run is None or run.zero_time_ns == ZERO_NS
        counts.append(len(found))
    assert counts == sorted(counts)
    assert set(counts) == {0, 40, 80, 120, 160, 200}


def test_a_flipped_bit_is_reported_or_changes_nothing(whole: bytes, tmp_path: Path) -> None:
    truth = read_bytes(whole, tmp_path)
    assert truth is not None
    assert truth.lost == ()
    chance = random.Random(1)
    silent = 0
    for _ in range(600):
        damaged = bytearray(whole)
        damaged[chance.randrange(len(whole))] ^= 1 << chance.randrange(8)
        run = read_bytes(bytes(damaged), tmp_path)
        if run is not None and not run.lost:
            silent += 1
            assert pressures(run) == pressures(truth)
            assert run.metadata == truth.metadata
            assert run.attachments == truth.attachments
    assert silent < 300  # flips in the index at the end do no harm; most of the file is data


def test_one_damaged_chunk_loses_only_its_own_data(whole: bytes, tmp_path: Path) -> None:
    truth = pressures(read_bytes(whole, tmp_path))
    for chunk in range(5):
        damaged = bytearray(whole)
        damaged[_nth(whole, b"\x28\xb5\x2f\xfd", chunk) + 100] ^= 0xFF  # the magic number of zstd starts each chunk
        run = read_bytes(bytes(damaged), tmp_path)
        assert pressures(run) == truth[: 40 * chunk] + truth[40 * chunk + 40 :]
        assert run is not None
        assert len(run.lost) == 2  # the chunk's own checksum and the file's


def test_random_bytes_after_a_valid_beginning_raise_only_rig_errors(whole: bytes, tmp_path: Path) -> None:
    chance = random.Random(2)
    for _ in range(200):
        start = chance.randrange(8, len(whole))
        length = chance.choice([1, 8, 64, 512])
        data = whole[:start] + chance.randbytes(length) + whole[start + length :]
        run = read_bytes(data, tmp_path)
        assert run is None or run.lost or pressures(run)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "is empty"),
        (b"\x89MCAP", "not an MCAP"),
        (b"time,pressure\n0,1\n", "not an MCAP"),
        (b"\x89MCAP0\r\n", "holds no message"),
        (b"\x89MCAP0\r\n" + b"\xff" * 100, "holds no message"),
    ],
)
def test_a_file_that_is_no_recording_is_refused_in_one_line(content: bytes, word: str, tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(RigError, match=word) as caught:
        read_run(tmp_path / "a.mcap")
    assert "\n" not in str(caught.value)


def test_a_missing_recording_is_reported_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(RigError, match=r"missing\.mcap cannot be read"):
        read_run(tmp_path / "missing.mcap")


def test_a_folder_in_place_of_a_recording_is_reported_with_the_pattern_of_its_files(tmp_path: Path) -> None:
    with pytest.raises(RigError, match=r"is a folder; give its files, as .*\*\.mcap$"):
        read_run(tmp_path)


def test_recordings_of_another_logger_survive_being_cut(recordings: Path, tmp_path: Path) -> None:
    data = next(recordings.glob("*/pulses.mcap")).read_bytes()
    for cut in range(0, len(data), len(data) // 40):
        run = read_bytes(data[:cut], tmp_path)
        assert run is None or run.lost


@pytest.mark.skipif(os.name != "posix", reason="kills with SIGKILL")
def test_a_writer_that_is_killed_loses_less_than_its_last_second(tmp_path: Path) -> None:
    script = f"""
import os, sys, time
from straw.rig.run_write import RunWriter
writer = RunWriter(sys.argv[1], {METADATA!r}, {{"protocol.toml": b"x"}})
while True:
    now_ns = time.time_ns()
    writer.add("/pressure/measured", now_ns, pressure_pa=1.0)
    os.write(1, now_ns.to_bytes(8, "little"))
    time.sleep(0.005)
"""
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    names = [f"run{k}.mcap" for k in range(3)]
    writers = [
        subprocess.Popen([sys.executable, "-c", script, name], cwd=tmp_path, env=environment, stdout=subprocess.PIPE)
        for name in names
    ]
    last_ns = []
    for k, writer in enumerate(writers):
        assert writer.stdout is not None
        writer.stdout.read(8)
        time.sleep(1.2 if k == 0 else 0.2)  # at different instants between two flushes
        writer.kill()
        assert writer.wait() == -signal.SIGKILL
        last_ns.append(int.from_bytes(writer.stdout.read()[-8:], "little"))
        writer.stdout.close()
    for name, sent_ns in zip(names, last_ns, strict=True):
        run = read_run(tmp_path / f"{name}.part")
        assert not (tmp_path / name).exists()
        assert run.attachments == {"protocol.toml": b"x"}
        assert (run.specimen, run.initial_deployed) == ("s1", (1, 4))
        assert run.pressure is not None
        assert (sent_ns - (ZERO_NS + run.pressure.time_s[-1] * 1e9)) * 1e-9 <= 1.0
        assert len(run.pressure) > 50
