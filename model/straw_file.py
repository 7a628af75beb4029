"""Straw files: a straw read from TOML, with the laws and parts that it names checked; `to_toml` writes one."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from straw.model import plugged
from straw.model.elasticity import EQUATION_7, SHIPPED
from straw.model.errors import ModelError
from straw.model.parameters import PER_FRUSTUM, StrawParameters
from straw.model.terms import ORIGINS

#: Keys of a straw file that name files of parts besides laws.
PARTS = ("readers", "figures")


def straw_from_toml(text: str, name: str = "straw file", folder: Path | None = None) -> StrawParameters:
    """A straw from TOML text: any of the constants by name, the paper's value for each one left out.

    Files that it names are looked for from ``folder``.
    """
    try:
        table: Mapping[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ModelError(f"{name}: not TOML: {error}") from None
    _check_laws(table.get("laws", []), folder or Path(), name)
    parts = {}
    for key in PARTS:
        files = plugged.files_of(table.get(key, []), key, folder or Path(), name)
        parts[key] = tuple(str(file.resolve() if folder else file) for file in files)
    table = {key: value for key, value in table.items() if key not in ("laws", *PARTS)}
    known = {f.name: f.type for f in fields(StrawParameters)}
    for key, value in table.items():
        if key not in known:
            raise ModelError(f"{name}: unknown key {key!r}; known: {', '.join(known)}")
        wanted = {"cells": int, "form": str, "elasticity": str, "terms": dict}.get(
            key, list if key in PER_FRUSTUM else float
        )
        accepted = {list: (list, int, float), float: (int, float)}.get(wanted, (wanted,))
        if isinstance(value, bool) or not isinstance(value, accepted):
            expected = "a text" if wanted is str else "tables [terms.NAME]" if wanted is dict else "a number"
            raise ModelError(f"{name}: {key} = {value!r}, expected {expected}")
    if folder and table.get("elasticity", EQUATION_7) not in (EQUATION_7, SHIPPED):
        table = {**table, "elasticity": str((folder / table["elasticity"]).resolve())}
    try:
        return StrawParameters(**table, readers=parts["readers"], figures=parts["figures"])
    except ModelError as error:
        raise ModelError(f"{name}: {error}") from None


def _check_laws(given: object, folder: Path, name: str) -> None:
    """Raise ModelError unless the laws that a straw file names are part of the model, unchanged."""
    loaded = {origin.sha256 for origin in ORIGINS.values()}
    for path, sha256 in plugged.laws_of(given, folder, name):
        if sha256 in loaded:
            continue
        if sha256 and (path is None or not path.exists() or plugged.sha256_of(path) != sha256):
            what = f"{path} has been changed or removed" if path else "the package is another version or not installed"
            raise ModelError(
                f"{name}: made with a law of SHA-256 {sha256[:12]}...: {what}; restore it, or leave out sha256"
            )
        if path and plugged.sha256_of(path) not in loaded:
            raise ModelError(
                f"{name}: its law {path} is not part of the model that is loaded; give --laws {path}, or call "
                f"straw.add_laws({str(path)!r}) before anything else"
            )


def load_straw(path: str | Path | None = None) -> StrawParameters:
    """The straw in a TOML file, the paper's for None; ModelError where it cannot be read or is not a straw."""
    if path is None:
        return StrawParameters()
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise ModelError(f"{path}: cannot read the straw file: {reason}") from None
    if not text.strip():
        raise ModelError(f"{path}: the straw file is empty; name a constant that differs, or leave the file out")
    return straw_from_toml(text, str(path), path.parent)
