"""Reads the bytes of an MCAP file once, front to back, never all of them at once: their checksum and SHA-256."""

from __future__ import annotations

import hashlib
import zlib
from typing import IO

MAGIC = b"\x89MCAP0\r\n"
_BLOCK = 1 << 20  # bytes that are passed over at once


class Source:
    """A binary stream from its beginning to the size it has now: a live recording may grow meanwhile.

    ``crc`` is of all bytes read or passed over; without ``digest`` none is computed.
    """

    def __init__(self, stream: IO[bytes], size: int | None = None, *, digest: bool = True) -> None:
        self._stream, self._digest, self._sha256 = stream, digest, hashlib.sha256()
        self.size = stream.seek(0, 2) if size is None else size
        self.crc = self.position = 0
        stream.seek(max(self.size - len(MAGIC), 0))
        self.finished = self.size > 2 * len(MAGIC) and stream.read(len(MAGIC)) == MAGIC
        stream.seek(0)

    @property
    def left(self) -> int:
        """How many bytes are left."""
        return self.size - self.position

    def read(self, count: int) -> bytes:
        """Return the next bytes, fewer where there are no more."""
        data = self._stream.read(min(count, self.left))
        self.position += len(data)
        if self._digest:
            self.crc = zlib.crc32(data, self.crc)
            self._sha256.update(data)
        return data

    def skip(self, count: int) -> None:
        """Pass over the next bytes."""
        end = self.position + min(count, self.left)
        if not self._digest:
            self.position = self._stream.seek(end)
        while self.position < end and self.read(min(_BLOCK, end - self.position)):
            pass

    def sha256(self) -> str:
        """SHA-256 of the whole file, in hexadecimal; what was not read yet is passed over."""
        self.skip(self.left)
        return self._sha256.hexdigest() if self._digest else ""
