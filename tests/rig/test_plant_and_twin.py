"""The plant behind the wire settles as the paper measured, and the straw behind it follows its clock."""

import math
import os
import time

import numpy as np
import pytest

from straw.model.parameters import StrawParameters
from straw.model.simulate import Stepper
from straw.rig.clock import SteppedClock
from straw.rig.drivers import make_controller
from straw.rig.emulate import Emulation
from straw.rig.errors import RigError
from straw.rig.line import Line
from straw.rig.plant import PressurePlant
from straw.rig.twin import Twin
from straw.rig.wire import Wire


def test_a_step_has_settled_to_97_percent_after_70_ms() -> None:
    plant = PressurePlant()
    plant.command(1.0, -25e3)
    assert plant.pressure(0.9) == 0.0
    assert plant.pressure(1.07) / -25e3 == pytest.approx(0.97, abs=0.001)
    plant.command(1.01, 10e3)  # before it has settled: it continues from its present pressure
    half_way = plant.pressure(1.01)
    assert half_way == pytest.approx(-25e3 * (1 - math.exp(-0.5)))
    assert plant.pressure(1.03) == pytest.approx(10e3 + (half_way - 10e3) * math.exp(-1.0))
    assert plant.pressure(1.005) == pytest.approx(-25e3 * (1 - math.exp(-0.25)))  # the past is unchanged


def test_commands_beyond_the_supply_are_clipped() -> None:
    plant = PressurePlant(min_pa=-5e3, max_pa=8e3)
    plant.command(0.0, 50e3)
    assert plant.pressure(10.0) == pytest.approx(8e3)
    plant.command(10.0, -50e3)
    assert plant.pressure(20.0) == pytest.approx(-5e3)


def test_the_sensor_has_the_noise_and_resolution_it_was_given_and_is_reproducible_from_its_seed() -> None:
    readings = np.array([PressurePlant(noise_pa=0.0, resolution_pa=100.0).reading(0.0) for _ in range(3)])
    assert readings.tolist() == [0.0, 0.0, 0.0]
    noisy = PressurePlant(noise_pa=40.0, resolution_pa=0.0, seed=3)
    values = np.array([noisy.reading(i * 1e-3) for i in range(4000)])
    assert np.std(values) == pytest.approx(40.0, rel=0.05)
    assert np.mean(values) == pytest.approx(0.0, abs=3.0)
    again = PressurePlant(noise_pa=40.0, resolution_pa=0.0, seed=3)
    assert [again.reading(0.0) for _ in range(5)] == values[:5].tolist()
    coarse = PressurePlant(noise_pa=500.0, resolution_pa=100.0)
    assert {coarse.reading(0.0) % 100.0 for _ in range(50)} == {0.0}


def test_a_leak_makes_a_droop_while_regulated_and_a_decay_while_the_valves_are_held() -> None:
    plant = PressurePlant(leak_per_s=2.0, noise_pa=0.0)
    plant.command(0.0, 20e3)
    assert plant.pressure(5.0) == pytest.approx(20e3 * 50 / 52)  # where 50 (P_set - P) = 2 P
    plant.hold(5.0, closed=True)
    assert plant.pressure(5.5) == pytest.approx(20e3 * 50 / 52 * math.exp(-1.0))
    plant.command(6.0, -10e3)  # held valves do not compensate it
    assert plant.pressure(6.5) == pytest.approx(20e3 * 50 / 52 * math.exp(-3.0))
    plant.hold(7.0, closed=False)
    assert plant.pressure(9.0) == pytest.approx(-10e3 * 50 / 52)
    tight = PressurePlant()
    tight.command(0.0, 20e3)
    tight.hold(1.0, closed=True)
    assert tight.pressure(1e6) == pytest.approx(20e3)


def test_what_the_straw_takes_in_expands_the_air_in_the_line_and_shows_as_flow() -> None:
    plant = PressurePlant(air_m3=1e-4)
    plant.take(1.0, 1e-7, 0.001)  # 0.1 ml out of 100 ml of air: p V is constant, 0.1 % of 101 kPa
    assert plant.pressure(1.0) == pytest.approx(-101.325)
    assert plant.pressure(1.02) == pytest.approx(-101.325 * math.exp(-1.0))
    assert plant.flow(1.0) == pytest.approx(1e-4)


def test_the_straw_follows_the_outlet_pressure_in_steps_of_a_millisecond(straw: object) -> None:
    plant, clock = PressurePlant(), SteppedClock()
    twin = Twin(straw, plant, clock)
    plant.command(0.05, -25e3)
    clock.sleep(0.2)
    twin.advance_to(twin.now())
    history = twin.history
    np.testing.assert_allclose(np.diff(history.time_s), 1e-3, atol=1e-9)
    assert history.time_s[-1] == pytest.approx(twin.now(), abs=1.1e-3)
    np.testing.assert_allclose(history.external_pa, [plant.pressure(t) for t in history.time_s])
    np.testing.assert_allclose(history.x_m, history.pressure_pa * 1e-6)
    assert history.pressure_pa[-1] == pytest.approx(-25e3, rel=1e-3)


