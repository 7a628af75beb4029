"""Which runs of a campaign went into a fit and which were held out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from straw.replay.errors import ReplayError
from straw.rig.run import Run

FITTED, HELD_OUT = "fitted", "held out"


def roles_of(fitted: Sequence[str], runs: Sequence[Run]) -> dict[str, str]:
    """Role of every run by its SHA-256; empty where no run is named as fitted.

    ``fitted`` names runs by file or run id, or a JSON of ``straw identify runs`` or ``straw diagnose``.
    ReplayError for a name that is none of the runs.
    """
    if not fitted:
        return {}
    names = [name for text in fitted for name in (_told(Path(text)) if text.endswith(".json") else [text])]
    known = {name for run in runs for name in _names(run)}
    if unknown := [name for name in names if name not in known and not fitted[0].endswith(".json")]:
        raise ReplayError(f"--fitted {unknown[0]}: none of the runs given; known: {', '.join(r.run_id for r in runs)}")
    return {run.sha256: FITTED if set(names) & _names(run) else HELD_OUT for run in runs}


def _names(run: Run) -> set[str]:
    return {run.run_id, str(run.path), run.path.name, run.path.stem}


def _told(path: Path) -> list[str]:
    """Run ids of the joint fit in a JSON file."""
    try:
        data: Any = json.loads(path.read_text(encoding="utf-8"))
        names = data["joint"]["runs"] if "joint" in data else data["fit"]["train"]["runs"]
        return [str(name) for name in names]
    except OSError as error:
        raise ReplayError(f"{path}: cannot be read: {error.strerror}; check the name") from None
    except (ValueError, KeyError, TypeError):
        raise ReplayError(f"{path}: holds no fit; give --json of straw identify runs or straw diagnose") from None
