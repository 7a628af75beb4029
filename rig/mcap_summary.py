"""Reads what the end of an MCAP file says of its contents: how many messages of which topic, over which time."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from straw.rig.mcap_source import MAGIC
from straw.rig.mcap_unpack import HEAD, stream_of

_FOOTER = struct.Struct("<BQQQI")  # opcode, length, start of the summary and of its offsets, checksum
_OFFSET = struct.Struct("<BQBQQ")  # opcode, length, opcode of a group, its start and length
CHANNEL, STATISTICS = 0x04, 0x0B
_BLOCK = 1 << 20
_LONGEST = 1 << 24  # bytes of channels and statistics; more is damage


@dataclass(frozen=True)
class Summary:
    """Messages by topic, and the time from the first to the last."""

    counts: dict[str, int]
    span_s: float


def summary_of(path: Path) -> Summary | None:
    """The summary of a finished file, if it has one that passes its checksum; None otherwise, and for other files."""
    try:
        with path.open("rb") as stream:
            return _summary(stream)
    except Exception:  # whatever is wrong with it is said by those who read all of the file
        return None


def _summary(stream: IO[bytes]) -> Summary | None:
    end = stream.seek(0, 2) - len(MAGIC) - _FOOTER.size
    stream.seek(end)
    footer = stream.read(_FOOTER.size)
    _, _, start, offsets, crc = _FOOTER.unpack(footer)
    if stream.read() != MAGIC or not 0 < start <= offsets <= end:
        return None
    stream.seek(offsets)
    listed = stream.read(min(end - offsets, _LONGEST))
    groups = {kind: (at, size) for _, _, kind, at, size in _OFFSET.iter_unpack(listed)}
    if not {CHANNEL, STATISTICS} <= groups.keys() or crc != _crc(stream, start, end, footer[:-4]):
        return None
    from mcap.records import Channel, Statistics

    topics = {one.id: one.topic for one in map(Channel.read, map(stream_of, _group(stream, *groups[CHANNEL])))}
    said = Statistics.read(stream_of(_group(stream, *groups[STATISTICS])[0]))
    counts: Counter[str] = Counter()
    for channel_id, count in said.channel_message_counts.items():
        counts[topics[channel_id]] += count
    return Summary(counts, (said.message_end_time - said.message_start_time) * 1e-9)


def _group(stream: IO[bytes], at: int, size: int) -> list[bytes]:
    """The contents of the records of a group."""
    stream.seek(at)
    data, position, found = stream.read(min(size, _LONGEST)), 0, []
    while position < len(data):
        _, length = HEAD.unpack_from(data, position)
        position += HEAD.size + length
        found.append(data[position - length : position])
    return found


def _crc(stream: IO[bytes], start: int, end: int, footer: bytes) -> int:
    stream.seek(start)
    crc, left = 0, end - start
    while left > 0:
        data = stream.read(min(_BLOCK, left))
        crc, left = zlib.crc32(data, crc), left - len(data) if data else 0
    return zlib.crc32(footer, crc)
