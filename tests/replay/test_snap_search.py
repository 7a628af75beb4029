"""The snap search finds the model's snap pressures through the wire, and reports when it cannot."""

import json
from pathlib import Path

import pytest

from straw.model.parameters import StrawParameters
from straw.model.snap import snap_pair
from straw.replay.cli import main
from straw.rig.clock import SteppedClock
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.errors import RigError
from straw.rig.faults import SeededFaults
from straw.rig.plant import PressurePlant
from straw.rig.run_read import read_run
from straw.rig.snap_search import SnapPlan, snap_search
from straw.rig.watch import AskingWatcher, MotionWatcher, volume_from_flow


@pytest.mark.parametrize(
    ("direction", "cell", "start", "which"), [("fold", 1, 11.0, 0), ("deploy", 1, 20.0, 1), ("fold", 5, 11.0, 0)]
)
def test_the_emulated_straw_snaps_where_the_model_says(
    direction: str, cell: int, start: float, which: int, tmp_path: Path
) -> None:
    # The truth is the limit point found by continuation; the search sees only the wire and the tip.
    truth_pa = snap_pair(StrawParameters(), cell)[which].pressure_pa
    found, recording = tmp_path / "found.json", tmp_path / "search.mcap"
    command = ["rig", "snap-search", "--emulate", "--cell", str(cell), "--direction", direction]
    assert main([*command, "--from", str(start), "-o", str(recording), "--json", str(found)]) == 0
    said = json.loads(found.read_text())
    (search,) = said["searches"]
    told = sorted([search["below"]["told_pa"], search["above"]["told_pa"]])
    assert told[0] <= truth_pa <= told[1]
    assert told[1] - told[0] == pytest.approx(100.0)
    assert said["interval_pa"][0] < truth_pa < said["interval_pa"][1]
    assert abs(said["pressure_pa"] - truth_pa) < 3 * said["sigma_pa"]
    run = read_run(recording)
    assert run.damage == ()
    assert "snap" in {event.kind for event in run.events}
    assert run.events[-1].kind == "vent"


class Clicker:
    """A straw that jumps when its pressure passes a limit, and takes in volume in proportion to pressure below it."""

    def __init__(self, snaps_at_pa: float) -> None:
        self.snaps_at_pa, self.snapped = snaps_at_pa, False
        self.time_s = self.volume_m3 = self.pressure_pa = 0.0
        self.tip = (0.0, 0.08, 0.0)

    def advance(self, time_s: float, pressure_start_pa: float, pressure_end_pa: float) -> None:
        self.time_s, self.pressure_pa = time_s, pressure_end_pa
        self.snapped = self.snapped or abs(pressure_end_pa) > abs(self.snaps_at_pa)
        self.volume_m3 += (1e-10 * pressure_end_pa - 2e-6 * self.snapped - self.volume_m3) * 0.02


def clicker(snaps_at_pa: float) -> tuple[Clicker, Emulation]:
    straw = Clicker(snaps_at_pa)
    plant = PressurePlant(noise_pa=20.0, air_m3=1e-4)
    return straw, Emulation(straw, plant=plant, clock=SteppedClock(), step_s=5e-3)


def test_the_measured_flow_shows_the_snap_and_repeats_narrow_its_interval() -> None:
    straw, emulation = clicker(-7_730.0)

    def reset() -> None:
        emulation.clock.sleep(2.0)
        emulation.catch_up()
        straw.snapped = False

    with emulation, make_controller("ob1-mk4", emulation.url, clock=emulation.clock) as controller:
        watcher = volume_from_flow()
        look = watcher.position
        watcher.position = lambda reading: (emulation.catch_up(), look(reading))[1]  # type: ignore[func-returns-value]
        found = snap_search(controller, SnapPlan(-4e3, -12e3, repeats=3), watcher, reset)
    assert len(found.brackets) == 3
    for bracket in found.brackets:
        assert (bracket.below.told_pa, bracket.above.told_pa) == (-7_700.0, -7_800.0)
    assert found.interval_pa[0] < -7_730.0 < found.interval_pa[1]
    assert found.sigma_pa < 80.0


def test_an_observer_can_answer_and_without_a_reset_the_interval_is_one_step() -> None:
    straw, emulation = clicker(6_200.0)

    def ask(told_pa: float) -> bool:
        emulation.catch_up()
        return straw.snapped

    with emulation, make_controller("ob1-mk4", emulation.url, clock=emulation.clock) as controller:
        found = snap_search(controller, SnapPlan(0.0, 10e3), AskingWatcher(ask, 0.5), None)
    assert (found.brackets[0].below.told_pa, found.brackets[0].above.told_pa) == (6_000.0, 6_500.0)


def test_missing_or_corrupted_answers_are_requested_again_and_the_search_continues() -> None:
    straw, emulation = clicker(6_200.0)
    faults = SeededFaults(0.05, seed=3, kinds=("garble", "truncate", "silence", "deaf"))

    def ask(told_pa: float) -> bool:
        emulation.catch_up()
        return straw.snapped

    with emulation, make_controller("ob1-mk4", emulation.url, clock=emulation.clock) as controller:
        emulation.wire.faults = faults
        found = snap_search(controller, SnapPlan(4e3, 10e3), AskingWatcher(ask, 0.5), None)
    assert len(faults.log) > 2
    assert (found.brackets[0].below.told_pa, found.brackets[0].above.told_pa) == (6_000.0, 6_500.0)


def test_no_snap_or_no_means_to_detect_one_is_one_line_and_leaves_the_straw_vented() -> None:
    straw, emulation = clicker(50e3)
    with emulation, make_controller("ob1-mk4", emulation.url, clock=emulation.clock) as controller:
        with pytest.raises(RigError, match=r"nothing snapped between 0 and 3 kPa"):
            snap_search(controller, SnapPlan(0.0, 3e3), MotionWatcher(lambda _: (straw.volume_m3,), 1e-9), None)
        assert emulation.wire.received[-1][1] == b"<PRESS!:0:0\n"
        with pytest.raises(RigError, match="need a reset of the straw"):
            snap_search(controller, SnapPlan(0.0, 3e3, repeats=2), MotionWatcher(lambda _: (0.0,)), None)
    with pytest.raises(RigError, match="two different pressures"):
        SnapPlan(1e3, 1e3)
