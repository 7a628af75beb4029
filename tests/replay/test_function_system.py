"""A user's own system: each defect of its file is one line, it is fitted, and a planted missing law is found."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from straw.replay.cli import main
from straw.replay.diagnose.discover.trial import of_all
from straw.replay.diagnose.systems.function.check import defects
from straw.replay.diagnose.systems.function.codes import ALONG, OF_SPEED
from straw.replay.diagnose.systems.function.laws import Law
from straw.replay.diagnose.systems.function.model import load_model
from straw.replay.diagnose.systems.function.noise import noise_of
from straw.replay.diagnose.systems.function.passed import passed, still_speeds, typical
from straw.replay.diagnose.systems.function.places import places, states
from straw.replay.diagnose.systems.function.read_recordings import read_recordings
from straw.replay.diagnose.systems.function.shapes import QUADRATIC
from straw.replay.diagnose.systems.function.system import FunctionSystem, first_value
from straw.replay.diagnose.systems.function.table import read_table
from straw.replay.errors import ReplayError

OSCILLATOR = '''
"""An oscillator that is taken to be linear."""
time = "t"
inputs = {"u": ("force", "N")}
channels = {"y": ("y", "m")}
constants = {"c": (0.5, "1/s", 0.05, 5.0), "k": (30.0, "1/s^2", 5.0, 200.0)}
start = {"y": "y", "v": (0.0, -5.0, 5.0)}
units = {"v": "m/s"}
hold_out = ["c"]
places = ["rate:v", "constant:k", "channel:y"]  # all by default; fewer are quicker
depends_on = ["y", "v"]

def slopes(t, x, u, c):
    return x.v, u.u - c.c * x.v - c.k * x.y
'''
STATIC = '''
"""A cylinder without friction."""
time = 100.0
inputs = {"p": ("p", "bar"), "s": ("s", "mm")}
channels = {"F": ("F", "N")}
constants = {"A": (40.0, "N/bar", 10.0, 100.0)}
places = ["channel:F", "constant:A"]
depends_on = ["s", "the rate of s", "p", "time"]

def shown(t, x, u, c):
    return c.A * u.p
'''
C, K, CUBIC, NOISE = 0.8, 40.0, 60.0, 2e-3


def written(folder: Path, name: str, columns: dict[str, np.ndarray]) -> Path:
    path = folder / f"{name}.csv"
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="")
    return path


def file(folder: Path, text: str) -> Path:
    path = folder / "my_system.py"
    path.write_text(text)
    return path


def oscillations(folder: Path, cubic: float) -> list[Path]:
    """Three recordings by another integrator, with noise."""
    rng, out, t = np.random.default_rng(3), [], np.arange(0, 12, 0.05)
    for name, size in (("a", 12.0), ("b", 20.0), ("c", 16.0)):
        phases = rng.uniform(0, 2 * np.pi, 6)
        force = size * np.mean([np.sin(w * t + p) for w, p in zip(np.linspace(2, 9, 6), phases, strict=True)], axis=0)

        def slope(at: float, x: np.ndarray, force: np.ndarray = force) -> list[float]:
            return [x[1], np.interp(at, t, force) - C * x[1] - K * x[0] - cubic * x[0] ** 3]

        y = solve_ivp(slope, (0, t[-1]), [0.1, 0.0], t_eval=t, rtol=1e-8, atol=1e-10, max_step=0.05).y[0]
        out.append(written(folder, name, {"t": t, "force": force, "y": y + NOISE * rng.normal(size=len(t))}))
    return out


def asked(system: Path, paths: list[Path], folder: Path, *more: str) -> tuple[int, dict]:
    out = folder / "findings.json"
    arguments = ["diagnose", *map(str, paths), "--system", str(system), "--json", str(out), *more]
    code = main(arguments)
    return code, json.loads(out.read_text())


def test_a_spring_that_stiffens_is_found_with_its_place_state_and_formula(tmp_path):
    system = file(tmp_path, OSCILLATOR)
    assert defects(system) == []
    page = tmp_path / "why.html"
    code, found = asked(system, oscillations(tmp_path, CUBIC), tmp_path, "--report", str(page))
    assert (code, found["verdict"]) == (1, "missing_physics")
    law = found["discovered"]["laws"][0]
    assert law["over"] == "y"
    assert law["place"] in ("rate:v", "constant:k")  # the same law in two forms, which is reported
    other = {"rate:v": "the constant k, over y", "constant:k": "the rate of v, over y"}[law["place"]]
    assert other in found["written_otherwise"]
    assert found["indistinguishable"] == []
    curve = np.array(law["curve"])
    force = curve[:, 1] if law["place"] == "rate:v" else -K * curve[:, 1] * curve[:, 0]
    # a linear part trades against k, so the law is compared beside the best straight line
    truth = -CUBIC * curve[:, 0] ** 3
    rest = force - truth - np.polyval(np.polyfit(curve[:, 0], force - truth, 1), curve[:, 0])
    assert np.sqrt(np.mean(rest**2)) < 0.15 * np.sqrt(np.mean(truth**2))
    held = found["fit"]["heldout"]
    assert held["rms_after"]["y"] < 1.3 * NOISE < held["rms_before"]["y"] / 3
    assert "(y)" not in law["formula"]  # a formula, not a curve
    assert "y" in page.read_text()


def test_nothing_is_missing_from_an_oscillator_that_is_linear(tmp_path):
    code, found = asked(file(tmp_path, OSCILLATOR), oscillations(tmp_path, 0.0), tmp_path)
    assert (code, found["verdict"], found["causes"]) == (0, "complete", [])
    constants = found["parameters"]["base"]
    assert constants["k"]["value"] == pytest.approx(K, rel=0.01)


def strokes(folder: Path) -> list[Path]:
    rng, out, t = np.random.default_rng(1), [], np.arange(0, 12, 0.01)
    for k, bar in enumerate((1.0, 4.0, 2.5)):
        s = 40 * np.sin(1.3 * t)
        p = bar + 0.3 * np.sin(2.1 * t)
        force = 50 * p + 6 * np.tanh(np.gradient(s, t) / 3) + 0.1 * rng.normal(size=len(t))
        out.append(written(folder, f"run{k}", {"p": p, "s": s, "F": force}))
    return out


def test_friction_is_found_over_the_rate_of_an_input_and_its_size_is_right(tmp_path):
    code, found = asked(file(tmp_path, STATIC), strokes(tmp_path), tmp_path)
    assert (code, found["verdict"]) == (1, "missing_physics")
    law = found["discovered"]
    assert (law["place"], law["over"]) == ("channel:F", "the rate of s")
    curve = np.array(law["curve"])
    assert curve[-1, 1] == pytest.approx(6, rel=0.05)
    assert curve[0, 1] == pytest.approx(-6, rel=0.05)
    scope: dict = {"np": np}
    exec(law["law"], scope)
    assert scope["law"](40.0) == pytest.approx(6, rel=0.05)


def test_a_users_own_law_in_a_plain_function_is_found_by_its_name(tmp_path):
    text = STATIC.replace('places = ["channel:F", "constant:A"]', 'places = []\nlaws = {"seal friction": ["f"]}')
    text = text.replace("100.0)}\n", '100.0), "f": (0.0, "N", -50.0, 50.0)}\n', 1)
    text = text.replace("def shown(t, x, u, c):\n    return c.A * u.p", "import numpy as np\n\ndef simulate(t, u, c):\n"
                        "    return c.A * u.p + c.f * np.tanh(np.gradient(u.s, t) / 3)")  # fmt: skip
    _, found = asked(file(tmp_path, text), strokes(tmp_path), tmp_path)
    assert found["causes"] == ["law:seal friction"]
    strength = found["parameters"]["law:seal friction"]["strength"]
    assert abs(strength["value"] - 6) < 3 * strength["sigma"]


def test_a_model_is_sent_to_workers_as_its_file(tmp_path):
    model = load_model(file(tmp_path, OSCILLATOR), [("c", 0.7, 0.6, 0.8)])
    assert pickle.loads(pickle.dumps(model)).constants == model.constants


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('channels = {"y": ("y", "m")}', "", "says no channels; add"),
        ("return x.v, u.u - c.c * x.v - c.k * x.y", "return x.v", "slopes returns 1 numbers for 2: y, v"),
        ("c.k * x.y", "c.q * x.y", "slopes(t, x, u, c) raised AttributeError"),
        ("c.k * x.y", "c.k * x.y / (x.y - 1.0)", "raised ZeroDivisionError"),
        ('"k": (30.0, "1/s^2", 5.0, 200.0)', '"k": (30.0, "1/s^2", 50.0, 200.0)', "is not within its range 50 to 200"),
        ('start = {"y": "y"', 'start = {"y": "z"', "no such channel; known: y"),
        ('units = {"v": "m/s"}', "", 'state v has no unit; add units = {"v": "..."}'),
        ("def slopes", "1/0\ndef slopes", "cannot be run: ZeroDivisionError"),
        ("def slopes", "def slopes(", "line 13: "),
        ("def slopes", "raise SystemExit\ndef slopes", "ends Python when it is loaded"),
        ('channels = {"y": ("y", "m")}', "channels = 3", "channels = 3; give a dict"),
        ('hold_out = ["c"]', 'laws = {"drag": ["q"]}', 'laws["drag"]: no constant q; add it'),
    ],
)
def test_each_defect_of_a_file_is_one_line_with_place_and_cure(tmp_path, old, new, says):
    assert old in OSCILLATOR
    (line, *_) = defects(file(tmp_path, OSCILLATOR.replace(old, new)))
    assert says in line
    assert "\n" not in line
    assert "my_system.py" in line


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("return x.v,", "return 1 / (u.u - u.u),", "slopes(t, x, u, c) raised ZeroDivisionError"),
        ("- c.k * x.y", "+ float('nan')", "slopes returns nan for v where recording a starts (y = 0.03, v = 0, u = 1)"),
        ("return x.v, ", "return ", "slopes returns 1 numbers for 2: y, v"),
        (
            'hold_out = ["c"]',
            "def hold_out(name, t, table):\n    return [True]",
            "gives shape (1,); give True or False",
        ),
        ('hold_out = ["c"]', "def hold_out(name, t, table):\n    return 1 / 0", "raised ZeroDivisionError"),
        ('hold_out = ["c"]', "def read(path):\n    return {}", "has no columns"),
        ('hold_out = ["c"]', "def read(path):\n    return {'t': ['a'] * 5}", 'column "t" is no column of numbers'),
        ('hold_out = ["c"]', "def read(path):\n    return {'t': [[0, 1]] * 5}", "t has shape (5, 2); expected (n,)"),
    ],
)
def test_errors_of_a_users_reader_are_one_line_and_exit_2(tmp_path, capsys, old, new, says):
    assert old in OSCILLATOR
    t = np.arange(8.0)
    path = written(tmp_path, "a", {"t": t, "force": 1.0 + t, "y": 0.03 + 0 * t})
    assert main(["diagnose", str(path), "--system", str(file(tmp_path, OSCILLATOR.replace(old, new)))]) == 2
    told = capsys.readouterr().err
    assert says in told
    assert len(told.strip().splitlines()) == 1


def test_a_heading_in_another_unit_than_the_systems_is_reported(tmp_path, capsys):
    t = np.arange(8.0)
    path = written(tmp_path, "a", {"t": t, "force": t, "y [mm]": t})
    assert main(["diagnose", str(path), "--system", str(file(tmp_path, OSCILLATOR))]) == 2
    assert 'column "y [mm]" is in mm, channel y in m; convert one of them' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("t,force\n0,1\n1,1\n", 'no column "y", which channel y wants; there are: t, force'),
        ("t,force,y\n0,1,1\n1,1,1\n1,1,1\n2,1,1\n3,1,1\n", "time stands or runs back at reading 3 (1)"),
        ("t,force,y\n0,1,\n1,1,\n2,1,1\n", "1 readings of at least 4"),
        ("t,force,y\n0,,1\n1,,1\n2,,1\n3,,1\n4,,1\n", "input u (force) has no number at all"),
        ("0,1,2\n1,2,3\n2,3,4\n", "has no line of names"),
    ],
)
def test_bad_readings_are_one_line_and_exit_2(tmp_path, capsys, rows, says):
    path = tmp_path / "readings.csv"
    path.write_text(rows)
    assert main(["diagnose", str(path), "--system", str(file(tmp_path, OSCILLATOR))]) == 2
    told = capsys.readouterr().err
    assert says in told
    assert "Traceback" not in told


def test_tables_are_read_as_loggers_write_them(tmp_path):
    path = tmp_path / "german.csv"
    path.write_text("\ufeff# Messung\nZeit [s];Druck [bar]\n0;1.013,5\n0,5;\n1;1,5\n", encoding="utf-8")
    table = read_table(path)
    np.testing.assert_array_equal(table["Zeit [s]"], [0, 0.5, 1])
    np.testing.assert_array_equal(table["Druck [bar]"], [1013.5, np.nan, 1.5])


def test_noise_is_estimated_under_a_moving_signal_and_a_converters_steps():
    rng = np.random.default_rng(0)
    t = np.linspace(0, 10, 2000)
    white = np.sin(t) + 0.02 * rng.normal(size=len(t))
    assert noise_of(white) == pytest.approx(0.02, rel=0.5)
    counted = np.round(np.sin(t) / 0.05) * 0.05
    assert noise_of(counted) == pytest.approx(0.05 / np.sqrt(12), rel=0.5)


def test_a_hold_out_of_an_unknown_recording_is_refused(tmp_path):
    model = load_model(file(tmp_path, STATIC))
    with pytest.raises(ReplayError, match="no such recording; known: run0, run1, run2"):
        read_recordings(model, strokes(tmp_path), ["friday"])


def test_an_equation_that_only_defines_another_state_is_no_place_of_a_law_unless_the_file_names_it(tmp_path):
    text = "\n".join(line for line in OSCILLATOR.splitlines() if not line.startswith(("places", "depends_on")))
    paths = oscillations(tmp_path, 0.0)
    for given, there in ((text, False), (text + '\nplaces = ["rate:y"]\n', True)):
        system = FunctionSystem(load_model(file(tmp_path, given)))
        recordings = read_recordings(system.model, paths)
        seen = passed(system, recordings, {})
        names = [one.name for one in places(system, seen)]
        assert ("rate:y" in names) == there
        assert ("rate:v" in names) == (not there)


def test_a_channel_that_moves_starts_where_it_is_first_seen_and_one_faulty_reading_does_no_harm():
    t = 0.1 * np.arange(30)
    noise = np.random.default_rng(1).normal(0, 0.01, 30)
    for course in (3.0 + 4.0 * t, 3.0 * np.cos(2.0 * t), 3.0 * np.cos(25.0 * t), 3.0 * np.exp(-8.0 * t)):
        assert first_value(t, course + noise) == pytest.approx(3.0, abs=0.1)
        for faulty in range(4):
            readings = course + noise
            readings[faulty] += 50.0
            if faulty or np.ptp(np.diff(course, 2)) < 0.2:  # a line leads back along a slow course only
                assert first_value(t, readings) == pytest.approx(3.0, abs=0.2)
    assert first_value(t[:2], 3.0 + 4.0 * t[:2]) == 3.0  # too few to tell


FALL = '''
"""A ball thrown."""
time = "t"
channels = {"x": ("x", "m"), "y": ("y", "m")}
start = {"x": "x", "y": "y", "vx": (8.0, 0.0, 20.0), "vy": (8.0, 0.0, 20.0)}

def slopes(t, x, u, c):
    return x.vx, x.vy, 0.0, -9.81
'''


def test_the_speed_of_a_body_without_forces_is_taken_from_what_is_measured(tmp_path):
    """In the base's simulation it stays as it starts, and no law over it could be told from a constant."""
    t = np.arange(0, 1.2, 1 / 60)
    speed = 9.0 * np.exp(-0.8 * t)
    columns = {"t": t, "x": (9.0 - speed) / 0.8, "y": 1.5 + 7.0 * t - 4.905 * t**2}
    system = FunctionSystem(load_model(file(tmp_path, FALL)))
    seen = passed(system, read_recordings(system.model, [written(tmp_path, "throw", columns)]), {})
    assert still_speeds(system, seen) == {system.model.states.index("vx"): system.model.states.index("x")}
    found = seen[0].states[system.model.states.index("vx")]
    np.testing.assert_allclose(found[3:-3], speed[3:-3], rtol=0.02)


