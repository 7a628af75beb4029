"""Scans the bytes of an MCAP file, whole or damaged: all that is intact, and a description of what is lost."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError
from straw.rig.schema import LAST_NS

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK, ATTACHMENT, METADATA, DATA_END = 0x03, 0x04, 0x05, 0x06, 0x09, 0x0C, 0x0F


@dataclass
class Scan:
    """What a file holds: messages as (channel id, happened ns, data, logged ns), and in words what of it is lost."""

    schemas: dict[int, Any] = field(default_factory=dict)
    channels: dict[int, Any] = field(default_factory=dict)
    messages: list[tuple[int, int, bytes, int]] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)


def read_bytes(path: Path) -> bytes:
    """All bytes of a recording; RigError when it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise RigError(f"recording {path} cannot be read: {error.strerror or error}; check the name") from None


def scan(data: bytes, name: str) -> Scan:
    """Read all records in the order of the file; RigError only when it is no MCAP at all.

    The mcap package's readers give nothing of a truncated file, accept a record that was cut short, and leak half a
    dozen foreign exceptions (measured), so the framing is done here: a record counts only when all of it is there.
    """
    if not data:
        raise RigError(f"recording {name} is empty (0 bytes); the program that wrote it was killed before it could")
    if data[:8] != MAGIC[: len(data)] or len(data) < 8:
        raise RigError(f"recording {name} is not an MCAP file; give a .mcap recording of a run")
    found = Scan()
    finished = data.endswith(MAGIC) and len(data) > 16
    position, seen_end = 8, False
    while position < len(data) - (8 if finished else 0):
        if len(data) - position < 9:
            break
        opcode, length = struct.unpack_from("<BQ", data, position)
        start, end = position + 9, position + 9 + length
        if end > len(data):
            break
        if opcode == DATA_END:
            seen_end = True
            crc = int.from_bytes(data[start : start + 4], "little")
            if crc and crc != zlib.crc32(memoryview(data)[:position]):
                found.lost.append("the file fails its checksum: some bytes were changed after it was written")
        else:
            _take(found, opcode, data[start:end], position, depth=0)
        position = end
    if not (finished and seen_end):
        found.lost.append(f"the file was never finished: it ends at byte {len(data)}, what came after is lost")
    return found


def _take(found: Scan, opcode: int, payload: bytes, position: int, depth: int) -> None:
    """Add one whole record to what was found; a damaged one is named, and the rest goes on."""
    try:
        if opcode == MESSAGE:
            channel_id, _, log_ns, publish_ns = struct.unpack_from("<HIQQ", payload)
            happened_ns = publish_ns or log_ns  # loggers that do not know the publish time write 0
            if happened_ns > LAST_NS:
                raise ValueError("impossible time")
            found.messages.append((channel_id, happened_ns, payload[22:], log_ns))
        elif opcode == CHUNK and depth == 0:
            _take_chunk(found, payload, position)
        elif opcode in _PARSERS:
            _PARSERS[opcode](found, payload)
    except RigError as error:
        found.lost.append(str(error))
    except Exception as error:  # damage surfaces as struct, zstd, key, unicode, runtime ... errors: all mean the same
        found.lost.append(f"a record at byte {position} is damaged ({type(error).__name__}) and was left out")


def _take_chunk(found: Scan, payload: bytes, position: int) -> None:
    from mcap.records import Chunk

    chunk = Chunk.read(_stream(payload))
    if chunk.compression == "zstd":
        import zstandard

        data = zstandard.decompress(chunk.data, max_output_size=chunk.uncompressed_size)
    elif chunk.compression == "lz4":
        import lz4.frame  # type: ignore[import-untyped]

        data = lz4.frame.decompress(chunk.data)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise RigError(f"the chunk at byte {position} is packed with {chunk.compression!r}, which is not supported")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise RigError(f"the chunk at byte {position} fails its checksum: its messages were left out")
    inside = 0
    while inside < len(data):
        opcode, length = struct.unpack_from("<BQ", data, inside)
        record = data[inside + 9 : inside + 9 + length]
        if len(record) < length:
            raise RigError(f"the chunk at byte {position} ends inside a record: the rest of it was left out")
        _take(found, opcode, record, position, depth=1)
        inside += 9 + length


def _schema(found: Scan, payload: bytes) -> None:
    from mcap.records import Schema

    record = Schema.read(_stream(payload))
    found.schemas.setdefault(record.id, record)  # the first stands in a chunk with a checksum, repeats need not


def _channel(found: Scan, payload: bytes) -> None:
    from mcap.records import Channel

    record = Channel.read(_stream(payload))
    found.channels.setdefault(record.id, record)


def _metadata(found: Scan, payload: bytes) -> None:
    from mcap.records import Metadata

    record = Metadata.read(_stream(payload))
    found.metadata.setdefault(record.name, {}).update(record.metadata)


def _attachment(found: Scan, payload: bytes) -> None:
    from mcap.records import Attachment

    stream = _stream(payload)
    record = Attachment.read(stream)
    end = stream.count - 4  # a record may be longer than what is in it
    crc = int.from_bytes(payload[end : end + 4], "little")  # the mcap package never checks it
    if crc and crc != zlib.crc32(payload[:end]):
        raise RigError("an attachment fails its checksum and was left out")
    found.attachments[record.name] = record.data


_PARSERS: dict[int, Callable[[Scan, bytes], None]] = {
    SCHEMA: _schema,
    CHANNEL: _channel,
    METADATA: _metadata,
    ATTACHMENT: _attachment,
}


def _stream(payload: bytes) -> Any:
    from mcap.data_stream import ReadDataStream

    return ReadDataStream(BytesIO(payload))
