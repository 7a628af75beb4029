"""straw's own table of a recording: one row a message, one column a field; and back again, bit for bit.

A table holds every message of plain fields (numbers, truth values, words, bytes). ``Side`` is what it cannot hold:
metadata, attachments, how each topic is encoded, and messages with fields inside fields. Where a message's bytes are
not those that its fields give (other writers order them otherwise), the column ``payload`` keeps them; a cell that
somebody edited counts more than the payload.
"""

from __future__ import annotations

import base64
import json
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rig.errors import RigError
from rig.manifest import seal
from rig.mcap_scan import Scan, read_bytes, scan
from rig.run_file import RunFile
from rig.schema import PREDICTION, TOPICS, descriptor_set, message_class, schema_of

FIRST = ("time_s", "topic", "time_ns", "log_time_ns")
PAYLOAD = "payload"
VERSION = 1
Row = dict[str, Any]
_KINDS = {"double": float, "float": float, "int32": int, "int64": int, "uint32": int, "uint64": int, "bool": bool}
_KINDS |= {"string": str, "bytes": bytes, "sint64": int, "sint32": int}
#: Fields that are whole numbers where JSON does not say so.
_WHOLE = {name for schema in TOPICS.values() for name, kind, _ in schema.fields if kind.startswith("int")}
#: What each kind is when nobody says: protobuf does not tell an absent field from one of this value.
_ABSENT: dict[type, Any] = {float: 0.0, int: 0, bool: False, str: "", bytes: b""}


@dataclass
class Side:
    """What of a recording a table cannot hold, as JSON beside a CSV, or inside a Parquet file."""

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
        """Out of JSON; RigError where it is none of ours."""
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


class _Codec:
    """How one channel's bytes become fields and back; ``kinds`` is None where they are no plain fields."""

    def __init__(self, encoding: str, schema_name: str, schema_data: bytes, first: bytes | None) -> None:
        self.json = encoding == "json"
        self.kinds: dict[str, type] | None = None
        self._class: Any = None
        if self.json and first is not None:
            self._kinds_of_json(first)
        elif encoding == "protobuf":
            try:
                self._class = message_class(schema_name, schema_data)
                self.kinds = self._plain(self._class.DESCRIPTOR)
            except Exception:  # a damaged or foreign schema fails in many ways: its messages are kept as they are
                self.kinds = None

    def _kinds_of_json(self, first: bytes) -> None:
        try:
            data = json.loads(first)
        except ValueError:
            return
        if isinstance(data, dict) and all(isinstance(v, float | int | bool | str | None) for v in data.values()):
            words = {bool: bool, str: str}
            self.kinds = {
                name: int if name in _WHOLE else words.get(type(value), float)
                for name, value in data.items()
                if name not in (*FIRST, PAYLOAD)
            }

    @staticmethod
    def _plain(descriptor: Any) -> dict[str, type] | None:
        from google.protobuf.descriptor import FieldDescriptor

        names = {getattr(FieldDescriptor, f"TYPE_{kind.upper()}"): kind for kind in _KINDS}
        kinds = {}
        for one in descriptor.fields:
            repeated = one.is_repeated if hasattr(one, "is_repeated") else one.label == 3
            if one.type not in names or repeated or one.containing_oneof is not None or one.name in (*FIRST, PAYLOAD):
                return None
            kinds[one.name] = _KINDS[names[one.type]]
        return kinds

    def fields(self, data: bytes) -> Row | None:
        """Fields of a message; None where they do not fit."""
        try:
            if self.json:
                values = json.loads(data)
                fit = isinstance(values, dict) and all(
                    name in (self.kinds or {}) and isinstance(value, float | int | bool | str | None)
                    for name, value in values.items()
                )
                return values if fit else None
            message = self._class.FromString(data)
            return {name: getattr(message, name) for name in self.kinds or {}}
        except Exception:  # what cannot be decoded is kept as it is
            return None

    def bytes_of(self, fields: Row, payload: bytes | None) -> bytes:
        """A message of fields; on top of the payload's own where there is one."""
        if self.json:
            values = json.loads(payload) if payload else {}
            values.update({k: v for k, v in fields.items() if k in values or v is not None})
            return json.dumps(values).encode()
        message = self._class.FromString(payload) if payload else self._class()
        for name, value in fields.items():
            setattr(message, name, _ABSENT[(self.kinds or {})[name]] if value is None else value)
        made: bytes = message.SerializeToString(deterministic=True)
        return made


