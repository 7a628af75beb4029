"""Users' laws are part of the model without a change to the package; a file that is no law is refused in one line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from straw.model.errors import ModelError
from straw.model.law_file import laws_in, ready
from straw.model.plugged import add_laws, laws_of
from straw.model.terms import TERMS
from straw.replay.commands.check import compiles

STICKY = """
import math
from straw import Constant, Law

def force(f, k):
    x = f.zeta + abs(f.zeta0)
    return -k[0] * math.exp(-((x / k[1]) ** 2)), 0.0

def energy(f, k):
    return k[0] * k[1] * math.sqrt(math.pi) / 2 * math.erf((f.zeta + abs(f.zeta0)) / k[1])

LAW = Law(
    name="sticky",
    law="F = -F0 exp(-(x/l)^2)",
    source="a thesis, equation 3",
    constants=(Constant("force_n", "N", 0.0, 0.5, 10.0, "F0"), Constant("range_m", "m", 0.3e-3, 0.1e-3, 1e-3, "l")),
    force=force,
    energy=energy,
)
"""
PROTOCOL = 'name = "p"\npressure_unit = "kPa"\ninitial_deployed = [1, 4]\n[[main]]\nhold = -5\nfor_s = 0.02\n'
RETURNS = "return -k[0] * math.exp(-((x / k[1]) ** 2)), 0.0"


def test_a_valid_law_is_read_and_compiles(tmp_path: Path) -> None:
    (tmp_path / "sticky.py").write_text(STICKY)
    (law,) = laws_in(tmp_path / "sticky.py")
    assert law.strengths == ("force_n",)
    compiles("sticky.py", ready(law))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (STICKY, "", "gives no law"),
        (STICKY, "x = (", "line 1"),
        (STICKY, "import nothing_such", "ModuleNotFoundError"),
        (STICKY, "raise SystemExit", "ends Python"),
        ('source="a thesis, equation 3"', 'source=" "', "source is empty"),
        ('"force_n", "N"', '"force_n", ""', "force_n has no unit"),
        ('"N", 0.0, 0.5', '"N", 0.1, 0.5', "must be 0"),
        ("0.5, 10.0", "10.0, 0.5", "low must be below high"),
        ("0.3e-3, 0.1e-3, 1e-3", "3.0, 0.1e-3, 1e-3", "default 3 is outside"),
        ('name="sticky"', 'name="Sticky Faces"', "a word of small letters"),
        ("law=", 'kind="flow", law=', "kind = 'flow'"),
        (RETURNS, "raise ValueError('no')", "force raises ValueError: no"),
        (RETURNS, "return math.nan, 0.0", "force is nan N"),
        (RETURNS, "return -k[0]", "expected (force on zeta in N, moment on phi in N m)"),
        (RETURNS, "return -k[0], [0.0, 0.0]", "expected (force"),
        (RETURNS, "return 'a', 0.0", "expected two numbers"),
        (RETURNS, "return -k[9], 0.0", "force raises IndexError"),
        (RETURNS, "return -1.0 - k[0], 0.0", "acts with force_n = 0"),
        (RETURNS, "return 0.0, 0.0", "does nothing"),
        (RETURNS, "return -2 * k[0] * math.exp(-((x / k[1]) ** 2)), 0.0", "make them agree"),
        ("    energy=energy,", "", "gives energy"),
        ("force=force", "force=3", "force is no function"),
    ],
)
def test_an_error_in_a_law_is_one_line_with_its_file(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "sticky.py"
    path.write_text(STICKY.replace(old, new))
    with pytest.raises(ModelError) as refused:
        laws_in(path)
    said = str(refused.value)
    assert said.startswith(str(path))
    assert words in said
    assert "\n" not in said


def test_python_that_numba_cannot_compile_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "sticky.py"
    path.write_text(STICKY.replace(RETURNS, "import decimal\n    decimal.Decimal(1)\n    " + RETURNS))
    (law,) = laws_in(path)
    with pytest.raises(ModelError, match="force does not compile") as refused:
        compiles(str(path), ready(law))
    assert "\n" not in str(refused.value)


def test_a_law_added_after_loading_the_model_is_an_error_with_its_cure(tmp_path: Path) -> None:
    assert TERMS
    (tmp_path / "sticky.py").write_text(STICKY)
    with pytest.raises(ModelError, match=r"start Python again and call straw\.add_laws"):
        add_laws(tmp_path / "sticky.py")


@pytest.mark.parametrize("given", ["sticky.py", [3], [{}], [{"file": 3}]])
def test_the_error_of_a_straw_file_that_names_laws_wrongly_shows_the_right_form(given: object) -> None:
    with pytest.raises(ModelError, match=r'laws = \["my_law.py"\]'):
        laws_of(given, Path(), "s.toml")


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with a law, a straw that has it, and a protocol."""
    (tmp_path / "sticky.py").write_text(STICKY)
    (tmp_path / "p.toml").write_text(PROTOCOL)
    (tmp_path / "s.toml").write_text('laws = ["sticky.py"]\n[terms.sticky]\nforce_n = 3.0\n')
    return tmp_path


