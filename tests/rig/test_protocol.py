"""A protocol file determines exactly what is commanded, or is refused in one line that says why."""

import tracemalloc
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.signal

from straw.replay.cli import main
from straw.rig.errors import RigError
from straw.rig.limits import PressureLimits
from straw.rig.protocol_toml import load_protocol, protocol_from_toml
from tests.benchmarks.mutated_protocols import show

HEAD = 'pressure_unit = "kPa"\ninitial_deployed = [1, 4]\n'
HOLD = "[[main]]\nhold = 0\nfor_s = 1\n"


def test_the_papers_folding_run_is_compiled_as_written() -> None:
    protocol = load_protocol(str(files("straw.rig") / "protocols" / "fold-25kPa.toml"))
    assert protocol.initial_deployed == (1, 4)
    assert (protocol.duration_s, protocol.zero_s) == (6.0, 0.5)
    np.testing.assert_array_equal(
        protocol(np.array([-1.0, 0.0, 0.499, 0.5, 5.499, 5.5, 6.0, 99.0])), [0, 0, 0, -25e3, -25e3, 0, 0, 0]
    )
    np.testing.assert_array_equal(protocol.steps_s, [0.5, 5.5])


def test_every_shipped_protocol_loads() -> None:
    shipped = sorted(Path(str(files("straw.rig") / "protocols")).glob("*.toml"))
    assert len(shipped) >= 2
    assert [load_protocol(path).name for path in shipped] == [path.stem for path in shipped]


def test_ramps_are_straight_and_rows_hold_until_the_next_row() -> None:
    protocol = protocol_from_toml(
        'pressure_unit = "mbar"\ninitial_deployed = []\n'
        "main = [{ ramp = [0, 100], for_s = 2 }, { rows = [[0, 50], [0.5, -50]], for_s = 1 }]",
        "p.toml",
    )
    assert protocol(1.0) == pytest.approx(5e3)
    np.testing.assert_allclose(
        protocol(np.array([2.0, 2.4999, 2.5, 2.9, 3.0, 4.0])), [5e3, 5e3, -5e3, -5e3, -5e3, -5e3]
    )
    assert protocol.duration_s == 3.0


def test_a_last_row_without_for_s_marks_the_end() -> None:
    protocol = protocol_from_toml(HEAD + "[[main]]\nrows = [[0, 1], [2, 0]]", "p.toml")
    assert protocol.duration_s == 2.0
    np.testing.assert_array_equal(protocol(np.array([1.9, 2.0, 3.0])), [1e3, 0.0, 0.0])


MAIN = HEAD + "main = ["


def test_a_sine_is_approximated_to_a_thousandth_of_its_amplitude() -> None:
    entry = "{ sine = { mean = 2, amplitude = 10, frequency_hz = 0.7, phase_deg = 30 }, for_s = 3.3 }]"
    protocol = protocol_from_toml(MAIN + entry, "p.toml")
    time_s = np.linspace(0, 3.3, 20_001)[:-1]
    truth_pa = 2e3 + 10e3 * np.sin(2 * np.pi * 0.7 * time_s + np.pi / 6)
    assert np.abs(protocol(time_s) - truth_pa).max() <= 10e3 * (1 - np.cos(np.pi / 72)) * 1.001
    assert protocol.duration_s == 3.3


@pytest.mark.parametrize("sweep", ["linear", "logarithmic"])
@pytest.mark.parametrize(("f0", "f1"), [(0.1, 3.0), (3.0, 0.1)])
def test_a_chirp_is_scipys_and_ends_on_time(sweep: str, f0: float, f1: float) -> None:
    chirp = f'chirp = {{ amplitude = 5, from_hz = {f0}, to_hz = {f1}, sweep = "{sweep}" }}'
    protocol = protocol_from_toml(MAIN + f"{{ {chirp}, for_s = 10 }}, {{ hold = 1, for_s = 1 }}]", "p.toml")
    time_s = np.linspace(0, 10, 40_001)[:-1]
    truth_pa = 5e3 * scipy.signal.chirp(time_s, f0, 10.0, f1, method=sweep, phi=-90)
    # A chord over a phase step d deviates from a sine by d^2 / 8; where a linear sweep starts slowly, its phase is a
    # parabola within the chord, which adds up to d / 4.
    step = 2 * np.pi / 72
    assert np.abs(protocol(time_s) - truth_pa).max() <= 5e3 * (step**2 / 8 + (step / 4 if sweep == "linear" else 1e-4))
    assert protocol.duration_s == 11.0
    assert protocol(10.0) == 1e3


