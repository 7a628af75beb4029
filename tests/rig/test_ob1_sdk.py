"""The OB1 MK3 through the vendor's library: a stand-in with its signatures, compiled from C, in both generations."""

import os
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from straw.rig.controllers.ob1_sdk import Ob1Sdk
from straw.rig.errors import LinkLostError, RigError
from straw.rig.guarded import GuardedController

SOURCE = Path(__file__).parent / "sdk" / "elveflow.c"
GENERATIONS = {"3.08.06 or earlier": ["-DPER_CALL"], "3.10 or later": []}


@pytest.fixture(scope="session")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        pytest.skip("no C compiler here (cc, gcc or clang) to build the stand-in for the vendor's DLL")
    folder = tmp_path_factory.mktemp("sdk")
    made = {}
    for number, (generation, flags) in enumerate(GENERATIONS.items()):
        made[generation] = str(folder / f"stand_in_{number}.{'dll' if os.name == 'nt' else 'so'}")
        command = [compiler, "-shared", "-fPIC", "-Wall", "-Werror", *flags, str(SOURCE), "-o", made[generation]]
        subprocess.run(command, check=True)
    return made


@pytest.fixture(params=list(GENERATIONS))
def dll(
    request: pytest.FixtureRequest, libraries: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> str:
    monkeypatch.setenv("STAND_IN_LOG", str(tmp_path / "log"))
    monkeypatch.setenv("STAND_IN_FAULT", str(tmp_path / "fault"))
    return libraries[request.param]


@pytest.fixture
def log(tmp_path: Path) -> Callable[[], list[str]]:
    """Returns the calls that have reached the instrument."""
    return lambda: [line for line in (tmp_path / "log").read_text().splitlines() if line != "get"]


def test_what_is_set_is_what_is_read_in_both_generations(dll: str, log: Callable[[], list[str]]) -> None:
    with Ob1Sdk("01F64B3B", dll=dll, channels=(1, 2), regulators=(4, 5, 0, 0)) as controller:
        assert GENERATIONS.keys() >= {controller.snapshot()["sdk"]}
        controller.set_pressure(1, -25e3)
        controller.set_pressure(2, 5.04e3)
        assert [reading.pressure_pa for reading in controller.read()] == pytest.approx([-25e3, 5.04e3])
        assert controller.read()[1].raw.startswith(b"1:-250.0 2:50.")
        controller.trigger(True)
    expected = ["init 01F64B3B 4 5 0 0", "set 1 0", "set 2 0", "set 1 -250", "set 2 50.4", "trigger 1"]
    assert log() == [*expected, "set 1 0", "set 2 0", "close"]


def test_the_generation_is_recognised_by_the_functions_the_library_exports(libraries: dict[str, str]) -> None:
    for generation, dll in libraries.items():
        with Ob1Sdk("01F64B3B", dll=dll) as controller:
            assert controller.snapshot()["sdk"] == generation


def test_the_limits_are_those_of_the_narrowest_regulator_in_use(dll: str) -> None:
    both = Ob1Sdk("01F64B3B", dll=dll, channels=(1, 2), regulators=(4, 1, 0, 0))
    assert (both.limits.min_pa, both.limits.max_pa) == (0.0, 20e3)
    with pytest.raises(RigError, match="channel 3 has no regulator"):
        Ob1Sdk("01F64B3B", dll=dll, channels=(3,))


def test_error_codes_are_errors_and_a_silent_zero_is_rejected(
    dll: str, log: Callable[[], list[str]], tmp_path: Path
) -> None:
    with Ob1Sdk("01F64B3B", dll=dll) as controller:
        controller.set_pressure(1, -25e3)
        controller.read()
        (tmp_path / "fault").write_text("-8030")
        with pytest.raises(LinkLostError, match="no communication with the instrument"):
            controller.read()
        (tmp_path / "fault").write_text("-8004")
        with pytest.raises(RigError, match="gave error -8004"):
            controller.read()
        (tmp_path / "fault").write_text("1")
        with pytest.raises(RigError, match="reads exactly 0"):
            controller.read()
        (tmp_path / "fault").unlink()
    assert log()[-2:] == ["set 1 0", "close"]


def test_a_missing_or_wrong_library_is_reported_in_one_line(tmp_path: Path, libraries: dict[str, str]) -> None:
    for dll in ("", str(tmp_path / "Elveflow64.dll"), str(SOURCE)):
        with pytest.raises(RigError, match=r"needs the vendor's library|does not load") as caught:
            Ob1Sdk("01F64B3B", dll=dll).open()
        assert "\n" not in str(caught.value)
    with pytest.raises(RigError, match="OB1_Initialization gave error -8001"):
        Ob1Sdk("nobody", dll=next(iter(libraries.values()))).open()
    with pytest.raises(RigError, match=r"calibration .* is not there"):
        Ob1Sdk("01F64B3B", dll=next(iter(libraries.values())), calibration="none.txt").open()


def test_under_a_guardian_the_library_is_loaded_in_its_process(dll: str, log: Callable[[], list[str]]) -> None:
    with GuardedController("ob1-sdk", "01F64B3B", dll=dll) as controller:
        controller.set_pressure(1, -25e3)
        assert controller.read()[0].pressure_pa == -25e3
    assert log()[-2:] == ["set 1 0", "close"]


def test_where_the_library_does_not_return_the_guardian_is_ended_and_the_standby_vents(
    dll: str, log: Callable[[], list[str]], tmp_path: Path
) -> None:
    with GuardedController("ob1-sdk", "01F64B3B", dll=dll) as controller:
        controller.set_pressure(1, -20e3)
        (tmp_path / "fault").write_text("7777")
        start_s = time.monotonic()
        with pytest.raises(
            LinkLostError, match=r"no sign of life.*straw rig vent --port 01F64B3B --controller ob1-sdk"
        ):
            controller.read()
        while log()[-1] != "close" or log()[-2] != "set 1 0":  # by the standby: this script has not vented yet
            assert time.monotonic() < start_s + 4.0
            time.sleep(0.01)
        assert (
            time.monotonic() - start_s < 3.0
        )  # 0.5 s until the guardian counts as hanging, 1 s without a heartbeat, and the start of a process
    assert log()[-2:] == ["set 1 0", "close"]
