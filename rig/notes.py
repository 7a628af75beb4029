"""Notes and tags: what people say about a recording, beside it, for the recording itself is never changed."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

from rig.errors import RigError

SUFFIX = ".notes.jsonl"


@dataclass(frozen=True)
class Notes:
    """Tags in force, and notes as (time in ISO 8601, text), oldest first."""

    tags: tuple[str, ...] = ()
    notes: tuple[tuple[str, str], ...] = ()


def notes_of(run: Path) -> Path:
    """Where the notes on a recording lie."""
    return run.with_name(run.name + SUFFIX)


def check_word(kind: str, text: str) -> None:
    """Raise RigError where this cannot be a note, or a tag."""
    if not text.strip() or (kind != "note" and not text.replace("-", "").replace("_", "").replace(".", "").isalnum()):
        raise RigError(f"{kind} {text!r}: expected {'some text' if kind == 'note' else 'one word, as good or re-run'}")


def say(run: Path, kind: str, text: str) -> None:
    """Append a "note", a "tag", or an "untag"; nothing that was said before is touched."""
    text = " ".join(text.split())
    check_word(kind, text)
    said = {"time": datetime.now(UTC).isoformat(timespec="seconds"), kind: text}
    line = json.dumps(said, ensure_ascii=False).encode() + b"\n"
    try:
        with notes_of(run).open("ab+") as stream:
            torn = stream.tell() > 0 and not _ends_a_line(stream)  # by whoever was cut while writing it
            stream.write(b"\n" + line if torn else line)
        if line not in notes_of(run).read_bytes().splitlines(keepends=True):
            raise OSError(0, "what was written is not there")
    except OSError as error:
        raise RigError(f"{notes_of(run)} cannot be written: {error.strerror}; check the folder") from None


def _ends_a_line(stream: BinaryIO) -> bool:
    stream.seek(-1, os.SEEK_END)
    return stream.read(1) == b"\n"


def read_notes(run: Path) -> Notes:
    """What was said; a damaged line is passed over, as the rest is worth having."""
    try:
        lines = notes_of(run).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return Notes()
    tags: dict[str, None] = {}
    notes = []
    for line in lines:
        try:
            said = json.loads(line)
            if "tag" in said:
                tags[str(said["tag"])] = None
            elif "untag" in said:
                tags.pop(str(said["untag"]), None)
            else:
                notes.append((str(said["time"]), str(said["note"])))
        except (ValueError, KeyError, TypeError):
            continue
    return Notes(tuple(tags), tuple(notes))
