"""Writes the MCAP format: zstd chunks with an index, CRCs on everything; independent of what the messages mean.

The mcap package's own Writer spends 5 us on a message, most of the price of a recording; this one a tenth of that. All
records but messages and their index are the package's. Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import tempfile
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
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

from straw.rig.mcap_source import MAGIC

SPOOLED_BYTES = 1 << 20  # of the chunks' index, about two hours of a run, before it goes to a file
CHUNK_BYTES = 1 << 20  # a chunk that grew larger is written without waiting for a flush
_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_MESSAGE_HEAD = 22  # bytes that count into a message's length, beside its data


class McapWriter:
    """One MCAP file on a binary stream; OSErrors of the stream are passed on, and the caller closes it."""

    def __init__(self, stream: IO[bytes], profile: str, library: str) -> None:
        self._stream = stream
        self._position = self._crc = 0
        self._compress = zstandard.ZstdCompressor(level=1).compress  # half the time of level 3, and no more bytes
        self._chunk = bytearray()
        self._index: defaultdict[int, list[int]] = defaultdict(list)  # by channel: log time, offset, log time, ...
        self._counts: Counter[int] = Counter()
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        # Two chunks a second for weeks would fill the memory with their index, which is needed only at the end.
        self._chunks = tempfile.SpooledTemporaryFile(SPOOLED_BYTES)  # noqa: SIM115  close() does
        self._chunk_count, self._last_ns = 0, 0
        self._first_ns: int | None = None
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
        """Pass everything so far to the operating system."""
        self._end_chunk()
        self._stream.flush()

    def finish(self) -> None:
        """Write the end of the data and the summary that readers use as an index."""
        self._end_chunk()
        self._write(_bytes(DataEnd(self._crc)))
        start, crc, offsets = self._position, 0, b""
        for opcode, pieces in self._summary():
            group = self._position
            for piece in pieces:
                self._write(piece)
                crc = zlib.crc32(piece, crc)
            if self._position > group:
                offsets += _bytes(SummaryOffset(opcode, group, self._position - group))
        places = start, self._position
        # The footer's checksum covers the footer up to itself.
        crc = zlib.crc32(struct.pack("<BQQQ", Opcode.FOOTER, 20, *places), zlib.crc32(offsets, crc))
        self._write(offsets + _bytes(Footer(*places, crc)) + MAGIC)
        self._stream.flush()
        self.close()

    def close(self) -> None:
        """Release what was kept for the summary, if the file is not finished; the stream is the caller's."""
        self._chunks.close()

    def _summary(self) -> Iterator[tuple[Opcode, Iterable[bytes]]]:
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=self._chunk_count,
            message_count=self._counts.total(),
            message_end_time=self._last_ns,
            message_start_time=self._first_ns or 0,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        yield Opcode.SCHEMA, map(_bytes, self._schemas)
        yield Opcode.CHANNEL, map(_bytes, self._channels)
        yield Opcode.STATISTICS, [_bytes(statistics)]
        self._chunks.seek(0)
        yield Opcode.CHUNK_INDEX, iter(partial(self._chunks.read, SPOOLED_BYTES), b"")
        yield Opcode.ATTACHMENT_INDEX, map(_bytes, self._attachments)
        yield Opcode.METADATA_INDEX, map(_bytes, self._metadata)

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
        index = ChunkIndex(
            **about,
            chunk_start_offset=start,
            chunk_length=len(record),
            message_index_offsets=places,
            message_index_length=len(indexes),
            compressed_size=len(packed),
        )
        self._chunks.write(_bytes(index))
        self._chunk_count += 1
        self._first_ns = min(times) if self._first_ns is None else min(self._first_ns, *times)
        self._last_ns = max(self._last_ns, *times)
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
