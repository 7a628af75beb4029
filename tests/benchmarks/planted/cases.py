"""The simulated systems, what is planted in each, and what their noise leaves."""

from __future__ import annotations

from functools import partial

from tests.benchmarks.measured.cases import Effect
from tests.benchmarks.planted.hysteresis import ACTUATOR, STAGE, actuator, stage
from tests.benchmarks.planted.instruments import DRIVE, NARROW, OVEN, TANK, drive, oven, tank
from tests.benchmarks.planted.machines import (
    ARM,
    CIRCUIT,
    DRONE,
    SERVO,
    SLIDE,
    arm,
    circuit,
    drone,
    servo,
    shuttle,
    slide,
)
from tests.benchmarks.planted.more_systems import (
    BOAT,
    CAMERA,
    CAR,
    FILTER,
    POND,
    PREY,
    REACTOR,
    THROW,
    VALVE,
    boat,
    camera,
    car,
    low_pass,
    pond,
    prey,
    quiet_battery,
    reactor,
    throw,
    valve,
)
from tests.benchmarks.planted.systems import (
    BATTERY,
    GAUGE,
    HEATER,
    MOTOR,
    PENDULUM,
    PIPE,
    Planted,
    battery,
    gauge,
    heater,
    motor,
    pendulum,
    pipe,
)


def _rate(of: str, over: str, *forms: str) -> Effect:
    return Effect((f"the rate of {of}, over {over}",), forms)


