"""Operator, notes, tags and metadata: from the command line into the recording, and beside it."""

from __future__ import annotations

import argparse
from pathlib import Path

from straw.replay.errors import ReplayError
from straw.rig.notes import check_word, say

#: Keys that the recording sets itself and --meta may not override.
TAKEN = (
    "run_id",
    "cells",
    "zero_time_ns",
    "exit_status",
    "exit_reason",
    "vent",
    "cycles",
    "missed_readings",
    "channel",
    "laws",
)
MAY_BE_GIVEN = ("operator", "note")


def about_run(args: argparse.Namespace) -> dict[str, str]:
    """Metadata for ``straw.run`` from --operator, --note and --meta; ReplayError before anything is moved."""
    for tag in args.tag:
        check_word("tag", tag)
    metadata = {"operator": args.operator, "note": " / ".join(" ".join(text.split()) for text in args.note)}
    for text in args.meta:
        key, equals, value = text.partition("=")
        if not equals or not key.replace("-", "_").isidentifier() or key in (*TAKEN, *MAY_BE_GIVEN):
            known = f"; {key} is the recording's own" if key in TAKEN else ""
            raise ReplayError(f"--meta {text}: expected KEY=VALUE, as fluid=water{known}")
        metadata[key] = value
    return {key: value for key, value in metadata.items() if value}


def note_run(args: argparse.Namespace, recording: Path) -> None:
    """The same notes, and the tags, beside the recording, where straw runs shows and changes them."""
    for text in args.note:
        say(recording, "note", text)
    for tag in args.tag:
        say(recording, "tag", tag)
