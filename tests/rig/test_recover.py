"""A run that was killed, cut, damaged or ended by a full disk is recovered, with a report of what was lost."""

import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader

from straw.rig.emulate import Emulation
from straw.rig.errors import RigError
from straw.rig.recover import recover
from straw.rig.run_file import RunFile
from straw.rig.run_read import read_run
from straw.rig.schema import encode

ZERO_NS = 1_795_000_000_000_000_000
METADATA = {"run_id": "r1", "specimen": "s1", "initial_deployed": "1,4", "cycle": "3", "cells": "9"}
SECONDS = 30


def recording(path: Path) -> Path:
    """A run of thirty seconds with one chunk per second, as a live run writes it."""
    file = RunFile(path, {**METADATA, "zero_time_ns": str(ZERO_NS)}, {"protocol.toml": b"name = 'p'"})
    noise = random.Random(0)
    for second in range(SECONDS):
        for k in range(100):
            at_ns = ZERO_NS + second * 10**9 + k * 10**7
            data = encode("/pressure/measured", at_ns, {"pressure_pa": noise.gauss(0, 1), "sigma_pa": 30.0})
            file.add("/pressure/measured", at_ns, data, log_time_ns=at_ns + 1000)
        file.flush()
    file.finish({"exit_status": "success"})
    return path


def test_a_part_file_is_recovered_as_its_run_with_everything_that_was_flushed(tmp_path: Path) -> None:
    data = recording(tmp_path / "whole.mcap").read_bytes()
    part = tmp_path / "run.mcap.part"
    part.write_bytes(data[: len(data) * 2 // 3])
    done = recover(part)
    assert done.path == tmp_path / "run.mcap"
    assert part.exists()
    whole, run = read_run(tmp_path / "whole.mcap"), read_run(done.path)
    assert run.damage == ()
    assert run.pressure is not None
    assert whole.pressure is not None
    n = len(run.pressure)
    assert n == done.messages >= 100 * (SECONDS * 2 // 3 - 1)
    assert run.pressure.pressure_pa.tolist() == whole.pressure.pressure_pa[:n].tolist()
    assert run.attachments == whole.attachments
    assert (run.run_id, run.specimen, run.initial_deployed) == ("r1", "s1", (1, 4))
    assert run.metadata["exit_status"] == "fail"
    assert "never finished" in run.metadata["recovered_lost"]
    with done.path.open("rb") as stream:  # and every other reader accepts it
        messages = list(make_reader(stream, validate_crcs=True).iter_messages())
    assert len(messages) == n
    assert all(message.log_time == message.publish_time + 1000 for *_, message in messages)


def test_a_file_damaged_in_the_middle_keeps_the_data_before_and_after(tmp_path: Path) -> None:
    path = recording(tmp_path / "run.mcap")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    done = recover(path)
    assert done.path.name == "run.recovered.mcap"
    run = read_run(done.path)
    assert run.pressure is not None
    assert len(run.pressure) == 100 * (SECONDS - 1)
    assert run.metadata["exit_status"] == "success"
    assert any("fails its checksum" in line for line in done.lost)


def test_a_file_that_needs_no_recovery_or_allows_none_is_one_line(tmp_path: Path) -> None:
    path = recording(tmp_path / "run.mcap")
    with pytest.raises(RigError, match="is whole: nothing to recover"):
        recover(path)
    part = tmp_path / "run.mcap.part"
    part.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(RigError, match="exists and is not overwritten"):
        recover(part)
    with pytest.raises(RigError, match="cannot be read"):
        recover(tmp_path / "missing.part")
    part.write_bytes(b"\x89MCAP0\r\n" + b"\xff" * 100)
    with pytest.raises(RigError, match="holds no message that can be read"):
        recover(part)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.mcap", "run.mcap.part"]


SCRIPT = """
import resource, sys
from straw.rig.guarded import GuardedController
from straw.rig.protocol_toml import protocol_from_toml
from straw.rig.session import run_protocol
protocol = protocol_from_toml('pressure_unit = "kPa"\\ninitial_deployed=[]\\nmain = [{ hold = -25, for_s = 60 }]', "p")
with GuardedController("ob1-mk4", sys.argv[1]) as controller:
    limit = int(sys.argv[3])
    if limit:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    run_protocol(controller, protocol, sys.argv[2])
"""


def started(emulation: Emulation, path: Path, limit: int = 0) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT, emulation.url, str(path), str(limit)],
        stderr=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[2],
    )


@pytest.mark.skipif(os.name != "posix", reason="limits the size of files, which stands for a full disk, by POSIX means")
def test_when_the_disk_fills_up_the_run_vents_and_ends_and_keeps_what_was_written(
    emulation: Emulation, tmp_path: Path
) -> None:
    process = started(emulation, tmp_path / "run.mcap", limit=12_000)
    _, said = process.communicate(timeout=40)
    assert process.returncode == 1
    assert "cannot be written: File too large; check space" in said
    assert f"what was recorded is kept in {tmp_path / 'run.mcap.part'}" in said
    sets = [line for _, line in emulation.wire.received if line.startswith(b"<PRESS!")]
    assert sets[-2:].count(b"<PRESS!:0:0\n") == 2  # the session's vent, and the controller's on closing
    assert b"<PRESS!:0:-250\n" in sets
    done = recover(tmp_path / "run.mcap.part")
    run = read_run(done.path)
    assert run.damage == ()
    assert run.pressure is not None
    assert len(run.pressure) > 50


@pytest.mark.skipif(os.name != "posix", reason="kills with SIGKILL")
def test_a_killed_session_loses_less_than_its_last_second_and_is_recovered_with_the_guardians_vent_in_it(
    emulation: Emulation, tmp_path: Path
) -> None:
    process = started(emulation, tmp_path / "run.mcap")
    part, note = tmp_path / "run.mcap.part", tmp_path / "run.mcap.guardian"
    deadline = time.monotonic() + 20.0
    while not (part.exists() and part.stat().st_size > 8000):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.kill()
    process.communicate()
    while not (note.exists() and '"vent"' in note.read_text()):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    run = read_run(recover(part).path)
    assert run.pressure is not None
    asked_s = max(at_s for at_s, line in emulation.wire.received if line == b"<PINGA?\n")
    last_s = run.pressure.time_s[-1] + (run.zero_time_ns - emulation.twin.zero_wall_ns) * 1e-9
    assert asked_s - last_s <= 1.0
    kinds = [event.kind for event in run.events]
    assert kinds[-2:] == ["guardian", "vent"]
    assert "confirmed" in run.events[-1].text
    assert run.metadata["guardian"] == "heartbeat 2 s"
