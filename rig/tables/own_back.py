"""straw's own table back into a recording, bit for bit where its side file is there."""

from __future__ import annotations

import base64
from collections import defaultdict
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError
from straw.rig.manifest import seal
from straw.rig.run_file import RunFile
from straw.rig.schema import PREDICTION, TOPICS, descriptor_set, schema_of
from straw.rig.tables.own import Side
from straw.rig.tables.own_codec import ABSENT, FIRST, PAYLOAD, Codec, Row


def recording_of(rows: list[Row], side: Side | None, output: Path, where: str, extra: dict[str, str]) -> int:
    """Write rows of such a table as a recording; how many messages. RigError, with the row, for what does not fit.

    ``side`` None: only the contract's topics, in straw's own encoding. ``extra`` overrides entries of straw.run.
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


def _message(codec: Codec, row: Row, place: str) -> bytes:
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
            if (one if one is not None else other) not in (None, ABSENT.get(kind)) and one != other:
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


def _codecs(channels: list[dict[str, Any]], rows: list[Row]) -> tuple[list[Codec], dict[str, int]]:
    names: dict[str, dict[str, None]] = defaultdict(dict)
    for row in rows:
        names[row["topic"]].update(
            dict.fromkeys(k for k, v in row.items() if v is not None and k not in (*FIRST, PAYLOAD))
        )
    codecs: list[Codec] = []
    first_of: dict[str, int] = {}
    for k, channel in enumerate(channels):
        codec = Codec(channel["encoding"], channel["schema"]["name"], base64.b64decode(channel["schema"]["data"]), None)
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