@pytest.mark.parametrize("fall", [9.81, 0.05, 0.1])
def test_an_equation_that_is_constant_is_a_place_of_the_size_of_its_constant(tmp_path, fall):
    """Rounding gives equal values a standard deviation of some 1e-17, by which nothing would be found there."""
    t = np.arange(0, 1.2, 1 / 60)
    columns = {"t": t, "x": 9.0 * t, "y": 1.5 + 7.0 * t - fall / 2 * t**2}
    system = FunctionSystem(load_model(file(tmp_path, FALL.replace("9.81", str(fall)))))
    seen = passed(system, read_recordings(system.model, [written(tmp_path, "throw", columns)]), {})
    sizes = {one.name: one.size for one in places(system, seen)}
    assert sizes["rate:vy"] == pytest.approx(fall)
    assert typical(np.zeros(5)) == 1.0
    assert typical(np.array([1.0, 3.0, np.nan])) == pytest.approx(1.0)


PLANE = '''
"""A ball, filmed in a plane."""
time = "t"
channels = {"x": ("x", "m"), "y": ("y", "m")}
start = {"x": "x", "y": "y", "vx": (8.0, 0.0, 20.0), "vy": (8.0, -20.0, 20.0)}
units = {"x": "m", "y": "m", "vx": "m/s", "vy": "m/s"}

def slopes(t, x, u, c):
    return x.vx, x.vy, 0.0, -9.81
'''


