"""Scans an MCAP file, whole or damaged, a record at a time: all that is intact, and a description of what is lost."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, TypeAlias

from straw.rig.errors import RigError
from straw.rig.mcap_source import MAGIC, Source
from straw.rig.mcap_unpack import HEAD, attachment, in_chunk, stream_of
from straw.rig.schema import LAST_NS

SCHEMA, CHANNEL, MESSAGE, CHUNK, ATTACHMENT, METADATA, DATA_END = 0x03, 0x04, 0x05, 0x06, 0x09, 0x0C, 0x0F
#: What is done with each message: (channel id, happened ns, data, logged ns).
Take: TypeAlias = Callable[[int, int, bytes, int], None]
#: Longest record, beside chunks and attachments, which state their size twice: more is a damaged length.
LONGEST_BYTES = 1 << 28
#: Sentences on what is lost; damage beyond is counted.
MOST_LOST = 1000
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time


@dataclass
class Scan:
    """What a file holds beside its messages, how many those are by channel, and in words what is lost."""

    schemas: dict[int, Any] = field(default_factory=dict)
    channels: dict[int, Any] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    unsaid: int = 0  # faults beyond MOST_LOST
    size: int = 0
    position: int = 0  # while it is read
    sha256: str = ""

    def lose(self, what: str) -> None:
        """Note what is lost."""
        if len(self.lost) < MOST_LOST:
            self.lost.append(what)
        else:
            self.unsaid += 1


def read_bytes(path: Path) -> bytes:
    """All bytes of a file; RigError when it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise _unreadable(path, error) from None


def scan(path: Path, take: Take | None = None, found: Scan | None = None) -> Scan:
    """Read all records in the order of the file, of which one is in memory at a time; ``take`` gets the messages.

    What is returned, or ``found`` where ``take`` wants to see it, is filled meanwhile. RigError only when the file
    cannot be read, or is no MCAP at all.
    """
    found = Scan() if found is None else found
    _opened(path, lambda stream: scan_stream(stream, str(path), take, found))
    return found


def messages(path: Path, found: Scan, take: Take) -> None:
    """Pass the messages of a file that was scanned to ``take``, as many bytes as it had then."""
    _opened(path, lambda stream: _records(Scan(), Source(stream, found.size, digest=False), take))


def scan_stream(stream: IO[bytes], name: str, take: Take | None = None, found: Scan | None = None) -> Scan:
    """``scan`` of an open file.

    The mcap package's readers give nothing of a truncated file, accept a record that was cut short, and leak half a
    dozen foreign exceptions (measured), so the framing is done here: a record counts only when all of it is there.
    """
    source, found = Source(stream), Scan() if found is None else found
    found.size = source.size
    if not source.size:
        raise RigError(f"recording {name} is empty (0 bytes); the program that wrote it was killed before it could")
    if not _records(found, source, take):
        raise RigError(f"recording {name} is not an MCAP file; give a .mcap recording of a run")
    found.sha256 = source.sha256()
    if found.unsaid:
        found.lost.append(f"{found.unsaid} more parts are damaged")
    return found


def _opened(path: Path, read: Callable[[IO[bytes]], object]) -> None:
    try:
        with path.open("rb") as stream:
            read(stream)
    except OSError as error:
        raise _unreadable(path, error) from None


def _unreadable(path: Path, error: OSError) -> RigError:
    if isinstance(error, IsADirectoryError) or path.is_dir():  # Windows reports a folder as a denied permission
        return RigError(f"recording {path} is a folder; give its files, as {path / '*.mcap'}")
    return RigError(f"recording {path} cannot be read: {error.strerror or error}; check the name")


def _records(found: Scan, source: Source, take: Take | None) -> bool:
    """Read all records; whether the file begins as one that has some."""
    if source.read(len(MAGIC)) != MAGIC:
        return False
    seen_end, behind = False, len(MAGIC) if source.finished else 0
    while source.left >= behind + HEAD.size:
        position, crc = source.position, source.crc
        opcode, length = HEAD.unpack(source.read(HEAD.size))
        end, found.position = source.position + length, position
        if end > source.size:
            break
        if opcode == DATA_END:
            seen_end = True
            stated = int.from_bytes(source.read(min(length, 4)), "little")
            if stated and stated != crc:
                found.lose("the file fails its checksum: some bytes were changed after it was written")
        else:
            _record(found, opcode, source, length, position, take)
        source.skip(end - source.position)
    if not (source.finished and seen_end):
        found.lose(f"the file was never finished: it ends at byte {source.size}, what came after is lost")
    return True


def _record(found: Scan, opcode: int, source: Source, length: int, position: int, take: Take | None) -> None:
    """Add one whole record, or those in a chunk, to what was found; a damaged one is named, and the rest goes on."""
    inner = _inner(found, opcode, source, length, position)
    while True:
        try:
            opcode, payload = next(inner)
        except StopIteration:
            return
        except RigError as error:
            found.lose(str(error))
            return
        except OSError:
            raise
        except (
            Exception
        ) as error:  # damage surfaces as struct, zstd, key, unicode, runtime ... errors: all mean the same
            _damaged(found, position, error)
            return
        try:
            if opcode != MESSAGE:
                if opcode in _PARSERS:
                    _PARSERS[opcode](found, payload)
                continue
            channel_id, happened_ns, log_ns = _message(payload)
        except Exception as error:
            _damaged(found, position, error)
            continue
        found.counts[channel_id] += 1
        if take:  # outside of all that is forgiven: its errors are its caller's
            take(channel_id, happened_ns, payload[_MESSAGE.size :], log_ns)


def _message(payload: bytes) -> tuple[int, int, int]:
    """Channel, and when the message happened and was logged (ns)."""
    channel_id, _, log_ns, publish_ns = _MESSAGE.unpack_from(payload)
    happened_ns = publish_ns or log_ns  # loggers that do not know the publish time write 0
    if happened_ns > LAST_NS:
        raise ValueError("impossible time")
    return channel_id, happened_ns, log_ns


def _damaged(found: Scan, position: int, error: Exception) -> None:
    found.lose(f"a record at byte {position} is damaged ({type(error).__name__}) and was left out")


def _inner(found: Scan, opcode: int, source: Source, length: int, position: int) -> Iterator[tuple[int, bytes]]:
    """Yield records as (opcode, payload), of a chunk those in it; attachments are added at once."""
    if opcode == CHUNK:
        yield from in_chunk(source, length, position)
    elif opcode == ATTACHMENT:
        name, data = attachment(source, length)
        found.attachments[name] = data
    elif opcode == MESSAGE or opcode in _PARSERS:
        if length > LONGEST_BYTES:
            raise ValueError("impossible length")
        yield opcode, source.read(length)


def _schema(found: Scan, payload: bytes) -> None:
    from mcap.records import Schema

    record = Schema.read(stream_of(payload))
    found.schemas.setdefault(record.id, record)  # the first stands in a chunk with a checksum, repeats need not


def _channel(found: Scan, payload: bytes) -> None:
    from mcap.records import Channel

    record = Channel.read(stream_of(payload))
    found.channels.setdefault(record.id, record)


def _metadata(found: Scan, payload: bytes) -> None:
    from mcap.records import Metadata

    record = Metadata.read(stream_of(payload))
    found.metadata.setdefault(record.name, {}).update(record.metadata)


_PARSERS: dict[int, Callable[[Scan, bytes], None]] = {SCHEMA: _schema, CHANNEL: _channel, METADATA: _metadata}
