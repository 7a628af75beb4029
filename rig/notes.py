"""Notes, tags and marks on a recording, kept in a file beside it, as the recording itself never changes."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

from straw.rig.errors import RigError

SUFFIX = ".notes.jsonl"
#: A star highlights, an archived run is hidden, a locked one cannot be archived.
MARKS = ("star", "archive", "lock")


@dataclass(frozen=True)
class Notes:
    """Tags and marks in force, and notes as (time in ISO 8601, text), oldest first, and their lines' numbers."""

    tags: tuple[str, ...] = ()
    notes: tuple[tuple[str, str], ...] = ()
    marks: tuple[str, ...] = ()
    lines: tuple[int, ...] = ()


def notes_of(run: Path) -> Path:
    """Where the notes on a recording lie."""
    return run.with_name(run.name + SUFFIX)


def check_word(kind: str, text: str) -> None:
    """Raise RigError where this cannot be a note, or a tag."""
    is_tag = kind in ("tag", "untag")
    if not text.strip() or (is_tag and not text.replace("-", "").replace("_", "").replace(".", "").isalnum()):
        raise RigError(f"{kind} {text!r}: expected {'one word, as good or re-run' if is_tag else 'some text'}")


def say(run: Path, kind: str, text: str, **more: object) -> None:
    """Append a "note", a "tag" or "untag", a "mark" or "unmark"; earlier entries stay as they are.

    ``instead_of=LINE`` of a note names the line it replaces; "unnote" removes a line's note.
    """
    text = " ".join(text.split())
    if kind in ("mark", "unmark"):
        _check_mark(run, kind, text)
    else:
        check_word(kind, text)
    said = {"time": datetime.now(UTC).isoformat(timespec="seconds"), kind: text, **more}
    line = json.dumps(said, ensure_ascii=False).encode() + b"\n"
    try:
        with notes_of(run).open("ab+") as stream:
            torn = stream.tell() > 0 and not _ends_a_line(stream)  # left by a process that was killed while writing it
            stream.write(b"\n" + line if torn else line)
        if line not in notes_of(run).read_bytes().splitlines(keepends=True):
            raise OSError(0, "what was written is not there")
    except OSError as error:
        raise RigError(f"{notes_of(run)} cannot be written: {error.strerror}; check the folder") from None


def _ends_a_line(stream: BinaryIO) -> bool:
    stream.seek(-1, os.SEEK_END)
    return stream.read(1) == b"\n"


def read_notes(run: Path) -> Notes:
    """All entries; a damaged line is skipped."""
    try:
        lines = notes_of(run).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return Notes()
    tags: dict[str, None] = {}
    marks: dict[str, None] = {}
    notes: dict[int, tuple[str, str]] = {}
    for number, line in enumerate(lines, 1):
        try:
            _apply(json.loads(line), number, tags, marks, notes)
        except (ValueError, KeyError, TypeError):
            continue
    return Notes(tuple(tags), tuple(notes.values()), tuple(marks), tuple(notes))


def _apply(
    said: dict[str, Any], number: int, tags: dict[str, None], marks: dict[str, None], notes: dict[int, tuple[str, str]]
) -> None:
    for kind, held in (("tag", tags), ("mark", marks)):
        if kind in said:
            held[str(said[kind])] = None
        elif f"un{kind}" in said:
            held.pop(str(said[f"un{kind}"]), None)
    if "unnote" in said:
        notes.pop(int(said["unnote"]), None)
    elif "note" in said:
        notes.pop(int(said.get("instead_of", 0)), None)
        notes[number] = (str(said["time"]), str(said["note"]))


def _check_mark(run: Path, kind: str, mark: str) -> None:
    if mark not in MARKS:
        raise RigError(f"{kind} {mark!r}: expected one of {', '.join(MARKS)}")
    if (kind, mark) == ("mark", "archive") and "lock" in read_notes(run).marks:
        raise RigError(f"{run.name} is locked, so it is not archived; unlock it first")