def test_a_drag_by_the_square_of_the_speed_acts_along_the_motion(tmp_path):
    """The same path as by another integrator; the place and its state are among those of the search."""
    t = np.linspace(0.0, 1.0, 61)
    start, drag = (0.0, 1.5, 9.0, 6.0), 0.2

    def slopes(_, x):
        speed = np.hypot(x[2], x[3])
        return x[2], x[3], -drag * speed * x[2], -9.81 - drag * speed * x[3]

    truth = solve_ivp(slopes, (0.0, 1.0), start, t_eval=t, rtol=1e-10, atol=1e-12).y
    path = written(tmp_path, "throw", {"t": t, "x": truth[0], "y": truth[1]})
    system = FunctionSystem(load_model(file(tmp_path, PLANE)))
    recordings = read_recordings(system.model, [path])
    seen = passed(system, recordings, {})
    (place,) = (one for one in places(system, seen) if one.kind == ALONG)
    (state,) = (one for one in states(system, seen) if one.kind == OF_SPEED)
    assert place.says == "the rate of vx and vy, in their direction"
    assert state.name == "the magnitude of vx and vy"
    added = system.with_laws(Law(place, state, QUADRATIC))
    shown, _, _ = added.played(recordings[0], {"law.0.strength": -drag}, np.array(start))
    assert shown == pytest.approx(truth[:2], abs=1e-6)  # steps of a sixtieth of a second


