"""RunFile: one recording on disk, named ``.part`` until it is finished."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError
from straw.rig.provenance import software
from straw.rig.schema import descriptor_set, schema_of


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
        from straw.rig.mcap_write import McapWriter

        self.path = Path(path)
        self.part = self.path.with_name(self.path.name + ".part")
        if parent == self.part:  # it is being recovered and must not change meanwhile
            self.part = self.path.with_name(self.path.name + ".recovering")
        for taken in (self.path, self.part):
            if taken.exists():
                raise RigError(f"recording {taken} exists and is not overwritten; choose another name or move it away")
        try:
            self._stream = self.part.open("xb")
        except OSError as error:
            raise RigError(f"recording {self.path} cannot be made: {error.strerror}; check the folder") from None
        self._channels: dict[str, int] = {}
        self._mcap: Any = None
        try:
            self._mcap = McapWriter(self._stream, profile="straw", library="straw rig")
            self._mcap.add_metadata("straw.run", {key: str(value) for key, value in metadata.items()})
            self._mcap.add_metadata("straw.software", software())
            for name, data in (attachments or {}).items():
                self._mcap.add_attachment(time.time_ns(), name, "text/plain", data)
            self.flush()
        except BaseException as error:
            self.discard()
            if isinstance(error, OSError):
                raise self._disk(error) from None
            raise

    def declare(
        self, topic: str, schema_name: str, descriptors: bytes, metadata: Mapping[str, str] | None = None
    ) -> None:
        """Announce a topic beyond the contract's: protobuf messages called ``schema_name`` in a FileDescriptorSet."""
        schema_id = self._mcap.add_schema(schema_name, "protobuf", descriptors)
        self._channels[topic] = self._mcap.add_channel(topic, "protobuf", schema_id, metadata or {})

    def add(self, topic: str, happened_ns: int, data: bytes, log_time_ns: int | None = None) -> None:
        """Write one encoded message that happened at ``happened_ns`` (ns since the Unix epoch), logged now."""
        if topic not in self._channels:
            schema = schema_of(topic)
            self.declare(topic, schema.name, descriptor_set(schema), schema.units)
        self._add(self._channels[topic], happened_ns, data, time.time_ns() if log_time_ns is None else log_time_ns)

    def add_raw(self, channel: Any, schema: Any, happened_ns: int, data: bytes, log_time_ns: int) -> None:
        """Write one message of another file, with the channel and schema records it had there."""
        key = f"{channel.id} {channel.topic}"
        if key not in self._channels:
            schema_id = self._mcap.add_schema(schema.name, schema.encoding, schema.data) if schema else 0
            self._channels[key] = self._mcap.add_channel(
                channel.topic, channel.message_encoding, schema_id, channel.metadata
            )
        self._add(self._channels[key], happened_ns, data, log_time_ns)

    def add_metadata(self, name: str, record: Mapping[str, str]) -> None:
        """Write one more metadata record."""
        self._mcap.add_metadata(name, record)

    def _add(self, channel: int, happened_ns: int, data: bytes, log_time_ns: int) -> None:
        try:
            self._mcap.add_message(channel, log_time_ns, happened_ns, data)
        except OSError as error:
            raise self._disk(error) from None

    def flush(self) -> None:
        """Sync everything so far to the disk, so that neither a killed program nor a power failure loses it."""
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
                self._mcap.add_metadata("straw.stop", closing)
            self._mcap.finish()
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
        """Close the file as it is; what was flushed stays in ``.part`` unless ``finish`` renamed it."""
        with suppress(OSError):  # a full disk raises again, and has been reported
            self._stream.close()
        if self._mcap is not None:
            self._mcap.close()

    def discard(self) -> None:
        """Remove the unfinished file: only for derived files, never for a run."""
        self.abandon()
        self.part.unlink(missing_ok=True)

    def _disk(self, error: OSError) -> RigError:
        return RigError(f"recording {self.part} cannot be written: {error.strerror or error}; check space and rights")
