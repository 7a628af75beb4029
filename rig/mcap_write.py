"""Writes the MCAP format: zstd chunks with an index, CRCs on everything; knows nothing about runs.

The mcap package's own Writer spends 5 us on a message, most of the price of a recording; this one a tenth of that. All
records but messages and their index are the package's. Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter, defaultdict
from collections.abc import Mapping
from typing import IO, Any

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from rig.mcap_scan import MAGIC

CHUNK_BYTES = 1 << 20  # a chunk that grew larger is written without waiting for a flush
_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_MESSAGE_HEAD = 22  # bytes that count into a message's length, beside its data


class McapWriter:
    """One MCAP file on a binary stream; OSErrors of the stream come through, and it is the caller who closes it."""

    def __init__(self, stream: IO[bytes], profile: str, library: str) -> None:
        self._stream = stream
        self._position = self._crc = 0
        self._compress = zstandard.ZstdCompressor(level=1).compress  # half the time of level 3, and no more bytes
        self._chunk = bytearray()
        self._index: defaultdict[int, list[int]] = defaultdict(list)  # by channel: log time, offset, log time, ...
        self._counts: Counter[int] = Counter()
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._write(MAGIC + _bytes(Header(profile, library)))

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """The id of a new schema."""
        self._schemas.append(Schema(id=len(self._schemas) + 1, name=name, encoding=encoding, data=data))
        self._chunk += _bytes(self._schemas[-1])
        return self._schemas[-1].id

    def add_channel(self, topic: str, encoding: str, schema_id: int, metadata: Mapping[str, str]) -> int:
        """The id of a new channel; schema 0 is none."""
        number = len(self._channels) + 1
        channel = Channel(
            id=number, topic=topic, message_encoding=encoding, schema_id=schema_id, metadata=dict(metadata)
        )
        self._channels.append(channel)
        self._chunk += _bytes(channel)
        return number

    def add_message(self, channel_id: int, log_ns: int, publish_ns: int, data: bytes) -> None:
        """One message into the chunk, which is written at the next ``flush`` or when it is full."""
        chunk = self._chunk
        self._index[channel_id] += log_ns, len(chunk)
        chunk += _MESSAGE.pack(Opcode.MESSAGE, _MESSAGE_HEAD + len(data), channel_id, 0, log_ns, publish_ns)
        chunk += data
        if len(chunk) > CHUNK_BYTES:
            self._end_chunk()

    def add_metadata(self, name: str, record: Mapping[str, str]) -> None:
        """One metadata record, after what was flushed so far."""
        data = _bytes(Metadata(name=name, metadata=dict(record)))
        self._metadata.append(MetadataIndex(offset=self._position, length=len(data), name=name))
        self._write(data)

    def add_attachment(self, time_ns: int, name: str, media_type: str, content: bytes) -> None:
        """One attachment, after what was flushed so far."""
        about: dict[str, Any] = {"create_time": time_ns, "log_time": time_ns, "name": name, "media_type": media_type}
        data = _bytes(Attachment(**about, data=content))
        self._attachments.append(
            AttachmentIndex(**about, offset=self._position, length=len(data), data_size=len(content))
        )
        self._write(data)

    def flush(self) -> None:
        """Hand everything so far to the operating system."""
        self._end_chunk()
        self._stream.flush()

    def finish(self) -> None:
        """Write the end of the data and the summary by which readers find their way."""
        self._end_chunk()
        self._write(_bytes(DataEnd(self._crc)))
        start = self._position
        summary, offsets = b"", b""
        for opcode, records in self._summary().items():
            group = b"".join(map(_bytes, records))
            if group:
                offsets += _bytes(SummaryOffset(opcode, start + len(summary), len(group)))
                summary += group
        places = start, start + len(summary)
        summary += offsets
        # The footer's checksum covers the footer up to itself.
        crc = zlib.crc32(struct.pack("<BQQQ", Opcode.FOOTER, 20, *places), zlib.crc32(summary))
        self._write(summary + _bytes(Footer(*places, crc)) + MAGIC)
        self._stream.flush()

    def _summary(self) -> dict[Opcode, list[McapRecord]]:
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self._counts.total(),
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        return {
            Opcode.SCHEMA: [*self._schemas],
            Opcode.CHANNEL: [*self._channels],
            Opcode.STATISTICS: [statistics],
            Opcode.CHUNK_INDEX: [*self._chunks],
            Opcode.ATTACHMENT_INDEX: [*self._attachments],
            Opcode.METADATA_INDEX: [*self._metadata],
        }

    def _end_chunk(self) -> None:
        if not self._index:
            return
        packed = self._compress(self._chunk)
        times = [time_ns for entries in self._index.values() for time_ns in entries[::2]]
        about: dict[str, Any] = {
            "compression": "zstd",
            "message_start_time": min(times),
            "message_end_time": max(times),
            "uncompressed_size": len(self._chunk),
        }
        record = _bytes(Chunk(**about, data=packed, uncompressed_crc=zlib.crc32(self._chunk)))
        start, places, indexes = self._position, {}, b""
        for channel_id, entries in self._index.items():
            places[channel_id] = start + len(record) + len(indexes)
            size = 8 * len(entries)
            indexes += struct.pack(f"<BQHI{len(entries)}Q", Opcode.MESSAGE_INDEX, 6 + size, channel_id, size, *entries)
            self._counts[channel_id] += len(entries) // 2
        self._chunks.append(
            ChunkIndex(
                **about,
                chunk_start_offset=start,
                chunk_length=len(record),
                message_index_offsets=places,
                message_index_length=len(indexes),
                compressed_size=len(packed),
            )
        )
        self._chunk.clear()
        self._index.clear()
        self._write(record + indexes)

    def _write(self, data: bytes) -> None:
        self._stream.write(data)
        self._position += len(data)
        self._crc = zlib.crc32(data, self._crc)


def _bytes(record: McapRecord) -> bytes:
    builder: Any = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())
