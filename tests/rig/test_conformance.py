"""All files of MCAP's conformance suite are read correctly: whole, cut at every record, and with any bit flipped."""

from __future__ import annotations

import hashlib
import io
import struct
from functools import cache
from pathlib import Path

import pytest

from straw.rig.errors import RigError
from straw.rig.mcap_scan import Scan, scan_stream
from straw.rig.run_read import read_run
from tests.rig.mcap_conformance import DIGEST, INPUTS, TIMES, conformance_files


@cache
def files() -> dict[str, bytes]:
    return dict(conformance_files())


def scan(data: bytes, name: str) -> tuple[Scan, list[tuple[int, int, bytes]]]:
    """The records of a file, and its messages."""
    messages: list[tuple[int, int, bytes]] = []
    found = scan_stream(io.BytesIO(data), name, lambda channel, ns, message, _: messages.append((channel, ns, message)))
    assert sum(found.counts.values()) == len(messages)
    assert found.sha256 == hashlib.sha256(data).hexdigest()
    return found, messages


def holds(found: Scan, messages: list[tuple[int, int, bytes]]) -> tuple[object, ...]:
    """Everything in a file, for comparison."""
    return messages, found.metadata, found.attachments, {c.id: c.topic for c in found.channels.values()}


def test_the_files_are_those_of_the_suite_byte_for_byte() -> None:
    assert len(files()) == 416
    lines = sorted(f"{name}.mcap {hashlib.sha256(data).hexdigest()}" for name, data in files().items())
    assert hashlib.sha256("\n".join(lines).encode()).hexdigest() == DIGEST


@pytest.mark.parametrize("base", INPUTS)
def test_every_file_is_read_whole(base: str) -> None:
    for name, data in files().items():
        if name.split("-")[0] != base:
            continue
        found, messages = scan(data, name)
        assert found.lost == [], name
        # publish time where it is known; this suite's times of 0 mean "not known"
        sent = {"TenMessages": list(TIMES), "OneMessage": [1], "OneSchemalessMessage": [1]}.get(base, [])
        assert messages == [(1, t, b"\x01\x02\x03") for t in sent], name
        assert found.metadata == ({"myMetadata": {"foo": "bar"}} if base == "OneMetadata" else {}), name
        assert found.attachments == ({"myFile": b"\x01\x02\x03"} if base == "OneAttachment" else {}), name


def test_a_file_that_is_no_mcap_is_refused_in_one_line(tmp_path: Path) -> None:
    for name, data in files().items():
        path = tmp_path / f"{name}.mcap"
        path.write_bytes(data)
        with pytest.raises(RigError, match="holds no message of a straw run") as caught:
            read_run(path)
        assert "\n" not in str(caught.value)


def test_a_file_cut_at_any_record_is_reported_as_cut_and_gives_what_came_before() -> None:
    cuts = 0
    for name, data in files().items():
        before: list[object] = []
        for cut in _record_ends(data)[:-1]:
            found, messages = scan(data[:cut], name)
            assert any("never finished" in line for line in found.lost), (name, cut)
            assert messages[: len(before)] == before, (name, cut)
            before = list(messages)
            cuts += 1
    assert cuts > 416 * 3


def test_a_flipped_bit_is_reported_or_changes_nothing() -> None:
    """Every bit of a file of each kind with and without chunks; flips after the data are in the index: harmless."""
    chosen = [name for name in files() if "-" not in name or name.endswith(("-ch", "-ch-pad"))]
    silent = total = 0
    for name in chosen:
        data = files()[name]
        truth = holds(*scan(data, name))
        for bit in range(8 * len(data)):
            damaged = bytearray(data)
            damaged[bit // 8] ^= 1 << bit % 8
            total += 1
            try:
                found, messages = scan(bytes(damaged), name)
            except RigError:
                continue
            if not found.lost:
                silent += 1
                assert holds(found, messages) == truth, (name, bit)
    assert silent < total / 2


def _record_ends(data: bytes) -> list[int]:
    ends, position = [8], 8
    while position < len(data) - 8:
        position += 9 + int(struct.unpack_from("<Q", data, position + 1)[0])
        ends.append(position)
    return ends