def test_what_improves_one_channel_is_not_hidden_by_the_error_that_remains_in_another():
    assert of_all(np.array([4.0])) == pytest.approx(4.0)
    before, after = np.array([1e4, 9.0]), np.array([1e4, 1.0])
    assert of_all(after) / of_all(before) == pytest.approx(1 / 3)


def test_starts_of_which_only_the_sum_is_seen_are_no_singular_matrix(tmp_path):
    """Readings of a million with a noise of a millionth, beside which a prior is below rounding."""
    text = PLANE[: PLANE.index("channels")] + (
        'channels = {"y": ("y", "1")}\n'
        'start = {"a": (0.0, -1e9, 1e9), "b": (0.0, -1e9, 1e9)}\n\n'
        "def slopes(t, x, u, c):\n    return 0.0, 0.0\n\n"
        "def shown(t, x, u, c):\n    return x.a + x.b\n"
    )
    t = np.linspace(0.0, 1.0, 30)
    path = written(tmp_path, "sum", {"t": t, "y": 1e6 + 1e-6 * np.sin(40 * t)})
    system = FunctionSystem(load_model(file(tmp_path, text)))
    (recording,) = read_recordings(system.model, [path])
    shown, start = system.profiled(recording, {})
    assert shown == pytest.approx(np.full((1, 30), 1e6), abs=1.0)
    assert np.isfinite(start).all()
