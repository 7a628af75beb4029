"""Unpacks the records of an MCAP file that state the size of what is in them: chunks and attachments."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import Any

from straw.rig.errors import RigError
from straw.rig.mcap_source import Source

HEAD = struct.Struct("<BQ")  # opcode, length
_CHUNK = struct.Struct("<QQQII")  # first and last time, size unpacked, its checksum, length of the compression's name


def in_chunk(source: Source, length: int, position: int) -> Iterator[tuple[int, bytes]]:
    """Yield the records in a chunk as (opcode, payload); RigError, or whatever damage surfaces as, where it is broken.

    ``source`` is behind the head of the chunk, which is ``length`` bytes long and begins at ``position``.
    """
    _, _, size, crc, name_length = _CHUNK.unpack(source.read(min(_CHUNK.size, length)))
    if _CHUNK.size + name_length + 8 > length:
        raise ValueError("impossible length")
    compression = source.read(name_length).decode()
    packed = int.from_bytes(source.read(8), "little")
    if _CHUNK.size + name_length + 8 + packed > length:
        raise ValueError("impossible length")
    data = _unpacked(source.read(packed), compression, size, position)
    if crc and zlib.crc32(data) != crc:
        raise RigError(f"the chunk at byte {position} fails its checksum: its messages were left out")
    inside, end = 0, len(data)
    while inside < end:
        opcode, length = HEAD.unpack_from(data, inside)
        inside += HEAD.size + length
        if inside > end:
            raise RigError(f"the chunk at byte {position} ends inside a record: the rest of it was left out")
        yield opcode, data[inside - length : inside]


def _unpacked(data: bytes, compression: str, size: int, position: int) -> bytes:
    if compression == "zstd":
        import zstandard

        return bytes(zstandard.decompress(data, max_output_size=size))
    if compression == "lz4":
        import lz4.frame  # type: ignore[import-untyped]

        return bytes(lz4.frame.decompress(data))
    if compression == "":
        return data
    raise RigError(f"the chunk at byte {position} is packed with {compression!r}, which is not supported")


def attachment(source: Source, length: int) -> tuple[str, bytes]:
    """Return name and content of an attachment, as ``in_chunk`` otherwise; the mcap package never checks its checksum.

    A record may be longer than what is in it.
    """
    from mcap.records import Attachment

    parts = [source.read(16)]  # its times; then name and media type with their lengths, and the length of the data
    for size in (4, 4, 8):
        parts.append(source.read(size))
        held = int.from_bytes(parts[-1], "little")
        if sum(map(len, parts)) + held > length:
            raise ValueError("impossible length")
        parts.append(source.read(held))
    payload, crc = b"".join(parts), source.read(4)
    if any(crc) and int.from_bytes(crc, "little") != zlib.crc32(payload):
        raise RigError("an attachment fails its checksum and was left out")
    record = Attachment.read(stream_of(payload + crc))
    return record.name, record.data


def stream_of(payload: bytes) -> Any:
    """Return bytes as the mcap package reads them."""
    from mcap.data_stream import ReadDataStream

    return ReadDataStream(BytesIO(payload))
