"""Laws from outside the package: the files and installed packages that provide them. Imports nothing heavy.

The model is compiled with all its laws in it, so they are named before it is loaded: by ``STRAW_LAWS`` in the
environment (which processes that are started inherit), by `add_laws`, or by a package with an entry point
``straw.laws``.
"""

from __future__ import annotations

import os
import sys
from functools import cache
from importlib import util
from pathlib import Path
from typing import TYPE_CHECKING, Any

from straw.model.errors import ModelError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint
    from types import ModuleType

VARIABLE = "STRAW_LAWS"
GROUP = "straw.laws"


def files() -> list[Path]:
    """Files of laws that were named, in the order of their contents: the order of naming changes nothing."""
    named = {Path(text) for text in os.environ.get(VARIABLE, "").split(os.pathsep) if text}
    return sorted(named, key=lambda path: (sha256_of(path), str(path)))


def add_laws(*paths: str | Path) -> None:
    """Make the laws in these files part of the model, before anything of the model is loaded.

    Raises ModelError for a file that cannot be read, and where the model is loaded without one of them.
    """
    known = {sha256_of(path) for path in files()}
    new = [path for path in (Path(p).resolve() for p in paths) if sha256_of(path) not in known]
    if not new:
        return
    if "straw.model.terms" in sys.modules:
        raise ModelError(
            f"{new[0]}: the model is loaded without this law; start Python again and call "
            f"straw.add_laws({str(new[0])!r}) first, or set {VARIABLE}"
        )
    os.environ[VARIABLE] = os.pathsep.join(
        [*filter(None, os.environ.get(VARIABLE, "").split(os.pathsep)), *map(str, new)]
    )


def sha256_of(path: Path) -> str:
    """The SHA-256 of a law's file; ModelError where it cannot be read."""
    import hashlib

    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise ModelError(
            f"{path}: cannot read the law: {error.strerror}; check --laws, the straw file and STRAW_LAWS"
        ) from None


@cache
def packages() -> tuple[tuple[EntryPoint, Path], ...]:
    """Entry points of installed packages, with the file that each law is in, by name."""
    from importlib import metadata  # takes as long as all else that `straw --help` needs

    found = []
    for entry in sorted(metadata.entry_points(group=GROUP), key=lambda e: e.name):
        spec = util.find_spec(entry.module)
        if spec is None or spec.origin is None:
            raise ModelError(
                f"entry point {GROUP}: {entry.name} = {entry.value}: there is no such module; mend the package"
            )
        found.append((entry, Path(spec.origin)))
    return tuple(found)


def sources() -> list[Path]:
    """Every file that a law comes from: compiled code is kept by what they say."""
    return [*files(), *(path for _, path in packages())]


def laws_named_in(straw_file: Path) -> list[Path]:
    """Files of laws that a straw file names, without reading anything else of it; empty where it is no straw file."""
    given = _read(straw_file).get("laws", [])
    return [path for path, _ in laws_of(given, straw_file.parent, str(straw_file)) if path]


def files_named_in(straw_file: Path, key: str) -> list[Path]:
    """Files of other parts that a straw file names (``readers``, ``figures``); empty where it is no straw file."""
    return files_of(_read(straw_file).get(key, []), key, straw_file.parent, str(straw_file))


def files_of(given: object, key: str, folder: Path, name: str) -> list[Path]:
    """A list of files, from the straw file's folder; ModelError where it is none."""
    if not isinstance(given, list) or not all(isinstance(one, str) and one for one in given):
        raise ModelError(f'{name}: {key} = {given!r}, expected files, as {key} = ["my_{key.removesuffix("s")}.py"]')
    return [folder / one for one in given]


def straw_of_rig(rig_file: Path) -> Path | None:
    """The straw file that a rig file names, if it does."""
    straw = _read(rig_file).get("straw")
    return rig_file.parent / straw if isinstance(straw, str) else None


def _read(path: Path) -> dict[str, Any]:
    import tomllib

    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}  # the error is reported when all of the file is read


def laws_of(given: object, folder: Path, name: str) -> list[tuple[Path | None, str]]:
    """File and SHA-256 of each law that a straw file's ``laws`` names, "" where it does not say one.

    An entry is a file's name, from the straw file's folder, or a table with ``file`` and ``sha256``; one without a file
    is a law of an installed package.
    """
    found: list[tuple[Path | None, str]] = []
    for entry in given if isinstance(given, list) else [None]:
        table = {"file": entry} if isinstance(entry, str) else entry
        if not isinstance(table, dict) or not table or not all(isinstance(v, str) for v in table.values()):
            raise ModelError(f'{name}: laws = {given!r}, expected files of laws, as laws = ["my_law.py"]')
        found.append((folder / table["file"] if "file" in table else None, table.get("sha256", "")))
    return found


def module_of(path: Path, what: str) -> ModuleType:
    """Run a user's file as a module; ModelError, one line with its place, for any error in it."""
    name = f"straw_{what}_{path.stem}_{sha256_of(path)[:8]}"
    spec = util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ModelError(f"{path}: is no Python file; a {what} is a file ending in .py")
    module = util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except SyntaxError as error:
        raise ModelError(f"{path}: line {error.lineno}: {error.msg}") from None
    except Exception as error:
        raise ModelError(f"{path}: {said(error, path)}") from None
    except SystemExit:
        raise ModelError(f"{path}: ends Python when it is loaded; a {what} only defines things") from None
    return module


def said(error: BaseException, path: Path | None = None) -> str:
    """An exception of a user's code in one line, with the line it came from."""
    import traceback

    text = " ".join(str(error).split())
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if path and Path(f.filename) == path]
    where = f"line {lines[-1]}: " if lines else ""
    return where + (text if isinstance(error, ModelError) else f"{type(error).__name__}: {text}")
