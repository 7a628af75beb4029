"""The package as the project declares it: its folders and dependencies, and what its modules import."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOMS = ("model", "replay", "rig", "tracking")


def tracked(repository: Path) -> list[str]:
    """Files of the checkout; without git there is nothing to compare with."""
    if not (repository / ".git").exists():
        pytest.skip("not a git checkout")
    named = subprocess.check_output(["git", "-C", str(repository), "ls-files"], text=True).splitlines()
    return [name for name in named if (repository / name).is_file() and not name.startswith(".ci/")]


def test_every_folder_of_code_is_listed_as_a_package(repository: Path) -> None:
    setuptools = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    api = repository / setuptools["package-dir"]["straw"]
    folders = {p.parent for room in ROOMS for p in (repository / room).rglob("__init__.py")} - {api}
    there = {"straw." + ".".join(p.relative_to(repository).parts) for p in folders} | {"straw"}
    assert sorted(setuptools["packages"]) == sorted(there)


def test_the_constraints_pin_every_dependency_to_a_version_that_is_allowed(repository: Path) -> None:
    """Those for development only and of the second finite-element code, which no laboratory needs, are left out."""
    project = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = {k: v for k, v in project["optional-dependencies"].items() if k not in ("dev", "second-code")}
    lines = (repository / ".github" / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = dict(line.lower().split("==") for line in lines if not line.startswith("#"))
    for wanted in map(Requirement, [*project["dependencies"], *(one for extra in extras.values() for one in extra)]):
        if wanted.name != "straw":
            assert wanted.specifier.contains(pins[wanted.name.lower()]), wanted


def test_importing_straw_loads_nothing_that_is_heavy() -> None:
    code = "import sys; before = set(sys.modules); import straw; print(len(set(sys.modules) - before), dir(straw))"
    count, _, names = subprocess.check_output([sys.executable, "-c", code], text=True).partition(" ")
    assert int(count) < 20
    assert "simulate" in names


def test_no_files_import_each_other_in_a_circle(repository: Path) -> None:
    """As they are loaded: what is imported within a function, or for types only, comes later."""
    files = {
        "straw." + name[:-3].replace("/", ".").removesuffix(".__init__"): name
        for name in tracked(repository)
        if name.startswith(tuple(f"{room}/" for room in ROOMS)) and name.endswith(".py")
    }
    uses = {module: imported(repository / name) & set(files) - {module} for module, name in files.items()}
    while free := {module for module, used in uses.items() if not used & set(uses)}:
        uses = {module: used for module, used in uses.items() if module not in free}
    assert sorted(uses) == []


def imported(path: Path) -> set[str]:
    """Modules of straw that a file imports when it is loaded."""
    found: set[str] = set()
    waiting: list[ast.stmt] = list(ast.parse(path.read_text(encoding="utf-8")).body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{name.name}" for name in node.names)}
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            waiting += node.orelse
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            waiting += [child for child in ast.iter_child_nodes(node) if isinstance(child, ast.stmt)]
    return found
