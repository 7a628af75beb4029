"""GPMF, the telemetry track of a GoPro: which camera, and how long its shutter was open.

Format: github.com/gopro/gpmf-parser, "GPMF Introduction": records of a four-letter key, a type letter, the size of one
sample, a count of samples, then the samples, padded to four bytes; type 0 nests.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass

import av
import numpy as np

_NUMBERS = {"f": ">f4", "d": ">f8", "b": ">i1", "B": ">u1", "s": ">i2", "S": ">u2", "l": ">i4", "L": ">u4"}
_DEEPEST = 8  # levels of nesting; real files have three
_MOST_PACKETS = 10  # a second each: more would mean reading the whole file twice


@dataclass(frozen=True)
class Telemetry:
    """The camera's own data: its name ("" when not stated), and its exposures in s (may be empty).

    ``rate`` (frames/s): at which it filmed (VFPS, from the HERO8 on); 0 when it does not say.
    """

    camera: str = ""
    exposures_s: tuple[float, ...] = ()
    rate: float = 0.0

    @property
    def exposure_s(self) -> float | None:
        """The median exposure."""
        return float(np.median(self.exposures_s)) if self.exposures_s else None

    def __str__(self) -> str:
        exposure = f", shutter 1/{1 / self.exposure_s:.0f} s" if self.exposure_s else ""
        return f"{self.camera}{exposure}" if self.camera else ""


def read_telemetry(path: str | os.PathLike[str]) -> Telemetry:
    """Read the GPMF track of a video, as far as it has one and it can be read."""
    payloads = []
    try:
        with av.open(str(path), metadata_errors="replace") as container:
            streams = [stream for stream in container.streams.data if _is_gpmd(stream)]
            for packet in container.demux(streams) if streams else ():
                payloads.append(bytes(packet))
                if len(payloads) >= _MOST_PACKETS:
                    break
    except (av.error.FFmpegError, OSError):
        pass  # a broken telemetry track is no reason not to track
    return parse_telemetry(payloads)


def _is_gpmd(stream: object) -> bool:
    metadata = getattr(stream, "metadata", {})
    return "gopro met" in str(metadata.get("handler_name", "")).lower()


def parse_telemetry(payloads: list[bytes]) -> Telemetry:
    """Read camera and exposures out of raw GPMF payloads; anything malformed ends its payload."""
    camera, exposures, rate = "", [], 0.0
    for payload in payloads:
        for key, kind, data in _records(payload, 0):
            if key in ("DVNM", "MINF") and kind == "c":
                camera = camera or data.rstrip(b"\0 ").decode("ascii", "replace")
            elif key == "SHUT" and kind in _NUMBERS:
                values = np.frombuffer(data[: len(data) // 4 * 4] if kind == "f" else data, _NUMBERS[kind])
                exposures += [float(value) for value in values if 0 < value < 1]
            elif key == "VFPS" and kind in _NUMBERS and len(data) >= 2 * int(_NUMBERS[kind][-1]):
                over, under = np.frombuffer(data, _NUMBERS[kind])[:2].tolist()
                rate = float(over) / float(under) if under > 0 else rate
    return Telemetry(camera, tuple(exposures), rate)


def _records(data: bytes, depth: int) -> Iterator[tuple[str, str, bytes]]:
    at = 0
    while at + 8 <= len(data) and depth < _DEEPEST:
        key, kind, size, count = struct.unpack_from(">4sBBH", data, at)
        if not key.isalnum():
            return
        body = data[at + 8 : at + 8 + size * count]
        if kind == 0:
            yield from _records(body, depth + 1)
        else:
            yield key.decode("ascii"), chr(kind), body
        at += 8 + (size * count + 3) // 4 * 4