def ran(place: Path, *command: str, path: Path | None = None) -> subprocess.CompletedProcess[str]:
    """A separate process, since laws join the model when it is loaded; interpreted, as compiling takes a minute."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"} | ({"PYTHONPATH": str(path)} if path else {})
    return subprocess.run(
        [sys.executable, "-P", *command], cwd=place, env=environment, capture_output=True, text=True, check=False
    )


def simulated(place: Path, *more: str, path: Path | None = None) -> str:
    """Output of `straw simulate`, which must succeed."""
    (place / "o.mcap").unlink(missing_ok=True)
    done = ran(place, "-m", "straw", "simulate", "--protocol", "p.toml", "-o", "o.mcap", *more, path=path)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_straw_file_with_a_users_law_predicts_another_motion_and_records_the_law(place: Path) -> None:
    assert simulated(place) != simulated(place, "--straw", "s.toml")
    code = "import straw; print(straw.read_recording('o.mcap').metadata['straw'])"
    written = ran(place, "-c", code).stdout
    (place / "w.toml").write_text(written)
    assert 'sha256 = "' in written
    simulated(place, "--straw", "w.toml")
    (place / "sticky.py").write_text(STICKY + "# another day\n")
    done = ran(place, "-m", "straw", "simulate", "--protocol", "p.toml", "--straw", "w.toml", "-o", "n.mcap")
    assert done.returncode == 2
    assert "has been changed" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_law_named_on_the_command_line_is_known_to_the_straw_file(place: Path) -> None:
    (place / "bare.toml").write_text("[terms.sticky]\nforce_n = 3.0\n")
    assert simulated(place, "--straw", "bare.toml", "--laws", "sticky.py") == simulated(place, "--straw", "s.toml")


def test_a_law_of_an_installed_package_is_part_of_the_model(place: Path) -> None:
    site = place / "site"
    (site / "sticky-1.0.dist-info").mkdir(parents=True)
    (site / "sticky_pkg.py").write_text(STICKY)
    (site / "sticky-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: sticky\nVersion: 1.0\n")
    (site / "sticky-1.0.dist-info" / "entry_points.txt").write_text("[straw.laws]\nsticky = sticky_pkg\n")
    (place / "bare.toml").write_text("[terms.sticky]\nforce_n = 3.0\n")
    assert simulated(place, "--straw", "bare.toml", path=site) == simulated(place, "--straw", "s.toml")
    code = "import straw; print(straw.StrawParameters(terms={'sticky': {'force_n': 1.0}}).to_toml())"
    assert 'package = "sticky 1.0"' in ran(place, "-c", code, path=site).stdout


def test_a_users_law_is_a_hypothesis_whose_unknowns_come_from_its_constants(place: Path) -> None:
    code = """
import numpy as np, straw
straw.add_laws("sticky.py")
from straw.replay.diagnose.systems.straw.constants import applied
from straw.replay.diagnose.systems.straw.library import causes, hypothesis
unknowns, starts = causes(9)["sticky"]
print([u.target for u in unknowns], unknowns[0].scale, unknowns[1].value(unknowns[1].high))
what = hypothesis(["sticky"], 9)
for start in what.starts:
    print(applied(straw.StrawParameters(), what.unknowns, np.array(start))[0].terms["sticky"])
"""
    done = ran(place, "-c", code)
    lines = done.stdout.splitlines()
    assert lines[0] == "['term.sticky.force_n', 'term.sticky.range_m'] 0.5 0.001", done.stderr
    found = [eval(line) for line in lines[1:]]  # printed as plain dicts
    forces = [one["force_n"] for one in found]
    assert forces == sorted(forces)
    np.testing.assert_allclose([forces[0], forces[-1]], [0.15, 10.0])
    assert {one["range_m"] for one in found} == {0.3e-3}


def test_check_reports_a_valid_law_and_what_a_file_without_one_lacks(place: Path) -> None:
    done = ran(place, "-m", "straw", "check", "sticky.py")
    assert done.returncode == 0, done.stderr
    assert "law sticky is good" in done.stdout
    (place / "empty.py").write_text("")
    done = ran(place, "-m", "straw", "check", "empty.py")
    assert done.returncode == 2
    assert "defines none of LAW" in done.stderr
