"""Writes recordings: a file that is never half there, and a queue before it so that a live loop never waits."""

from __future__ import annotations

import os
import queue
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rig.errors import RigError
from rig.manifest import seal
from rig.provenance import software
from rig.reading import Command, Reading
from rig.schema import check, descriptor_set, encode, schema_of

WAKE_S = 0.1
FLUSH_S = 0.9  # with WAKE_S what a killed program may lose at most, a second: a chunk that was never flushed is gone
LAST_NS = 2**63 - 1


class RunFile:
    """One MCAP being written: protobuf, zstd chunks, CRCs on, named ``.part`` until it is finished.

    Nothing is ever overwritten: a path that exists, finished or as ``.part``, is a RigError, as is every fault of the
    disk.
    """

    def __init__(
        self,
        path: str | Path,
        metadata: Mapping[str, str],
        attachments: Mapping[str, bytes] | None = None,
        parent: Path | None = None,
    ) -> None:
        from mcap.writer import CompressionType, Writer

        self.path = Path(path)
        self.part = self.path.with_name(self.path.name + ".part")
        if parent == self.part:  # it is being recovered, and must stay as it is until that is done
            self.part = self.path.with_name(self.path.name + ".recovering")
        for taken in (self.path, self.part):
            if taken.exists():
                raise RigError(f"recording {taken} exists and is not overwritten; choose another name or move it away")
        try:
            self._stream = self.part.open("xb")
        except OSError as error:
            raise RigError(f"recording {self.path} cannot be made: {error.strerror}; check the folder") from None
        # Data CRCs as well: chunk CRCs alone would let a flipped bit in the metadata pass.
        self._mcap: Any = Writer(self._stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
        self._channels: dict[str, int] = {}
        try:
            self._mcap.start(profile="straw", library="straw rig")
            self._mcap.add_metadata("straw.run", {key: str(value) for key, value in metadata.items()})
            self._mcap.add_metadata("straw.software", software())
            for name, data in (attachments or {}).items():
                now_ns = time.time_ns()
                self._mcap.add_attachment(now_ns, now_ns, name, "text/plain", data)
            self.flush()
        except BaseException as error:
            self.discard()
            if isinstance(error, OSError):
                raise self._disk(error) from None
            raise

    def declare(self, topic: str, schema_name: str, descriptors: bytes) -> None:
        """Announce a topic beyond the contract's: protobuf messages called ``schema_name`` in a FileDescriptorSet."""
        schema_id = self._mcap.register_schema(schema_name, "protobuf", descriptors)
        self._channels[topic] = self._mcap.register_channel(topic, "protobuf", schema_id)

    def add(self, topic: str, happened_ns: int, data: bytes, log_time_ns: int | None = None) -> None:
        """Write one encoded message that happened at ``happened_ns`` (ns since the Unix epoch), logged now."""
        if topic not in self._channels:
            schema = schema_of(topic)
            schema_id = self._mcap.register_schema(schema.name, "protobuf", descriptor_set(schema))
            self._channels[topic] = self._mcap.register_channel(topic, "protobuf", schema_id, schema.units)
        self._add(self._channels[topic], happened_ns, data, time.time_ns() if log_time_ns is None else log_time_ns)

    def add_raw(self, channel: Any, schema: Any, happened_ns: int, data: bytes, log_time_ns: int) -> None:
        """Write one message of another file, with the channel and schema records it had there."""
        key = f"{channel.id} {channel.topic}"
        if key not in self._channels:
            schema_id = self._mcap.register_schema(schema.name, schema.encoding, schema.data) if schema else 0
            self._channels[key] = self._mcap.register_channel(
                channel.topic, channel.message_encoding, schema_id, dict(channel.metadata)
            )
        self._add(self._channels[key], happened_ns, data, log_time_ns)

    def add_metadata(self, name: str, record: Mapping[str, str]) -> None:
        """Write one more metadata record."""
        self._mcap.add_metadata(name, dict(record))

    def _add(self, channel: int, happened_ns: int, data: bytes, log_time_ns: int) -> None:
        try:
            self._mcap.add_message(channel, log_time_ns, data, happened_ns)
        except OSError as error:
            raise self._disk(error) from None

    def flush(self) -> None:
        """Bring everything so far to the disk, where neither a killed program nor a lost battery can reach it."""
        try:
            self._mcap.flush()
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise self._disk(error) from None

    def finish(self, closing: Mapping[str, str] | None = None) -> None:
        """Write the closing metadata (record ``straw.stop``) and the index, and give the file its name."""
        try:
            if closing:
                self._mcap.flush()
                self._mcap.add_metadata("straw.stop", dict(closing))
            self._mcap.finish()
            self._stream.flush()
            os.fsync(self._stream.fileno())
            self._stream.close()
            if self.path.exists():
                raise RigError(f"recording {self.path} appeared meanwhile; the data are safe in {self.part}")
            self.part.rename(self.path)
        except OSError as error:
            raise self._disk(error) from None
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Let go of the file as it is; what was flushed stays in ``.part`` until ``finish`` renamed it."""
        with suppress(OSError):  # a full disk complains again, and has been reported
            self._stream.close()

    def discard(self) -> None:
        """Remove the unfinished file: only for what can be made again, never for a run."""
        self.abandon()
        self.part.unlink(missing_ok=True)

    def _disk(self, error: OSError) -> RigError:
        return RigError(f"recording {self.part} cannot be written: {error.strerror or error}; check space and rights")


class RunWriter:
    """A live recording: ``add`` only queues, a thread writes and flushes every second.

    Used as a context manager it always finishes the file: what was recorded before an error is kept.
    """

    def __init__(
        self, path: str | Path, metadata: Mapping[str, str], attachments: Mapping[str, bytes] | None = None
    ) -> None:
        self._file = RunFile(path, metadata, attachments)
        self.path = self._file.path
        self._queue: queue.SimpleQueue[tuple[str, int, dict[str, Any], int]] = queue.SimpleQueue()
        self._ending = threading.Event()
        self._failure: BaseException | None = None
        self._finished = False
        self._thread = threading.Thread(target=self._write, name=f"writer {self.path.name}", daemon=True)
        self._thread.start()

    @property
    def failed(self) -> bool:
        """Whether the disk refused; ``add`` and ``finish`` tell how."""
        return self._failure is not None

    def add(self, topic: str, happened_ns: int, **values: Any) -> None:
        """Queue one message that happened at ``happened_ns`` (ns since the Unix epoch); never waits for the disk.

        An error of an earlier message comes out here, so that a run on a full disk stops instead of pretending.
        """
        if self._failure is not None:
            raise self._failure
        if self._finished:
            raise RigError(f"recording {self.path} is finished; what happens later needs a recording of its own")
        check_time(topic, happened_ns)
        check(topic, values)
        self._queue.put((topic, happened_ns, values, time.time_ns()))

    def command(self, command: Command) -> None:
        """Queue what a controller was told."""
        self._told("/pressure/command", command)

    def reading(self, reading: Reading) -> None:
        """Queue what a controller read."""
        self._told("/pressure/measured", reading, sigma_pa=reading.sigma_pa, flow_m3_s=reading.flow_m3_s)

    def _told(self, topic: str, what: Command | Reading, **more: float) -> None:
        self.add(
            topic,
            what.wall_ns,
            pressure_pa=what.pressure_pa,
            channel=what.channel,
            monotonic_ns=what.monotonic_ns,
            half_width_ns=what.half_width_ns,
            raw=what.raw,
            **more,
        )

    def event(self, kind: str, text: str, happened_ns: int | None = None) -> None:
        """Queue an event, now if no time is given."""
        self.add("/events", time.time_ns() if happened_ns is None else happened_ns, kind=kind, text=text)

    def finish(self, closing: Mapping[str, str] | None = None) -> None:
        """Write what is queued and finish the file; an error of the writing thread comes out here."""
        if self._finished:
            return
        self._finished = True
        self._ending.set()
        self._thread.join()
        if self._failure is not None:
            self._file.abandon()
            raise self._failure
        self._file.finish(closing)
        seal(self.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.finish()

    def _write(self) -> None:
        flush_at = time.monotonic() + FLUSH_S
        try:
            ending = False
            while not ending:
                # Waking up costs more than writing: at 1 kHz a thread that wakes for each message doubles the price.
                ending = self._ending.wait(WAKE_S)
                with suppress(queue.Empty):
                    while True:
                        topic, happened_ns, values, log_ns = self._queue.get_nowait()
                        self._file.add(topic, happened_ns, encode(topic, values), log_ns)
                if time.monotonic() >= flush_at:
                    self._file.flush()
                    flush_at = time.monotonic() + FLUSH_S
        except BaseException as error:  # kept for add() and finish(): a thread has nobody to tell
            self._failure = error


def encoded(topic: str, happened_ns: int, values: Mapping[str, Any]) -> bytes:
    """One message as bytes, with its time checked; RigError when a value does not fit its field."""
    check_time(topic, happened_ns)
    return encode(topic, values)


def check_time(topic: str, happened_ns: int) -> None:
    """RigError for a time that no clock shows."""
    if not 0 < happened_ns <= LAST_NS:  # a message at t = 0 breaks viewers
        raise RigError(f"{topic} at {happened_ns} ns is no time since 1970; check zero_time_ns")
