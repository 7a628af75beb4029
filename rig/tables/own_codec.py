"""Codec: how one topic's messages become the cells of a row, and cells the same bytes again."""

from __future__ import annotations

import json
from typing import Any

from straw.rig.schema import TOPICS, message_class

FIRST = ("time_s", "topic", "time_ns", "log_time_ns")
PAYLOAD = "payload"
Row = dict[str, Any]
_KINDS = {"double": float, "float": float, "int32": int, "int64": int, "uint32": int, "uint64": int, "bool": bool}
_KINDS |= {"string": str, "bytes": bytes, "sint64": int, "sint32": int}
#: Fields that are integers, which JSON does not distinguish.
_WHOLE = {name for schema in TOPICS.values() for name, kind, _ in schema.fields if kind.startswith("int")}
#: Default of each kind: protobuf does not distinguish an absent field from one of this value.
ABSENT: dict[type, Any] = {float: 0.0, int: 0, bool: False, str: "", bytes: b""}


class Codec:
    """Converts one channel's bytes to fields and back; ``kinds`` is None where they are no plain fields."""

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
            setattr(message, name, ABSENT[(self.kinds or {})[name]] if value is None else value)
        made: bytes = message.SerializeToString(deterministic=True)
        return made
