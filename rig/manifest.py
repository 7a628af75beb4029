"""Manifest: the SHA-256 of everything a run consists of, beside the run, in the form that ``sha256sum -c`` reads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from straw.rig.errors import RigError

SUFFIX = ".sha256"


@dataclass(frozen=True)
class Checked:
    """One file of a manifest: its path, and its fault in a few words, None when it is as recorded."""

    path: Path
    problem: str | None


def manifest_of(run: Path) -> Path:
    """Where the manifest of a recording lies."""
    return run.with_name(run.name + SUFFIX)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal; RigError when it cannot be read."""
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise RigError(f"{path} cannot be read: {error.strerror or error}; check the name") from None


def seal(run: Path, others: Iterable[Path] = ()) -> None:
    """Enter the run, if it is not there yet, and other files of it (video, camera, tracks) into its manifest.

    A file that is entered already with another sum is a RigError: sums in a manifest are never replaced.
    """
    entries = read_manifest(run)
    for path in (run, *others):
        name = _name(path, run.parent)
        if path is run and name in entries:
            continue
        found = sha256_of(path)
        if entries.setdefault(name, found) != found:
            raise RigError(f"{path} was changed since it was entered in {manifest_of(run)}; put the original back")
    lines = "".join(f"{digest}  {name}\n" for name, digest in entries.items())
    part = run.with_name(manifest_of(run).name + ".part")
    try:
        part.write_text(lines, encoding="utf-8", newline="\n")
        part.replace(manifest_of(run))
    except OSError as error:
        raise RigError(f"{manifest_of(run)} cannot be written: {error.strerror}; check space and rights") from None


def read_manifest(run: Path) -> dict[str, str]:
    """Digests by name, relative to the run's folder; empty where there is no manifest."""
    path = manifest_of(run)
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError) as error:
        raise RigError(f"manifest {path} cannot be read: {error}; restore it, or move it away") from None
    if not lines:
        raise RigError(f"manifest {path} is empty: it was cut; restore it, or move it away")
    entries = {}
    for number, line in enumerate(lines, 1):
        digest, _, name = line.partition("  ")
        if len(digest) != 64 or not name or set(digest) - set("0123456789abcdef"):
            raise RigError(f"manifest {path}, line {number} is damaged; restore it, or move it away")
        entries[name] = digest
    return entries


def check(run: Path) -> list[Checked]:
    """Every file of the manifest against its sum."""
    checked = []
    for name, digest in read_manifest(run).items():
        path = run.parent / name
        if not path.is_file():
            checked.append(Checked(path, "is missing"))
        else:
            checked.append(Checked(path, None if sha256_of(path) == digest else "was changed"))
    return checked


def _name(path: Path, folder: Path) -> str:
    """The path as the manifest says it: relative where it can be."""
    try:
        return path.resolve().relative_to(folder.resolve()).as_posix()
    except ValueError:
        return path.resolve().as_posix()
