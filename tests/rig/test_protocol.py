"""A protocol file says exactly what will be commanded, or one line says why not."""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from rig.errors import RigError
from rig.limits import PressureLimits
from rig.protocol import load_protocol, protocol_from_toml

HEAD = 'pressure_unit = "kPa"\ninitial_deployed = [1, 4]\n'
HOLD = "[[main]]\nhold = 0\nfor_s = 1\n"


def test_the_papers_folding_run_is_compiled_as_written() -> None:
    protocol = load_protocol(str(files("rig") / "protocols" / "fold-25kPa.toml"))
    assert protocol.initial_deployed == (1, 4)
    assert (protocol.duration_s, protocol.zero_s) == (6.0, 0.5)
    np.testing.assert_array_equal(
        protocol(np.array([-1.0, 0.0, 0.499, 0.5, 5.499, 5.5, 6.0, 99.0])), [0, 0, 0, -25e3, -25e3, 0, 0, 0]
    )
    np.testing.assert_array_equal(protocol.steps_s, [0.5, 5.5])


def test_every_protocol_that_is_shipped_loads() -> None:
    shipped = sorted(Path(str(files("rig") / "protocols")).glob("*.toml"))
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


@pytest.mark.parametrize(("unit", "pa"), [("Pa", 2.0), ("mbar", 200.0), ("kPa", 2000.0)])
def test_units_are_honoured(unit: str, pa: float) -> None:
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
def test_what_is_wrong_is_said_in_one_line_that_names_the_place(text: str, words: list[str]) -> None:
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


def test_limits_only_ever_narrow_each_other() -> None:
    both = PressureLimits(-10e3, 50e3, 5e3).and_also(PressureLimits(-20e3, 30e3))
    assert both == PressureLimits(-10e3, 30e3, 5e3)