def rows_of(path: Path, topics: Sequence[str] = ()) -> Rows:
    """Every message of a recording (only of these topics) as rows; RigError as ``read_run`` for what is damaged.

    Recordings are exported whole: a damaged one is a RigError that names ``straw runs recover``.
    """
    found: Scan = scan(read_bytes(path), str(path))
    if found.lost:
        raise RigError(f"{path}: {found.lost[0]}; straw runs recover makes it whole, then export that")
    known = {channel.topic for channel in found.channels.values()}
    for topic in topics:
        if topic not in known:
            raise RigError(f"{path}: no topic {topic!r}; it has {', '.join(sorted(known))}")
    side = Side(metadata={name: dict(record) for name, record in found.metadata.items()})
    side.attachments = {name: base64.b64encode(data).decode() for name, data in found.attachments.items()}
    zero_ns = _zero(found)
    firsts: dict[int, bytes] = {}
    for channel_id, _, data, _ in found.messages:
        firsts.setdefault(channel_id, data)
    index: dict[int, int] = {}
    codecs: dict[int, _Codec] = {}
    for channel_id, channel in found.channels.items():
        if topics and channel.topic not in topics:
            continue
        schema = found.schemas.get(channel.schema_id)
        about = (schema.name, schema.encoding, schema.data) if schema else ("", "", b"")
        index[channel_id] = len(side.channels)
        codecs[channel_id] = _Codec(channel.message_encoding, about[0], about[2], firsts.get(channel_id))
        side.channels.append(
            {
                "topic": channel.topic,
                "encoding": channel.message_encoding,
                "metadata": dict(channel.metadata),
                "schema": {"name": about[0], "encoding": about[1], "data": base64.b64encode(about[2]).decode()},
            }
        )
    several = {c["topic"] for c in side.channels if sum(o["topic"] == c["topic"] for o in side.channels) > 1}
    kinds = _kinds(codecs)
    rows: list[Row] = []
    for channel_id, ns, data, log_ns in found.messages:
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


def _fits(value: Any, kind: type) -> bool:
    """Whether a column of a kind holds a value without changing it."""
    if kind is float:
        return value is None or type(value) is float or (type(value) is int and abs(value) < 2**53)
    return value is None or type(value) is kind


def _kinds(codecs: dict[int, _Codec]) -> dict[str, type]:
    """Columns and their kinds; a field that two topics have in two kinds belongs to the first."""
    kinds: dict[str, type] = {"time_s": float, "topic": str, "time_ns": int, "log_time_ns": int}
    for codec in codecs.values():
        for name, kind in (codec.kinds or {}).items():
            kinds.setdefault(name, kind)
    return kinds


def _zero(found: Scan) -> int:
    text = found.metadata.get("straw.run", {}).get("zero_time_ns", "")
    return int(text) if text.isdecimal() else min((m[1] for m in found.messages), default=0)


