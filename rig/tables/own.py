"""straw's own table of a recording: one row per message, one column a field.

A table holds every message of plain fields (numbers, truth values, words, bytes). ``Side`` is what it cannot hold:
metadata, attachments, how each topic is encoded, and messages with fields inside fields. Where encoding the
fields does not give a message's bytes back (other writers order them otherwise), the column ``payload`` keeps them; an
edited cell takes precedence over the payload.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError
from straw.rig.mcap_scan import Scan, messages, scan
from straw.rig.memory import available_bytes
from straw.rig.tables.own_codec import PAYLOAD, Codec, Row

VERSION = 1
#: Memory that a message takes while a table of it is written. By tracemalloc, messages of a tip took 1060 bytes as
#: Parquet and 1280 as CSV; twice that, as pyarrow and the allocator hold memory that tracemalloc does not count.
ROW_BYTES = 2600


@dataclass
class Side:
    """The parts of a recording that a table cannot hold, as JSON beside a CSV, or inside a Parquet file."""

    channels: list[dict[str, Any]] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, str] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)  # of the columns
    others: list[tuple[int, int, int, int, str]] = field(
        default_factory=list
    )  # before row, channel, ns, log ns, base64

    def to_json(self) -> str:
        """As JSON."""
        return json.dumps({"straw_table": VERSION, **self.__dict__}, ensure_ascii=False, indent=1)

    @staticmethod
    def from_json(text: str, where: str) -> Side:
        """From JSON; RigError where straw did not write it."""
        try:
            data = json.loads(text)
            if data["straw_table"] != VERSION:
                raise RigError(f"{where}: is of another version of straw; export the recording again")
            others = [(int(o[0]), int(o[1]), int(o[2]), int(o[3]), str(o[4])) for o in data["others"]]
            return Side(
                list(data["channels"]), dict(data["metadata"]), dict(data["attachments"]), dict(data["kinds"]), others
            )
        except (ValueError, KeyError, TypeError, IndexError) as error:
            raise RigError(f"{where}: is damaged ({type(error).__name__}); export the recording again") from None


@dataclass
class Rows:
    """Messages as rows; ``kinds`` by column; ``channel_of`` the index into ``Side.channels`` of each row."""

    rows: list[Row]
    kinds: dict[str, type]
    side: Side


def rows_of(path: Path, topics: Sequence[str] = ()) -> Rows:
    """Every message of a recording (only of these topics) as rows; RigError as ``read_run`` for what is damaged.

    Recordings are exported whole: a damaged one is a RigError that names ``straw runs recover``.
    """
    found = scan(path)
    if found.lost:
        raise RigError(f"{path}: {found.lost[0]}; straw runs recover makes it whole, then export that")
    known = {channel.topic for channel in found.channels.values()}
    for topic in topics:
        if topic not in known:
            raise RigError(f"{path}: no topic {topic!r}; it has {', '.join(sorted(known))}")
    side = Side(metadata={name: dict(record) for name, record in found.metadata.items()})
    side.attachments = {name: base64.b64encode(data).decode() for name, data in found.attachments.items()}
    _check_room(path, found, topics)
    every: list[tuple[int, int, bytes, int]] = []

    def take(*message: Any) -> None:
        if message[0] in found.channels and _asked(found.channels[message[0]], topics):
            every.append(message)

    messages(path, found, take)
    zero_ns = _zero(found, every)
    firsts: dict[int, bytes] = {}
    for channel_id, _, data, _ in every:
        firsts.setdefault(channel_id, data)
    index, codecs = _codecs(found, topics, firsts, side)
    several = {c["topic"] for c in side.channels if sum(o["topic"] == c["topic"] for o in side.channels) > 1}
    kinds = _kinds(codecs)
    rows: list[Row] = []
    for channel_id, ns, data, log_ns in every:
        if channel_id not in index:
            continue
        codec, topic = codecs[channel_id], found.channels[channel_id].topic
        fields = codec.fields(data) if codec.kinds is not None and topic not in several else None
        if fields is None or not all(_fits(value, kinds[name]) for name, value in fields.items()):
            side.others.append((len(rows), index[channel_id], ns, log_ns, base64.b64encode(data).decode()))
            continue
        fields = {name: float(v) if kinds[name] is float and v is not None else v for name, v in fields.items()}
        row: Row = {"time_s": (ns - zero_ns) * 1e-9, "topic": topic, "time_ns": ns, "log_time_ns": log_ns, **fields}
        given = {name: fields[name] for name in kinds if name in fields} if codec.json else fields
        if codec.bytes_of(given, None) != data:
            row[PAYLOAD] = data
        rows.append(row)
    kinds[PAYLOAD] = bytes
    there = {name for row in rows for name in row}
    kinds = {name: kind for name, kind in kinds.items() if name in there}
    side.kinds = {name: kind.__name__ for name, kind in kinds.items()}
    return Rows(rows, kinds, side)


def _codecs(
    found: Scan, topics: Sequence[str], firsts: Mapping[int, bytes], side: Side
) -> tuple[dict[int, int], dict[int, Codec]]:
    """Place in ``side.channels``, which is filled, and codec of each channel by its id; ``firsts``: messages."""
    index: dict[int, int] = {}
    codecs: dict[int, Codec] = {}
    for channel_id, channel in found.channels.items():
        if not _asked(channel, topics):
            continue
        schema = found.schemas.get(channel.schema_id)
        about = (schema.name, schema.encoding, schema.data) if schema else ("", "", b"")
        index[channel_id] = len(side.channels)
        codecs[channel_id] = Codec(channel.message_encoding, about[0], about[2], firsts.get(channel_id))
        side.channels.append(
            {
                "topic": channel.topic,
                "encoding": channel.message_encoding,
                "metadata": dict(channel.metadata),
                "schema": {"name": about[0], "encoding": about[1], "data": base64.b64encode(about[2]).decode()},
            }
        )
    return index, codecs


def _fits(value: Any, kind: type) -> bool:
    """Whether a column of a kind holds a value without changing it."""
    if kind is float:
        return value is None or type(value) is float or (type(value) is int and abs(value) < 2**53)
    return value is None or type(value) is kind


def _kinds(codecs: dict[int, Codec]) -> dict[str, type]:
    """Columns and their kinds; a field that two topics have in two kinds belongs to the first."""
    kinds: dict[str, type] = {"time_s": float, "topic": str, "time_ns": int, "log_time_ns": int}
    for codec in codecs.values():
        for name, kind in (codec.kinds or {}).items():
            kinds.setdefault(name, kind)
    return kinds


def _zero(found: Scan, every: list[tuple[int, int, bytes, int]]) -> int:
    text = found.metadata.get("straw.run", {}).get("zero_time_ns", "")
    return int(text) if text.isdecimal() else min((message[1] for message in every), default=0)


def _check_room(path: Path, found: Scan, topics: Sequence[str]) -> None:
    """RigError where a recording has more messages than a table of them fits into memory."""
    count = sum(n for of, n in found.counts.items() if of in found.channels and _asked(found.channels[of], topics))
    needed, there = count * ROW_BYTES, available_bytes()
    if needed > there:
        raise RigError(
            f"{path}: {count:,} messages are a table that takes {needed / 1e9:.1f} GB of memory, of which"
            f" {there / 1e9:.1f} GB are free; export fewer topics, or shorter recordings"
        )


def _asked(channel: Any, topics: Sequence[str]) -> bool:
    return not topics or channel.topic in topics
