"""Makes the 416 files of MCAP's conformance suite byte for byte (github.com/foxglove/mcap, MIT).

The repository keeps the files in Git LFS; one digest over all their SHA-256 sums proves that these are the same,
which are the LFS object ids at commit 95d0673.
"""

from __future__ import annotations

import itertools
import struct
import zlib
from collections.abc import Iterator

MAGIC = b"\x89MCAP0\r\n"
#: SHA-256 of the sorted lines "name.mcap sha256".
DIGEST = "157b5a37bef215674ff7bc6fcee2c61bcc579974ba00ef064699aa6b95346fea"
PAD = b"\x01\xff\xff"

SCHEMA = ("Schema",)
CHANNEL = ("Channel", 1, 1, "example", "a", {"foo": "bar"})
TIMES = (0, 2, 1, 3, 3, 5, 4, 7, 8, 9)
INPUTS: dict[str, list[tuple]] = {  # type: ignore[type-arg]
    "NoData": [],
    "OneSchemalessMessage": [("Channel", 1, 0, "example", "text", {}), ("Message", 10, 2, 1)],
    "OneMessage": [SCHEMA, CHANNEL, ("Message", 10, 2, 1)],
    "OneAttachment": [("Attachment",)],
    "OneMetadata": [("Metadata",)],
    "TenMessages": [SCHEMA, CHANNEL, *(("Message", n, t, t) for n, t in enumerate(TIMES))],
}
FEATURES = ("ch", "mx", "st", "rsh", "rch", "ax", "mdx", "chx", "sum", "pad")


def conformance_files() -> Iterator[tuple[str, bytes]]:
    """Every file as (name without suffix, bytes)."""
    for base, records in INPUTS.items():
        kinds = {record[0] for record in records}
        for chosen in itertools.product((False, True), repeat=len(FEATURES)):
            features = {name for name, on in zip(FEATURES, chosen, strict=True) if on}
            if _makes_sense(features, kinds):
                yield "-".join([base, *sorted(features)]), _file(features, records)


def _makes_sense(features: set[str], kinds: set[str]) -> bool:
    needs = {"ax": "Attachment", "mdx": "Metadata", "rsh": "Schema", "rch": "Channel"}
    if any(feature in features and kind not in kinds for feature, kind in needs.items()):
        return False
    if features & {"ch", "chx", "mx"} and not kinds & {"Message", "Channel", "Schema"}:
        return False
    if "sum" in features and not features & {"chx", "rsh", "rch", "mdx", "ax", "st"}:
        return False
    return "ch" in features or not features & {"chx", "mx"}


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def _map(table: dict[str, str]) -> bytes:
    data = b"".join(_text(key) + _text(value) for key, value in table.items())
    return struct.pack("<I", len(data)) + data


def _record(opcode: int, payload: bytes, pad: bool = False) -> bytes:
    payload += PAD if pad else b""
    return struct.pack("<BQ", opcode, len(payload)) + payload


def _content(record: tuple, pad: bool) -> bytes:  # type: ignore[type-arg]
    match record:
        case ("Schema",):
            return _record(0x03, struct.pack("<H", 1) + _text("Example") + _text("c") + b"\x03\0\0\0\x04\x05\x06", pad)
        case ("Channel", int(number), int(schema), str(topic), str(encoding), dict(metadata)):
            ids = struct.pack("<HH", number, schema)
            return _record(0x04, ids + _text(topic) + _text(encoding) + _map(metadata), pad)
        case ("Message", int(sequence), int(log), int(publish)):
            return _record(0x05, struct.pack("<HIQQ", 1, sequence, log, publish) + b"\x01\x02\x03")
        case ("Attachment",):
            data = struct.pack("<QQ", 2, 1) + _text("myFile") + _text("application/octet-stream")
            data += struct.pack("<Q", 3) + b"\x01\x02\x03"
            return _record(0x09, data + struct.pack("<I", zlib.crc32(data)), pad)
        case _:
            return _record(0x0C, _text("myMetadata") + _map({"foo": "bar"}), pad)


def _file(features: set[str], records: list[tuple]) -> bytes:  # type: ignore[type-arg]
    pad = "pad" in features
    out = bytearray(MAGIC + _record(0x01, _text("") + _text(""), pad))
    chunked = [r for r in records if r[0] in ("Schema", "Channel", "Message")] if "ch" in features else []
    attachment_at = metadata_at = (0, 0)
    for record in records:
        if record in chunked:
            continue
        start = len(out)
        out += _content(record, pad)
        if record[0] == "Attachment":
            attachment_at = (start, len(out) - start)
        elif record[0] == "Metadata":
            metadata_at = (start, len(out) - start)
    times = [record[2] for record in records if record[0] == "Message"]
    span = (min(times, default=0), max(times, default=0))
    chunk_index = b""
    if "ch" in features:
        inner, entries = b"", b""
        for record in chunked:
            if record[0] == "Message":
                entries += struct.pack("<QQ", record[2], len(inner))
            inner += _content(record, False)
        start = len(out)
        head = struct.pack("<QQQI", *span, len(inner), zlib.crc32(inner)) + _text("") + struct.pack("<Q", len(inner))
        out += _record(0x06, head + inner)
        chunk_length, index_at = len(out) - start, len(out)
        offsets = b""
        if "mx" in features:
            out += _record(0x07, struct.pack("<HI", 1, len(entries)) + entries, pad)
            offsets = struct.pack("<HQ", 1, index_at)
        chunk_index = struct.pack("<QQQQI", *span, start, chunk_length, len(offsets)) + offsets
        chunk_index += struct.pack("<Q", len(out) - index_at) + _text("") + struct.pack("<QQ", len(inner), len(inner))
    out += _record(0x0F, struct.pack("<I", zlib.crc32(out)))

    summary_start = len(out)
    kinds = [record[0] for record in records]
    counts = {k: kinds.count(k) for k in ("Message", "Schema", "Channel", "Attachment", "Metadata")}
    per_channel = struct.pack("<HQ", 1, counts["Message"]) if counts["Message"] else b""
    statistics = struct.pack("<QHIIIIQQI", *counts.values(), "ch" in features, *span, len(per_channel)) + per_channel
    attachment = struct.pack("<QQQQQ", *attachment_at, 2, 1, 3) + _text("myFile") + _text("application/octet-stream")
    groups = []
    for feature, opcode, parts in (
        ("rsh", 0x03, [_content(r, pad) for r in records if r[0] == "Schema"]),
        ("rch", 0x04, [_content(r, pad) for r in records if r[0] == "Channel"]),
        ("st", 0x0B, [_record(0x0B, statistics, pad)]),
        ("mdx", 0x0D, [_record(0x0D, struct.pack("<QQ", *metadata_at) + _text("myMetadata"), pad)]),
        ("ax", 0x0A, [_record(0x0A, attachment, pad)]),
        ("chx", 0x08, [_record(0x08, chunk_index, pad)]),
    ):
        if feature in features:
            groups.append((opcode, len(out), sum(map(len, parts))))
            out += b"".join(parts)
    has_summary = len(out) != summary_start
    offsets_start = 0
    if "sum" in features:
        offsets_start = len(out)
        for group in groups:
            out += _record(0x0E, struct.pack("<BQQ", *group), pad)
    footer = struct.pack("<QQ", summary_start if has_summary else 0, offsets_start)
    crc = zlib.crc32(bytes(out[summary_start:]) + struct.pack("<BQ", 0x02, 20) + footer)
    return bytes(out + _record(0x02, footer + struct.pack("<I", crc)) + MAGIC)
