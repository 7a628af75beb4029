"""Decodes the messages of a recording, protobuf or JSON alike, into samples of the contract's fields."""

from __future__ import annotations

import json
import operator
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from straw.rig.errors import RigError
from straw.rig.mcap_scan import Scan
from straw.rig.memory import PEAK, available_bytes, too_long
from straw.rig.samples import Samples
from straw.rig.schema import PREDICTION, TOPICS, Schema, descriptor_set, message_class, schema_of

# Value of a field that is absent, or null as JSON writes NaN; a field without an entry here must be present.
ABSENT: dict[str, Any] = {"sigma_pa": np.nan, "channel": 1, "valid": True, "frame": -1, "kind": "", "text": ""}
ABSENT |= {name: np.nan for axis in ("x_m", "z_m", "phi_rad") for name in (axis, f"sigma_{axis}")}
EXTRA = {"monotonic_ns", "half_width_ns", "raw", "flow_m3_s"}  # our own, beyond the contract
_CHECKED = 1 << 20  # samples between two looks at the memory


class Decoder:
    """Takes the messages of a recording as they are read, and keeps those of the contract's topics as ``Samples``.

    Channels are looked up in ``found``. A message may come before its channel, where the file is damaged and repeats
    it later: ``early`` says whether that was so, then the messages have to be taken again by another decoder.
    """

    def __init__(self, found: Scan, every_s: float, path: Path) -> None:
        self._found, self._every_ns, self._path = found, round(every_s * 1e9), path
        self._next_check = _CHECKED
        self.samples: dict[str, Samples] = {}
        self._readers: dict[int, tuple[Samples, Callable[[bytes], tuple[Any, ...]]] | None] = {}
        self._damaged: Counter[str] = Counter()
        self._unknown: set[int] = set()
        self._lost: list[str] = []

    def take(self, channel_id: int, happened_ns: int, data: bytes, _log_ns: int) -> None:
        """Keep one message."""
        if channel_id not in self._readers:
            self._readers[channel_id] = self._reader(channel_id)
        reader = self._readers[channel_id]
        if reader is None:
            return
        try:
            values = reader[1](data)
        except Exception:  # json, protobuf and key errors alike: this message does not match its channel
            self._damaged[self._found.channels[channel_id].topic] += 1
            return
        samples = reader[0]
        samples.add(happened_ns, values)
        if len(samples) >= self._next_check:
            self._next_check = len(samples) + _CHECKED
            self._check_room()

    @property
    def early(self) -> bool:
        """Whether messages came before their channel, or its schema, that are known now."""
        return any(self._described(channel_id) for channel_id in self._unknown)

    def decoded(self) -> dict[str, Samples]:
        """Samples by topic; what could not be decoded is counted in ``lost`` of what was found."""
        for samples in self.samples.values():
            samples.end()
        lost = [f"{n} messages on {topic} could not be decoded and were left out" for topic, n in self._damaged.items()]
        self._found.lost += self._lost + lost
        return {topic: samples for topic, samples in self.samples.items() if len(samples)}

    def _check_room(self) -> None:
        """TooLongError where the samples so far leave no memory to compute with them."""
        held = sum(len(one) * one.sample_bytes for one in self.samples.values())
        if (PEAK - 1) * held > available_bytes():
            share = max(self._found.position / max(self._found.size, 1), 1e-6)
            count = sum(map(len, self.samples.values()))
            span_s = max(float(np.ptp(one.time_ns())) for one in self.samples.values()) * 1e-9
            raise too_long(self._path, count / share, held / count, span_s / share)

    def _described(self, channel_id: int) -> bool:
        channel = self._found.channels.get(channel_id)
        return channel is not None and (not channel.schema_id or channel.schema_id in self._found.schemas)

    def _reader(self, channel_id: int) -> tuple[Samples, Callable[[bytes], tuple[Any, ...]]] | None:
        """Where the messages of a channel go and how they are decoded; None for channels of no interest."""
        channel = self._found.channels.get(channel_id)
        if not self._described(channel_id):
            self._unknown.add(channel_id)
        if channel is None:
            what = f"channel {channel_id} is not described in what is left of the file"
            self._lost.append(f"{what}: its messages are lost")
            return None
        topic = channel.topic
        if not known(topic):
            return None
        schema = schema_of(topic)
        try:
            decode = _decoder(self._found, channel, schema)
        except RigError as error:
            self._lost.append(str(error))
            return None
        except Exception as error:  # a damaged descriptor fails in many ways
            self._lost.append(f"the schema of {topic} is damaged ({type(error).__name__}): its messages are lost")
            return None
        if topic not in self.samples:
            self.samples[topic] = empty(topic, self._every_ns)
        return self.samples[topic], decode


def known(topic: str) -> bool:
    """Whether a topic is one of the contract's."""
    return topic in TOPICS or PREDICTION.fullmatch(topic) is not None


def empty(topic: str, every_ns: int = 0) -> Samples:
    """No samples yet of a topic of the contract."""
    return Samples([(name, kind) for name, kind, _ in schema_of(topic).fields if name not in EXTRA], every_ns)


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
