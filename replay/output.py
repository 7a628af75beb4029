"""Output files: written whole or not at all, and JSON without NaN."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from straw.replay.errors import ReplayError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_text(path: Path, text: str) -> None:
    """Write a text file through ``.part`` and rename; ReplayError where the place cannot be written."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True) if part.is_file() else None
        raise ReplayError(f"{path}: cannot be written: {error.strerror}; choose another place") from None


def write_picture(figure: Figure, path: Path, dpi: int, option: str) -> None:
    """Save a figure; ReplayError that names the ``option`` for another place where it cannot be."""
    try:
        figure.savefig(path, dpi=dpi)
    except (OSError, ValueError) as error:
        raise ReplayError(f"{path}: the picture cannot be written: {error}; give another name with {option}") from None


def check_new(path: Path) -> None:
    """Raise ReplayError unless a recording can be made at a path; called before the work."""
    if path.exists():
        raise ReplayError(f"{path}: exists and is not overwritten; choose another name or move it away")
    if not path.parent.is_dir():
        raise ReplayError(f"{path}: there is no folder {path.parent}; make it or choose another place")


def check_places(*paths: Path | None, given: Sequence[Path] = ()) -> None:
    """Raise ReplayError unless results can be written over these paths, of which none is an input; called before the
    work."""
    for path in paths:
        if path is None:
            continue
        if path.is_dir():
            raise ReplayError(f"{path}: is a folder; give the name of a file in it")
        if not path.parent.is_dir():
            raise ReplayError(f"{path}: there is no folder {path.parent}; make it or choose another place")
        if any(path.exists() and one.exists() and path.samefile(one) for one in given):
            raise ReplayError(f"{path}: is one of the files to be read; choose another name for the result")


def write_json(path: Path, data: Any) -> None:
    """Write data as JSON; what is not a number becomes null."""
    write_text(path, json.dumps(finite(data), indent=1, allow_nan=False) + "\n")


def finite(data: Any) -> Any:
    """The same data with NaN and infinities as None, as JSON has no such numbers."""
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, dict):
        return {key: finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [finite(value) for value in data]
    return data
