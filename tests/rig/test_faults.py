"""Faults injected on the wire from a seed: no hang, no detectably wrong reading accepted, every fault recorded."""

from pathlib import Path

import pytest

from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.errors import RigError
from straw.rig.faults import KINDS, SeededFaults
from straw.rig.plant import PressurePlant
from tests.benchmarks.soak import TIMEOUT_S, soak


@pytest.mark.parametrize("name", ["ob1-mk4", "alicat"])
def test_a_short_soak_accepts_no_detectably_wrong_reading_and_never_hangs(name: str, tmp_path: Path) -> None:
    report = soak(name, 60, 0.4, 7, tmp_path)
    assert len(set(report.faults) & set(KINDS)) >= 6  # of ten kinds, in about two dozen draws
    assert report.passed_wrong == []
    assert report.good + report.refused + len(report.passed_untellable) == 60
    assert report.events == report.refused
    assert report.longest_s < 20 * TIMEOUT_S + 0.5  # reopening takes its exchanges, each with its own timeout


def test_equal_seeds_give_equal_faults(straw: object) -> None:
    def spoilt(seed: int) -> list[tuple[str, bytes]]:
        faults = SeededFaults(0.5, seed=seed, kinds=["garble", "truncate", "nak"])
        with Emulation(straw, plant=PressurePlant(noise_pa=0.0), latency_s=0.0) as emulation:
            for _ in range(50):
                faults.answer(emulation.device, b"<FIRMV?\n", 0.0)
        return [(fault.kind, fault.sent) for fault in faults.log]

    assert spoilt(1) == spoilt(1) != spoilt(2)


@pytest.mark.parametrize(("name", "request_"), [("ob1-mk4", b"<PINGA?\n"), ("alicat", b"A\r")])
def test_a_late_answer_is_never_taken_for_the_answer_to_the_next_request(
    straw: object, name: str, request_: bytes
) -> None:
    plant = PressurePlant(noise_pa=0.0, resolution_pa=0.0)
    with Emulation(straw, name, plant=plant, latency_s=0.0) as emulation:
        controller = make_controller(name, emulation.url, timeout_s=0.1)
        controller.open()
        controller.read()
        faults = emulation.wire.faults = SeededFaults(1.0, kinds=["late"], late_s=(0.25, 0.25))
        with pytest.raises(RigError, match=r"within 0\.1 s"):
            controller.read()  # its answer, a correct 0, is still in flight
        faults.rate = 0.0
        plant.command(emulation.twin.now() - 1.0, 1500.0)  # meanwhile the pressure has changed
        seen = []
        for _ in range(8):
            try:
                seen.append(controller.read()[0].pressure_pa)
            except RigError:
                continue
        assert seen
        assert set(seen) == {1500.0}
        controller.close()
