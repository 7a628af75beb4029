"""Provenance: which software made a recording, down to the commit and whether it was changed since."""

from __future__ import annotations

import platform
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGES = ("straw", "numpy", "scipy", "opencv-contrib-python-headless", "pyserial", "mcap", "protobuf", "numba", "av")


@cache
def software() -> dict[str, str]:
    """Versions of Python, the system and the main dependencies; ``git_commit`` where it runs from a clone.

    ``git_dirty`` is "true" when files that git tracks differ from that commit.
    """
    found = {"python": platform.python_version(), "system": platform.platform()}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed"
    if commit := _git("rev-parse", "HEAD"):
        found["git_commit"] = commit
        found["git_dirty"] = str(bool(_git("status", "--porcelain", "--untracked-files=no"))).lower()
    return found


def version_line() -> str:
    """The installed version; in a clone also the commit it runs from, as an editable install keeps its old version."""
    line = f"straw {metadata.version('straw')}"
    if commit := _git("rev-parse", "--short=7", "HEAD"):
        changed = ", changed since" if _git("status", "--porcelain", "--untracked-files=no") else ""
        line += f" (commit {commit}{changed})"
    return line


def _git(*arguments: str) -> str:
    """Git's output about the checkout this file belongs to; empty where there is none."""
    root = Path(__file__).parents[1]
    if not (root / ".git").exists():  # an installed package may lie inside another project's repository
        return ""
    try:
        # without locks, as a killed run or a full disk would leave one behind
        command = ["git", "--no-optional-locks", "-C", str(root), *arguments]
        said = subprocess.run(command, capture_output=True, text=True, timeout=5.0)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return said.stdout.strip() if said.returncode == 0 else ""