ALONG = (
    "the rate of the speed along and the speed up, in their direction, over the magnitude of the speed along and the "
    "speed up"
)
SQUARES = "square with sign", "square", "power"
CASES = (
    Planted("pendulum", PENDULUM, partial(pendulum, drag=0.12), 5e-3,
            (Effect(("the rate of the turning speed, over the turning speed", "the bearing's damping, over the turning "
                     "speed"), (*SQUARES, "sign"),),)),
    Planted("heater", HEATER, partial(heater, convection=8e-5), 0.3,
            (Effect(("the (rate of the excess temperature|cooling), over the excess temperature",),
                    (*SQUARES, "linear")),)),
    Planted("motor", MOTOR, partial(motor, dry=25.0), 0.4, (_rate("the speed", "the speed", "sign", "step"),)),
    Planted("dosing pipe", PIPE, partial(pipe, delay_s=4.0, crowded=0.0), 0.03,
            (Effect(("the delay of the input the dose", "the clock of the concentration"), ("constant",)),)),
    Planted("dosing pipe, crowded", PIPE, partial(pipe, delay_s=4.0, crowded=0.25), 0.03,
            (Effect(("the delay of the input the dose", "the clock of the concentration"), ("constant",)),
             Effect(("the mixing time, over the concentration", "the rate of the concentration, over the .*")))),
    Planted("battery", BATTERY, battery, 2e-3,
            (Effect(("(the reading of the voltage|the constant E|the resistance), over the history of the current",
                     )),)),
    Planted("gauge, saturating", GAUGE, partial(gauge, saturates=0.02, drift=0.0), 0.05,
            (Effect(("(the reading of the output|the gain|the input the load), over the load",),
                    ("saturating", *SQUARES, "linear")),)),
    Planted("gauge, warm", GAUGE, partial(gauge, saturates=0.0, drift=0.004), 0.05,
            (Effect(("(the reading of the output|the constant y0), over the temperature",)),)),
    Planted("clamp", FILTER, partial(low_pass, clamps=60.0), 0.01,
            (Effect(("the (rate of the output|time constant), over the output",), ("above a threshold",)),)),
    Planted("reactor, order 2", REACTOR, partial(reactor, order=2.0), 0.01,
            (_rate("the concentration", "the concentration", *SQUARES),)),
    Planted("reactor, order 1", REACTOR, partial(reactor, order=1.0), 0.01,
            (_rate("the concentration", "the concentration", "linear"),)),
    Planted("car", CAR, partial(car, drag=7e-4), 0.1, (_rate("the speed", "the speed", *SQUARES),)),
    Planted("boat", BOAT, partial(boat, drag=0.03), 0.04,
            (Effect(("the rate of the speed, over the speed",), untold=True),)),
    Planted("camera", CAMERA, partial(camera, wanders_s=0.8), 1.0, (Effect(("the clock of the scale, over time",)),)),
    Planted("valve", VALVE, partial(valve, dead=4.0, supply=0.0), 0.08,
            (Effect(("(the reading of the flow|the gain|the input the voltage), over the voltage",),
                    ("above a threshold", "below a threshold")),)),
    Planted("valve, supply", VALVE, partial(valve, dead=-99.0, supply=0.12), 0.08,
            (Effect(("the gain, over the supply",), ("linear",)),)),
    Planted("pond", POND, partial(pond, seeps=0.12), 0.01,
            (Effect(("the (rate of the depth|outlet), over the depth",), ("above a threshold",)),)),
    Planted("throw", THROW, partial(throw, drag=0.4), 5e-3, (Effect((ALONG,), ("linear",)),)),
    Planted("prey", PREY, partial(prey, crowded=0.12), 0.01,
            (Effect(("the (rate of the prey|prey's growth), over the prey",), (*SQUARES, "linear")),)),
    Planted("servo", SERVO, partial(servo, limit=4.0), 0.1,
            (Effect(("the (rate of the stroke|gain|input the command), over the command",),
                    ("outside a dead band", "saturating")),)),
    Planted("slide", SLIDE, partial(slide, dry=20.0, unequal=0.2), 1e-3,
            (_rate("the speed", "the speed", "sign with offset"),)),
    Planted("arm", ARM, partial(arm, gravity=15.0), 5e-3, (_rate("the speed", "the angle", "wave"),)),
    Planted("drone", DRONE, partial(drone, near_ground=0.3), 3e-3,
            (Effect(("the (thrust|rate of the climb), over the height",), ("fading",)),)),
    Planted("shuttle", THROW, partial(shuttle, drag=0.2), 5e-3,
            (Effect((ALONG,), SQUARES),)),
    Planted("circuit", CIRCUIT, partial(circuit, saturation_a=2e-9), 4e-3,
            (Effect(("the (rate of the voltage|resistor), over the voltage",), ("growing",)),)),
    Planted("oven", OVEN, partial(oven, lag_s=90.0), 0.1,
            (Effect(("the reading of the temperature, over its own history",), ("lag",)),)),
    Planted("tank", TANK, partial(tank, most=9.0), 0.05,
            (Effect(("the reading of the pressure, over the pressure",), ("above a threshold",)),)),
    Planted("tank, play", TANK, partial(tank, play=0.8), 0.05,
            (Effect(("the input the command, over its own history",), ("play",)),)),
    Planted("drive, counted", DRIVE, drive, 0.03,
            (Effect(("the reading of the pulse rate, over the speed",), ("below a threshold", "above a threshold")),)),
    Planted("tank, narrow", NARROW, tank, 0.05, (Effect(("the gain, beyond its range",), ("constant",)),)),
    Planted("actuator", ACTUATOR, partial(actuator, loops=((0.25, 3.0), (0.25, 7.0), (0.2, 12.0))), 0.15,
            (Effect(("the (input the pressure, over its own history|rate of the angle, over the hysteresis of the "
                     "pressure)",), ("play",)),)),
    Planted("stage", STAGE, partial(stage, most_n=3.0), 2e-4,
            (_rate("the speed", "the hysteresis of the position", "gradual play"),)),
    Planted("stage, nothing", STAGE, partial(stage, most_n=0.0), 2e-4),
    Planted("tank, nothing", TANK, partial(tank, dropped=0.01), 0.05),
    Planted("servo, nothing", SERVO, partial(servo, limit=99.0), 0.1),
    Planted("prey, nothing", PREY, partial(prey, crowded=0.0), 0.01),
    Planted("pendulum, nothing", PENDULUM, partial(pendulum, drag=0.0), 5e-3),
    Planted("heater, nothing", HEATER, partial(heater, convection=0.0), 0.3),
    Planted("battery, nothing", BATTERY, quiet_battery, 2e-3),
    Planted("dosing pipe, nothing", PIPE, partial(pipe, delay_s=0.0, crowded=0.0), 0.03),
    Planted("boat, nothing", BOAT, partial(boat, drag=0.0), 0.04),
)  # fmt: skip