def recording_of(rows: list[Row], side: Side | None, output: Path, where: str, extra: dict[str, str]) -> int:
    """Write rows of such a table as a recording; how many messages. RigError, with the row, for what does not fit.

    ``side`` None: only the contract's topics, in straw's own encoding. ``extra`` goes over what straw.run said.
    """
    channels = side.channels if side else _contract(rows, where)
    codecs, first_of = _codecs(channels, rows)
    pending: dict[int, list[tuple[int, int, int, bytes]]] = defaultdict(list)
    for after, channel, ns, log_ns, data in side.others if side else ():
        if not 0 <= channel < len(channels):
            raise RigError(f"{where}: its side file names a topic it does not have; export the recording again")
        pending[min(after, len(rows))].append((channel, ns, log_ns, base64.b64decode(data)))
    done: list[tuple[int, int, int, bytes]] = []
    for k, row in enumerate(rows):
        done += pending.pop(k, [])
        place = f"{where}: row {k + 1}"
        if row["topic"] not in first_of:
            raise RigError(
                f"{place}: topic {row['topic']!r} is not described in the side file; keep both files together"
            )
        at = first_of[row["topic"]]
        done.append((at, row["time_ns"], row["log_time_ns"], _message(codecs[at], row, place)))
    for k in sorted(pending):
        done += pending[k]
    if not done:
        raise RigError(f"recording {output} would be empty; there is nothing to write")
    metadata = dict(side.metadata) if side else {}
    run = {**metadata.pop("straw.run", {}), **extra}
    stop, software = metadata.pop("straw.stop", None), metadata.pop("straw.software", None)
    attachments = {name: base64.b64decode(data) for name, data in (side.attachments if side else {}).items()}
    file = RunFile(output, run, attachments)
    try:
        for name, record in metadata.items():
            if name != "straw.software.recorded" or not software:
                file.add_metadata(name, record)
        if software:
            file.add_metadata("straw.software.recorded", metadata.get("straw.software.recorded", software))
        made = [_records(k, channel) for k, channel in enumerate(channels)]
        for at, ns, log_ns, message in done:
            file.add_raw(*made[at], ns, message, log_ns)
        file.finish(stop)
    except BaseException:
        file.discard()
        raise
    seal(output)
    return len(done)


def _message(codec: _Codec, row: Row, place: str) -> bytes:
    kinds = codec.kinds or {}
    payload = row.get(PAYLOAD) or None
    fields = {name: row.get(name) for name in kinds}
    if payload and (was := codec.fields(payload)) is not None and _same(was, fields, kinds):
        return bytes(payload)
    try:
        if codec.json:
            fields = {k: v for k, v in row.items() if v is not None and k not in (*FIRST, PAYLOAD)}
        return codec.bytes_of(fields, payload)
    except (TypeError, ValueError, KeyError) as error:
        raise RigError(f"{place}: {' '.join(str(error).split())[:100]}; put the cell right") from None


def _same(was: Row, cells: Row, kinds: dict[str, type]) -> bool:
    for name, kind in kinds.items():
        one, other = was.get(name), cells.get(name)
        if one is None or other is None:
            if (one if one is not None else other) not in (None, _ABSENT.get(kind)) and one != other:
                return False
        elif one != other and not (one != one and other != other):
            return False
    return True


def _contract(rows: list[Row], where: str) -> list[dict[str, Any]]:
    """Channels of the contract for rows that come without a side file."""
    out = []
    for topic in dict.fromkeys(row["topic"] for row in rows):
        if topic not in TOPICS and not PREDICTION.fullmatch(topic):
            raise RigError(
                f"{where}: topic {topic!r} needs the side file that straw export wrote; put it beside the table"
            )
        schema = schema_of(topic)
        data = base64.b64encode(descriptor_set(schema)).decode()
        about = {"name": schema.name, "encoding": "protobuf", "data": data}
        out.append({"topic": topic, "encoding": "protobuf", "metadata": schema.units, "schema": about})
    return out


def _codecs(channels: list[dict[str, Any]], rows: list[Row]) -> tuple[list[_Codec], dict[str, int]]:
    names: dict[str, dict[str, None]] = defaultdict(dict)
    for row in rows:
        names[row["topic"]].update(
            dict.fromkeys(k for k, v in row.items() if v is not None and k not in (*FIRST, PAYLOAD))
        )
    codecs: list[_Codec] = []
    first_of: dict[str, int] = {}
    for k, channel in enumerate(channels):
        codec = _Codec(
            channel["encoding"], channel["schema"]["name"], base64.b64decode(channel["schema"]["data"]), None
        )
        if codec.json:
            codec.kinds = dict.fromkeys(names[channel["topic"]], object)
        codecs.append(codec)
        first_of.setdefault(channel["topic"], k)
    return codecs, first_of


def _records(k: int, channel: dict[str, Any]) -> tuple[Any, Any]:
    from mcap.records import Channel, Schema

    about = channel["schema"]
    schema = Schema(data=base64.b64decode(about["data"]), encoding=about["encoding"], id=k + 1, name=about["name"])
    made = Channel(
        id=k + 1,
        message_encoding=channel["encoding"],
        metadata=channel["metadata"],
        schema_id=k + 1 if about["name"] or about["encoding"] else 0,
        topic=channel["topic"],
    )
    return made, schema if made.schema_id else None