def test_a_prbs_is_balanced_white_and_the_same_for_the_same_seed() -> None:
    def bits(seed: int) -> Any:
        entry = f"{{ prbs = {{ low = -5, high = 5, bit_s = 0.1, order = 7, seed = {seed} }}, for_s = 12.7 }}]"
        return protocol_from_toml(MAIN + entry, "p.toml")(np.arange(127) * 0.1 + 0.05) / 5e3

    one = bits(3)
    assert set(one) == {-1.0, 1.0}
    assert abs(one.sum()) == 1  # a maximum-length sequence has one more of one level than of the other
    correlation = [float(np.dot(one, np.roll(one, k))) for k in range(1, 127)]
    assert correlation == [-1.0] * 126
    assert np.array_equal(one, bits(3))
    assert not np.array_equal(one, bits(4))


def test_repeats_nest_and_are_checked_inside() -> None:
    inner = "{ repeat = 2, do = [{ hold = 1, for_s = 0.5 }, { ramp = [1, 2], for_s = 0.5 }] }"
    protocol = protocol_from_toml(MAIN + f"{{ repeat = 3, do = [{inner}, {{ hold = 0, for_s = 1 }}] }}]", "p.toml")
    assert protocol.duration_s == 9.0
    np.testing.assert_allclose(protocol(np.array([0.2, 0.75, 1.2, 1.75, 2.5, 3.2])), [1e3, 1.5e3, 1e3, 1.5e3, 0, 1e3])


@pytest.mark.parametrize(("unit", "pa"), [("Pa", 2.0), ("mbar", 200.0), ("kPa", 2000.0)])
def test_units_are_converted(unit: str, pa: float) -> None:
    text = f'pressure_unit = "{unit}"\ninitial_deployed = []\nmain = [{{ hold = 2, for_s = 1 }}]'
    assert protocol_from_toml(text, "p.toml")(0.5) == pa


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + "[[main]]\nhold = nan\nfor_s = 1", ["[[main]] entry 1", "hold", "nan"]),
        (HEAD + HOLD + "[[main]]\nhold = inf\nfor_s = 1", ["[[main]] entry 2", "inf"]),
        (HEAD + "[[main]]\nhold = '5'\nfor_s = 1", ["hold = '5'", "not a number"]),
        (HEAD + "[[main]]\nhold = true\nfor_s = 1", ["hold = True", "not a number"]),
        (HEAD + f"[[main]]\nhold = 1{'0' * 400}\nfor_s = 1", ["hold", "finite"]),
        (HEAD + "[[main]]\nhold = 61\nfor_s = 1", ["[[main]] entry 1", "61 kPa is above the limit of 60 kPa"]),
        (HEAD + "[[main]]\nhold = -41\nfor_s = 1", ["-41 kPa is below the limit of -40 kPa", "lower it"]),
        (HEAD + "[limits]\nmax = 20\n[[main]]\nramp = [0, 21]\nfor_s = 1", ["at 1 s 21 kPa is above"]),
        (HEAD + "[limits]\nmax_rate = 5\n[[main]]\nramp = [0, 10]\nfor_s = 1", ["10 kPa/s", "slower ramp"]),
        (HEAD + "[limits]\nmax_rate = 5\n[[main]]\nhold = 10\nfor_s = 1", ["a step of 10 kPa", "ramp"]),
        (HEAD + "[limits]\nmaximum = 5\n" + HOLD, ["[limits]", "unknown key 'maximum'", "max_rate"]),
        (HEAD + "[limits]\nmin = 5\n" + HOLD, ["[limits]", "contain 0"]),
        (HEAD + "[[main]]\nhold = 0\nfor_s = 0", ["for_s = 0", "above 0"]),
        (HEAD + "[[main]]\nhold = 0\nfor_s = -1", ["for_s = -1"]),
        (HEAD + "[[main]]\nhold = 0", ["for_s is missing"]),
        (HEAD + "[[main]]\nhold = 0\nramp = [0, 1]\nfor_s = 1", ["hold and ramp", "exactly one"]),
        (HEAD + "[[main]]\nfor_s = 1", ["none of hold, ramp, rows"]),
        (HEAD + "[[main]]\nramp = [0]\nfor_s = 1", ["[from, to]"]),
        (HEAD + "[[main]]\nrows = [[0, 1], [0, 2]]\nfor_s = 1", ["row 2", "sort"]),
        (HEAD + "[[main]]\nrows = [[1, 1]]\nfor_s = 2", ["row 1", "write 0"]),
        (HEAD + "[[main]]\nrows = [[0, 1], [3, 1]]\nfor_s = 2", ["before its last row"]),
        (HEAD + "[[main]]\nrows = 3\nfor_s = 2", ["rows must be"]),
        (HEAD + "[[main]]\nhold = 0\nfor_s = 1\nfor_m = 2", ["unknown key 'for_m'", "for_s"]),
        (MAIN + "{ sine = 3, for_s = 1 }]", ["sine = 3", "table"]),
        (MAIN + "{ sine = { amplitude = 1 }, for_s = 1 }]", ["sine lacks frequency_hz"]),
        (MAIN + "{ sine = { amplitude = 1, frequency_hz = 0 }, for_s = 1 }]", ["frequency_hz = 0", "above 0"]),
        (MAIN + "{ sine = { amplitude = 61, frequency_hz = 1 }, for_s = 1 }]", ["above the limit of 60 kPa"]),
        (MAIN + "{ sine = { amplitude = 1, frequency_hz = 1e9 }, for_s = 1 }]", ["1000000 points"]),
        (MAIN + "{ sine = { amplitude = 1, hz = 1 }, for_s = 1 }]", ["unknown key 'hz'"]),
        (MAIN + "{ chirp = { amplitude = 1, from_hz = 1, to_hz = 1 }, for_s = 1 }]", ["write a sine"]),
        (MAIN + "{ chirp = { amplitude = 1, from_hz = 1, to_hz = 2, sweep = 'x' }, for_s = 1 }]", ["linear"]),
        (MAIN + "{ prbs = { low = 0, high = 1, bit_s = 0.1, order = 40 }, for_s = 1 }]", ["order = 40"]),
        (MAIN + "{ prbs = { low = 0, high = 1 }, for_s = 1 }]", ["prbs lacks bit_s"]),
        (MAIN + "{ repeat = 2, for_s = 1 }]", ["needs do"]),
        (MAIN + "{ repeat = 2, do = [{ hold = 99, for_s = 1 }] }]", ["main", "do entry 1", "99 kPa is above"]),
        (MAIN + "{ repeat = 10_000_000, do = [{ hold = 0, for_s = 1 }] }]", ["1000000 points"]),
        (MAIN + "{ hold = 1, do = [], for_s = 1 }]", ["unknown key 'do'"]),
        (HEAD + "[[mian]]\nhold = 0\nfor_s = 1", ["unknown key 'mian'"]),
        (HEAD + "main = 3", ["[[main]] entries"]),
        (HEAD + "main = []", ["main is empty"]),
        (HEAD, ["main is missing"]),
        ("initial_deployed = []\n" + HOLD, ["pressure_unit is missing"]),
        ('pressure_unit = "bar"\ninitial_deployed = []\n' + HOLD, ["'bar'", "kPa"]),
        ("pressure_unit = 3\ninitial_deployed = []\n" + HOLD, ["pressure_unit = 3"]),
        ('pressure_unit = "Pa"\ninitial_deployed = "1,4"\n' + HOLD, ["initial_deployed", "[1, 4]"]),
        ('pressure_unit = "Pa"\ninitial_deployed = [1, 1]\n' + HOLD, ["twice"]),
        ('pressure_unit = "Pa"\ninitial_deployed = [0]\n' + HOLD, ["at least 1"]),
        ('pressure_unit = "Pa"\n' + HOLD, ["initial_deployed is missing"]),
        (HEAD + "cycle = -1\n" + HOLD, ["cycle = -1"]),
        (HEAD + "channel = 1.5\n" + HOLD, ["channel = 1.5"]),
        (HEAD + "name = 3\n" + HOLD, ["name = 3"]),
        (HEAD + "limits = 3\n" + HOLD, ["[limits]"]),
        ("not toml at all", ["not valid TOML"]),
    ],
)
def test_an_error_is_one_line_that_names_its_place(text: str, words: list[str]) -> None:
    with pytest.raises(RigError) as caught:
        protocol_from_toml(text, "bad.toml")
    message = str(caught.value)
    assert message.startswith("bad.toml")
    assert "\n" not in message
    assert [word for word in words if word not in message] == []


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(RigError, match=r"missing\.toml cannot be read"):
        load_protocol(tmp_path / "missing.toml")
    with pytest.raises(RigError, match="cannot be read"):
        load_protocol(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RigError, match="not a text file"):
        load_protocol(tmp_path / "binary.toml")


