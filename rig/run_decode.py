"""Decodes the messages of a recording, protobuf or JSON alike, into rows of the contract's fields."""

from __future__ import annotations

import json
import operator
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from straw.rig.errors import RigError
from straw.rig.mcap_scan import Scan
from straw.rig.schema import PREDICTION, TOPICS, Schema, descriptor_set, message_class, schema_of

# Value of a field that is absent, or null as JSON writes NaN; a field without an entry here must be present.
ABSENT: dict[str, Any] = {"sigma_pa": np.nan, "channel": 1, "valid": True, "frame": -1, "kind": "", "text": ""}
ABSENT |= {name: np.nan for axis in ("x_m", "z_m", "phi_rad") for name in (axis, f"sigma_{axis}")}
EXTRA = {"monotonic_ns", "half_width_ns", "raw", "flow_m3_s"}  # our own, beyond the contract
Row = tuple[int, tuple[Any, ...]]  # happened ns, the values of the schema's contract fields


def decode(found: Scan) -> dict[str, list[Row]]:
    """Messages of the contract's topics by topic; what cannot be decoded is counted in ``lost``."""
    rows: dict[str, list[Row]] = {}
    readers: dict[int, tuple[list[Row], Callable[[bytes], tuple[Any, ...]]] | None] = {}
    damaged: Counter[str] = Counter()
    for channel_id, happened_ns, data, _ in found.messages:
        if channel_id not in readers:
            readers[channel_id] = _reader(found, channel_id, rows)
        reader = readers[channel_id]
        if reader is None:
            continue
        try:
            reader[0].append((happened_ns, reader[1](data)))
        except Exception:  # json, protobuf and key errors alike: this message does not match its channel
            damaged[found.channels[channel_id].topic] += 1
    for topic, count in damaged.items():
        found.lost.append(f"{count} messages on {topic} could not be decoded and were left out")
    return {topic: topic_rows for topic, topic_rows in rows.items() if topic_rows}


def _reader(
    found: Scan, channel_id: int, rows: dict[str, list[Row]]
) -> tuple[list[Row], Callable[[bytes], tuple[Any, ...]]] | None:
    """Where the messages of a channel go and how they are decoded; None for channels of no interest."""
    channel = found.channels.get(channel_id)
    if channel is None:
        found.lost.append(f"channel {channel_id} is not described in what is left of the file: its messages are lost")
        return None
    if channel.topic not in TOPICS and not PREDICTION.fullmatch(channel.topic):
        return None
    schema = schema_of(channel.topic)
    try:
        decode = _decoder(found, channel, schema)
    except RigError as error:
        found.lost.append(str(error))
        return None
    except Exception as error:  # a damaged descriptor fails in many ways
        found.lost.append(f"the schema of {channel.topic} is damaged ({type(error).__name__}): its messages are lost")
        return None
    return rows.setdefault(channel.topic, []), decode


def _decoder(found: Scan, channel: Any, schema: Schema) -> Callable[[bytes], tuple[Any, ...]]:
    casts = [(name, _CASTS[kind]) for name, kind, _ in schema.fields if name not in EXTRA]
    if channel.message_encoding == "json":

        def from_json(data: bytes) -> tuple[Any, ...]:
            values = json.loads(data)
            return tuple([cast(values[n] if values.get(n) is not None else ABSENT[n]) for n, cast in casts])

        return from_json
    if channel.message_encoding == "protobuf":
        described = found.schemas[channel.schema_id]
        parse = message_class(described.name, described.data)
        known = set(parse.DESCRIPTOR.fields_by_name)
        defaults = {n: ABSENT[n] for n, _ in casts if n not in known}  # KeyError when a needed field is missing
        if described.data == descriptor_set(schema):  # our own file: types are right, and speed is welcome
            take = operator.attrgetter(*(name for name, _ in casts))
            return lambda data: take(parse.FromString(data))

        def from_protobuf(data: bytes) -> tuple[Any, ...]:
            message = parse.FromString(data)
            return tuple([defaults[n] if n in defaults else cast(getattr(message, n)) for n, cast in casts])

        return from_protobuf
    raise RigError(f"{channel.topic} is encoded as {channel.message_encoding!r}; only protobuf and json can be read")


def _number(value: Any) -> float:
    if isinstance(value, str | bytes | bool):
        raise TypeError("not a number")
    return float(value)


def _integer(value: Any) -> int:
    number = operator.index(int(value) if isinstance(value, float) and value.is_integer() else value)
    if not -(2**63) <= number < 2**63:
        raise ValueError("out of range")
    return number


_CASTS: dict[str, Callable[[Any], Any]] = {
    "double": _number,
    "int32": _integer,
    "int64": _integer,
    "bool": bool,
    "string": str,
}