def test_the_models_straw_can_stand_behind_the_wire() -> None:
    plant, clock = PressurePlant(), SteppedClock()
    twin = Twin(Stepper(StrawParameters(), (1, 4)), plant, clock)
    plant.command(0.01, -25e3)
    clock.sleep(0.1)
    twin.advance_to(twin.now())
    history = twin.history
    assert history.volume_m3[-1] < history.volume_m3[0]  # suction removes fluid
    assert history.pressure_pa[-1] < -1e3
    np.testing.assert_allclose(np.diff(history.time_s), 1e-3, atol=1e-9)


def test_the_twin_runs_in_real_time_and_gives_its_wall_clock(straw: object) -> None:
    before_ns = time.time_ns()
    with Twin(straw, PressurePlant()) as twin:
        time.sleep(0.2)
        end_s = twin.now()
    assert end_s - 1.1e-3 <= twin.history.time_s[-1] < end_s + 1.0
    assert before_ns - 10**7 <= twin.history.zero_wall_ns <= before_ns + 10**9
    np.testing.assert_array_less(np.diff(twin.history.time_s), 1.001e-3)


def test_an_error_of_the_straw_model_is_raised_when_the_twin_is_stopped(straw: object) -> None:
    def diverge(time_s: float, pressure_start_pa: float, pressure_end_pa: float) -> None:
        raise FloatingPointError("the straw flew away")

    twin = Twin(straw, PressurePlant())  # type: ignore[arg-type]
    straw.advance = diverge  # type: ignore[attr-defined]
    twin.start()
    time.sleep(0.05)
    with pytest.raises(FloatingPointError, match="flew away"):
        twin.stop()


def test_the_wire_has_the_transmission_time_of_the_real_line(straw: object) -> None:
    # 8 + 27 bytes at 115200 baud take 3.0 ms, to which the latency is added.
    with Emulation(straw, latency_s=5e-3) as emulation:
        line = Line(emulation.url)
        line.open()
        start_s = time.perf_counter()
        for _ in range(5):
            reply = line.exchange(b"<PINGA?\n", b"\n", 1.0)
        took_s = (time.perf_counter() - start_s) / 5
        line.close()
    assert took_s > 5e-3 + 10 * (8 + len(reply)) / 115200


def test_an_invalid_wire_or_emulator_is_refused_in_one_line(straw: object) -> None:
    with pytest.raises(RigError, match="cannot listen on 'nowhere'"):
        Emulation(straw, "ob1-mk4", "nowhere")
    with pytest.raises(RigError, match=r"has no emulator; known: .*ob1-mk4"):
        Emulation(straw, name="ob9")
    with Emulation(straw) as first, pytest.raises(RigError, match="free port"):
        Wire(first.wire.device, first.url.removeprefix("socket://"))


def test_one_emulated_controller_answers_on_a_pty_and_on_tcp_at_once() -> None:
    if os.name != "posix":
        pytest.skip("a pty needs Linux or macOS")
    with (
        Emulation(Stepper(StrawParameters(), []), "ob1-mk4", "pty", "127.0.0.1:0") as emulated,
        make_controller("ob1-mk4", emulated.urls[0]) as by_pty,
        make_controller("ob1-mk4", emulated.urls[1]) as by_tcp,
    ):
        by_pty.set_pressure(1, 5e3)
        time.sleep(0.2)  # ten time constants of the plant
        (seen,) = by_tcp.read()
        assert seen.pressure_pa == pytest.approx(5e3, abs=300)


def test_an_emulator_left_running_keeps_only_its_last_minutes() -> None:
    straw = Stepper(StrawParameters(), [])
    twin = Twin(straw, PressurePlant(), SteppedClock(), remember_s=0.05)
    twin.advance_to(0.2)
    assert len(twin.history.time_s) == 50
    assert twin.history.time_s[-1] == pytest.approx(0.2, abs=2e-3)


def test_a_plant_that_is_commanded_endlessly_keeps_the_recent_past_exact() -> None:
    plant, short = PressurePlant(), PressurePlant()
    for k in range(50_000):
        plant.command(k * 0.01, 1e3 * (k % 7))
    for k in range(49_990, 50_000):
        short.command(k * 0.01, 1e3 * (k % 7))
    # after some time constants the initial state has decayed: exp(-50 * 0.09) of at most 6 kPa
    assert plant.pressure(499.99) == pytest.approx(short.pressure(499.99), abs=6e3 * math.exp(-4.5))
