"""Recovery: makes a complete file from a run that was killed, cut or damaged; the file states what was lost."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError
from straw.rig.mcap_scan import Scan, messages, scan
from straw.rig.run_file import RunFile
from straw.rig.schema import encode


@dataclass(frozen=True)
class Recovered:
    """The readable run, how many messages it holds, and a description of what is missing."""

    path: Path
    messages: int
    lost: tuple[str, ...]


def recover(path: str | Path, output: str | Path | None = None) -> Recovered:
    """Write all intact parts of a ``.part`` or damaged recording as a finished one; the original stays.

    ``output`` is the name without ``.part``, or with ``.recovered`` before the suffix where that is the damaged file
    itself. The file passes through the memory a chunk at a time. The guardian's notes beside it, of what it did after
    the script's death, become events. RigError when nothing can be read, when nothing is wrong with the file, or when
    the new name is taken.
    """
    path = Path(path)
    found = scan(path)
    if not found.lost:
        raise RigError(f"recording {path} is whole: nothing to recover")
    if not found.counts.keys() & found.channels.keys():
        raise RigError(f"recording {path} holds no message that can be read: nothing to recover; {found.lost[0]}")
    named = path.name.removesuffix(".part")
    whole = path.with_name(named if named != path.name else f"{path.stem}.recovered{path.suffix}")
    file = RunFile(output or whole, found.metadata.get("straw.run", {}), found.attachments, parent=path)
    try:
        written = _copy(path, found, file)
        notes = path.with_name(f"{named}.guardian")
        written += _add_notes(notes, file)
        lost = tuple(dict.fromkeys(found.lost))
        closing = found.metadata.get("straw.stop") or {"exit_status": "fail", "exit_reason": "the recording was cut"}
        file.finish(closing | {"recovered_from_sha256": found.sha256, "recovered_lost": "; ".join(lost)})
    except BaseException:
        file.discard()
        raise
    return Recovered(file.path, written, lost)


def _copy(path: Path, found: Scan, file: RunFile) -> int:
    """Messages as they are, in the schema and encoding they came in, one after the other."""

    def copy(channel_id: int, happened_ns: int, data: bytes, log_ns: int) -> None:
        channel: Any = found.channels.get(channel_id)
        if channel is not None:
            file.add_raw(channel, found.schemas.get(channel.schema_id), happened_ns, data, log_ns)

    messages(path, found, copy)
    for name, record in found.metadata.items():
        if name not in ("straw.run", "straw.stop", "straw.software"):
            file.add_metadata(name, record)
    if software := found.metadata.get("straw.software"):
        file.add_metadata("straw.software.recorded", software)
    return sum(count for channel_id, count in found.counts.items() if channel_id in found.channels)


def _add_notes(path: Path, file: RunFile) -> int:
    count = 0
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError:
        return 0
    for line in lines:
        try:
            note = json.loads(line)
            happened_ns, values = note["wall_ns"], {"kind": note["kind"], "text": note["text"]}
            file.add("/events", happened_ns, encode("/events", happened_ns, values))
            count += 1
        except (ValueError, KeyError, TypeError, RigError):  # the guardian was cut short, too
            continue
    return count
