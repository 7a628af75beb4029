"""The installed package: `straw` alone, beside a user's own model.py, with all its files, from a wheel and editable."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from straw.replay.cli import parser
from tests.replay.test_package import ROOMS, tracked

PROTOCOL = 'name = "p"\npressure_unit = "kPa"\ninitial_deployed = [1, 4]\n[[main]]\nhold = -5\nfor_s = 0.02\n'
API = """
import straw
run = straw.simulate(straw.load_straw(None), straw.load_protocol("p.toml"), [0.0, 0.01], [1, 4])
print(straw.__version__, run.x_m.shape)
"""
#: Help of each of the commands given as a list of their words.
HELP = """
import ast, contextlib, sys
from straw.replay.cli import main
for words in ast.literal_eval(sys.argv[1]):
    with contextlib.suppress(SystemExit):
        main([*words, "--help"])
"""


@pytest.fixture(scope="module")
def wheel(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of the checkout, built in a copy so that no build files are left in the checkout."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for name in tracked(repository):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(repository / name, source / name)
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(out), str(source)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode and ("No matching distribution" in done.stderr or "No module named pip" in done.stderr):
        pytest.skip("pip cannot get setuptools here")
    assert done.returncode == 0, done.stderr
    return next(out.glob("*.whl"))


@pytest.fixture(scope="module", params=["wheel", "editable"])
def installed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment in which the command `straw` is found, and STRAW, the command."""
    if request.param == "editable":
        return {"STRAW": str(Path(sys.executable).with_name("straw"))}
    site = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(site)]
    subprocess.run([*command, str(request.getfixturevalue("wheel"))], check=True, capture_output=True)
    # interpreted: machine code is cached by place, and compiling for this one would take a minute
    return {"PYTHONPATH": str(site), "STRAW": str(site / "bin" / "straw"), "NUMBA_DISABLE_JIT": "1"}


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """A user's folder, whose files have the rooms' names and raise when they are imported."""
    for name in (*ROOMS, "operator_panel", "errors"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('somebody else')\n")
    (tmp_path / "p.toml").write_text(PROTOCOL)
    return tmp_path


def commands() -> Iterator[list[str]]:
    """Every command's words, as `rig run`."""

    def below(p: object, words: list[str]) -> Iterator[list[str]]:
        yield words
        for action in getattr(p, "_actions", ()):
            if isinstance(getattr(action, "choices", None), dict):
                for name, sub in action.choices.items():
                    yield from below(sub, [*words, name])

    return below(parser(), [])


def asked(installed: dict[str, str], folder: Path, *command: str) -> str:
    """What a command prints in a folder; it must succeed."""
    environment = {**os.environ, **installed}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, (command, done.stderr)
    return done.stdout


def test_the_wheel_holds_straw_alone_with_every_file_of_the_rooms(repository: Path, wheel: Path) -> None:
    names = {n for n in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in n}
    api = "replay/api/straw/"
    rooms = [n for n in tracked(repository) if n.startswith(tuple(f"{room}/" for room in ROOMS))]
    assert names == {f"straw/{n.removeprefix(api)}" if n.startswith(api) else f"straw/{n}" for n in rooms}


def test_the_wheel_carries_types_and_the_licences_of_vendored_files(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert "straw/py.typed" in names
    licences = {n.partition(".dist-info/licenses/")[2] for n in names if ".dist-info/licenses/" in n}
    assert licences == {"LICENSE", "replay/report/vendor/uPlot.LICENSE"}


def test_without_git_and_tags_the_version_is_that_of_the_next_release(repository: Path, wheel: Path) -> None:
    """The version that CITATION and the CHANGELOG's first heading name."""
    settings = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools_scm"]
    release = settings["fallback_version"].removesuffix(".dev0")
    assert wheel.name.split("-")[1] == f"{release}.dev0"
    texts = {
        name: (repository / ".github" / name).read_text(encoding="utf-8") for name in ("CITATION.cff", "CHANGELOG.md")
    }
    assert f"\nversion: {release}\n" in texts["CITATION.cff"]
    assert texts["CHANGELOG.md"].partition("\n## ")[2].startswith(release)


def test_every_command_answers_beside_files_of_the_rooms_names(installed: dict[str, str], foreign: Path) -> None:
    """The command itself, and all its subcommands in one process, with the folder first on its path."""
    assert asked(installed, foreign, installed["STRAW"], "--help").startswith("usage: straw")
    every = list(commands())
    said = asked(installed, foreign, sys.executable, "-c", HELP, repr(every))
    assert said.count("usage: straw") == len(every)


def test_every_module_is_imported_from_straw_beside_files_of_the_rooms_names(
    installed: dict[str, str], foreign: Path, repository: Path
) -> None:
    """In one process, with the folder first on its path."""
    names = [
        "straw." + name[:-3].replace("/", ".").removesuffix(".__init__")
        for name in tracked(repository)
        if name.startswith(tuple(f"{room}/" for room in ROOMS))
        and name.endswith(".py")
        and "api/straw" not in name
        and "/examples/" not in name
    ]
    code = f"import sys, importlib\nfor n in {names}: importlib.import_module(n)\n"
    code += f"print(sorted(set(sys.modules) & set({ROOMS})), sys.modules['straw.model'].__file__)"
    said = asked(installed, foreign, sys.executable, "-c", code)
    assert said.startswith("[]")
    assert installed.get("PYTHONPATH", str(repository)) in said


def test_the_command_and_the_api_simulate_beside_files_of_the_rooms_names(
    installed: dict[str, str], foreign: Path
) -> None:
    out = foreign / "o.mcap"
    asked(installed, foreign, installed["STRAW"], "simulate", "--protocol", "p.toml", "-o", str(out))
    assert out.exists()
    metadata = "import importlib.metadata as m; print(m.version('straw'))"
    recorded = asked(installed, foreign, sys.executable, "-c", metadata)
    assert asked(installed, foreign, sys.executable, "-c", API).split() == [recorded.strip(), "(2,)"]


def test_the_processes_that_vent_start_beside_files_of_the_rooms_names(
    installed: dict[str, str], foreign: Path
) -> None:
    """A standby without orders ends with 0 if it was imported from the package."""
    code = "from straw.rig.detached import start_detached; p = start_detached('straw.rig.standby', answers=False); "
    assert asked(installed, foreign, sys.executable, "-c", f"{code}p.stdin.close(); print(p.wait(30))") == "0\n"


def test_a_run_with_its_guardian_works_beside_files_of_the_rooms_names(foreign: Path) -> None:
    out = foreign / "r.mcap"
    asked({}, foreign, sys.executable, "-m", "straw", "rig", "run", "p.toml", "--emulate", "-o", str(out))
    assert out.exists()