def test_combined_limits_are_never_wider_than_either() -> None:
    both = PressureLimits(-10e3, 50e3, 5e3).and_also(PressureLimits(-20e3, 30e3))
    assert both == PressureLimits(-10e3, 30e3, 5e3)


def test_the_cost_of_showing_sixty_days_is_that_of_their_points(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "long.toml"
    cycle = "{ hold = -25, for_s = 43200 }, { ramp = [-25, 35], for_s = 20000 }, { hold = 35, for_s = 23200 }"
    path.write_text(HEAD + f"[[main]]\nrepeat = 60\ndo = [{cycle}]\n")
    tracemalloc.start()
    assert main(["rig", "show", str(path), "-o", str(tmp_path / "long.png")]) == 0
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 100e6  # the pixels of the picture, not 41 GB for a sample per millisecond
    assert "5.184e+06 s (60 days)" in capsys.readouterr().out
    assert len(load_protocol(path).time_s) == 360


def test_mutated_protocols_end_with_0_or_with_2_and_one_line() -> None:
    assert [one.problem for one in map(show, range(12)) if one.problem] == []  # the benchmark tries a thousand


def test_a_protocol_of_excessive_duration_is_refused() -> None:
    with pytest.raises(RigError, match="longer than 1e\\+09 s; check for_s"):
        protocol_from_toml(HEAD + "[[main]]\nhold = 0\nfor_s = 1e300", "bad.toml")
