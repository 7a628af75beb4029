"""Message schemas of a recording, built in code from one table: topic, fields, types, units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from straw.rig.errors import RigError

if TYPE_CHECKING:
    from google.protobuf.descriptor_pb2 import FileDescriptorProto

LAST_NS = 2**63 - 1  # beyond it the sign bit is set for most readers
# (name, protobuf type, unit or ""); numbers follow the order, so new fields go to the end of their tuple.
Fields = tuple[tuple[str, str, str], ...]

WHEN: Fields = (("monotonic_ns", "int64", "ns"), ("half_width_ns", "int64", "ns"))
COMMAND: Fields = (("pressure_pa", "double", "Pa"), ("channel", "int32", ""), *WHEN, ("raw", "bytes", ""))
MEASURED: Fields = (
    ("pressure_pa", "double", "Pa"),
    ("sigma_pa", "double", "Pa"),
    ("channel", "int32", ""),
    *WHEN,
    ("raw", "bytes", ""),
    ("flow_m3_s", "double", "m^3/s"),
)
TIP: Fields = (
    ("x_m", "double", "m"),
    ("z_m", "double", "m"),
    ("phi_rad", "double", "rad"),
    ("sigma_x_m", "double", "m"),
    ("sigma_z_m", "double", "m"),
    ("sigma_phi_rad", "double", "rad"),
    ("valid", "bool", ""),
    ("frame", "int64", ""),
)
EVENT: Fields = (("kind", "string", ""), ("text", "string", ""))


@dataclass(frozen=True)
class Schema:
    """One message type: protobuf name and fields with their units."""

    name: str
    fields: Fields

    @property
    def units(self) -> dict[str, str]:
        """Channel metadata that viewers can show: ``unit.x_m = m``."""
        return {f"unit.{name}": unit for name, _, unit in self.fields if unit}


TOPICS: dict[str, Schema] = {
    "/pressure/command": Schema("straw.PressureCommand", COMMAND),
    "/pressure/measured": Schema("straw.Pressure", MEASURED),
    "/tip/state": Schema("straw.TipState", TIP),
    "/events": Schema("straw.Event", EVENT),
}
PREDICTED = {"tip/state": TOPICS["/tip/state"], "pressure": TOPICS["/pressure/measured"]}
PREDICTION = re.compile(r"/sim/([^/]+)/(tip/state|pressure)")


def schema_of(topic: str) -> Schema:
    """The schema of a topic of the contract; RigError for any other."""
    if topic in TOPICS:
        return TOPICS[topic]
    if match := PREDICTION.fullmatch(topic):
        return PREDICTED[match[2]]
    raise RigError(f"topic {topic!r} is not known; known: {', '.join(TOPICS)}, /sim/<model>/tip/state and .../pressure")


def file_descriptor(schema: Schema) -> FileDescriptorProto:
    """The .proto file that would define the schema."""
    from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto

    package, _, name = schema.name.rpartition(".")
    file = FileDescriptorProto(name=f"{schema.name}.proto", package=package, syntax="proto3")
    message = file.message_type.add(name=name)
    for number, (field, kind, _) in enumerate(schema.fields, 1):
        message.field.add(
            name=field,
            number=number,
            type=getattr(FieldDescriptorProto, f"TYPE_{kind.upper()}"),
            label=FieldDescriptorProto.LABEL_OPTIONAL,
        )
    return file


@cache
def descriptor_set(schema: Schema) -> bytes:
    """Serialized FileDescriptorSet: MCAP's data of a protobuf schema."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    return FileDescriptorSet(file=[file_descriptor(schema)]).SerializeToString()


@cache
def message_class(name: str, descriptors: bytes) -> Any:
    """The message class called ``name`` in a serialized FileDescriptorSet; protobuf's own errors come through."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message_factory import GetMessageClass

    pool = DescriptorPool()  # its own pool: another file may call another message by the same name
    for file in _in_order(FileDescriptorSet.FromString(descriptors)):
        pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(name))


def _in_order(files: Any) -> list[FileDescriptorProto]:
    """Dependencies first: other writers list them in any order."""
    waiting = {file.name: file for file in files.file}
    ordered: list[FileDescriptorProto] = []

    def place(name: str) -> None:
        if file := waiting.pop(name, None):
            for dependency in file.dependency:
                place(dependency)
            ordered.append(file)

    for name in list(waiting):
        place(name)
    return ordered


@cache
def _class_of(topic: str) -> Any:
    schema = schema_of(topic)
    return message_class(schema.name, descriptor_set(schema))


_FITTING: set[tuple[object, ...]] = set()


def check(topic: str, happened_ns: int, values: Mapping[str, Any]) -> None:
    """RigError where ``encode`` would raise one for the time, names or types, at a fraction of its cost."""
    _check_time(topic, happened_ns)
    shape = (topic, *values, *map(type, values.values()))
    if shape not in _FITTING:
        encode(topic, happened_ns, values)
        _FITTING.add(shape)


def encode(topic: str, happened_ns: int, values: Mapping[str, Any]) -> bytes:
    """One message of a topic as protobuf bytes; RigError for a value that does not fit its field, or a time no clock
    shows (ns since the Unix epoch)."""
    _check_time(topic, happened_ns)
    try:
        data: bytes = _class_of(topic)(**values).SerializeToString()
    except (TypeError, ValueError) as error:
        fields = [name for name, *_ in schema_of(topic).fields]
        raise RigError(f"{topic}: {' '.join(str(error).split())}; fields are {fields}") from None
    return data


def _check_time(topic: str, happened_ns: int) -> None:
    if not 0 < happened_ns <= LAST_NS:  # a message at t = 0 breaks viewers
        raise RigError(f"{topic} at {happened_ns} ns is not a time since 1970; check zero_time_ns")
