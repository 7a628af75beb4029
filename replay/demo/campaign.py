"""The demo's campaign: a few short runs of different kinds, each driven on the emulated rig, filmed and tracked."""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from straw.model.parameters import StrawParameters
from straw.replay.commands.rig_run import drive, emulation
from straw.replay.commands.track import model_rest
from straw.replay.demo.conceal import Concealed
from straw.replay.demo.film import Error, Motion, errors_of, film, lens_alone
from straw.replay.diagnose.systems.straw.instrument import Instrument
from straw.replay.film.track import track_to_file
from straw.rig.clock import SteppedClock
from straw.rig.drivers import make_controller
from straw.rig.plant import PressurePlant
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import load_protocol
from straw.rig.run_read import read_run
from straw.rig.twin import TwinHistory
from straw.tracking.camera import Camera
from straw.tracking.task import Track

CONTROLLER, SPECIMEN = "ob1-mk4", "twin"


@dataclass(frozen=True)
class Plan:
    """One run: its name, its protocol, how often the specimen was cycled before, the suffix of its files' names.

    ``places``: the tip moves far enough to determine the camera's place.
    """

    name: str
    protocol: str
    cycle: int = 0
    suffix: str = ""
    places: bool = True

    @property
    def files(self) -> tuple[str, str, str]:
        """Names of its recording, video and track."""
        return f"run{self.suffix}.mcap", f"video{self.suffix}.mp4", f"tip{self.suffix}.mcap"


#: Both directions, a worn repetition, and small steps that separate elasticity and gauge from what depends on snaps.
PLANS = (
    Plan("fold", "fold"),
    Plan("deploy-fresh", "deploy", 0, "-2"),
    Plan("deploy-worn", "deploy", 3, "-3"),
    Plan("steps", "steps", 3, "-4", places=False),
)


@dataclass(frozen=True, eq=False)
class Filmed:
    """One run as recorded in files, its track, and the track's error against the painted truth."""

    recording: Path
    video: Path
    tip: Path
    tracked: Track
    errors: dict[str, Error]


class FaultyGauge(PressurePlant):
    """A plant whose sensor may have an offset and a gain error."""

    def __init__(self, instrument: Instrument, seed: int) -> None:
        super().__init__(seed=seed)
        self.instrument = instrument

    def reading(self, time_s: float) -> float:
        """The sensor's value (Pa)."""
        return self.instrument.shown_pressure(super().reading(time_s))


def protocol_of(plan: Plan) -> PressureProtocol:
    """The plan's protocol, as shipped."""
    with as_file(files("straw.replay.demo") / f"{plan.protocol}.toml") as path:
        return load_protocol(path)


def record(
    plan: Plan, base: StrawParameters, concealed: Concealed, out: Path, seed: int, camera: Camera | None = None
) -> Filmed:
    """Drive, film and track one run of the twin; ``camera`` is placed already, else the straw's rest pose places it."""
    protocol, instrument = protocol_of(plan), concealed.instrument
    straw = concealed.straw(base).replace(cycle=float(plan.cycle))
    recording, video, tip = (out / name for name in plan.files)
    truth = drive_twin(plan, protocol, straw, FaultyGauge(instrument, seed), recording)
    recorded = read_run(recording)
    start_s = -protocol.zero_s
    motion = Motion(truth, recorded.zero_time_ns + round(start_s * 1e9))
    stands = model_rest(base, protocol_of(PLANS[0]).initial_deployed)  # on one tripod for all runs
    film(video, motion, stands, protocol.duration_s, seed)
    # A late clock and a rolled camera enter through the tracker's inputs: the video's start and the rest pose.
    told_s = start_s + instrument.clock_offset_s
    x_m, z_m, phi_rad = instrument.seen(np.array(model_rest(straw, protocol.initial_deployed)), np.zeros(1))
    rest = None if camera else (x_m, z_m, phi_rad)
    tracked = track_to_file(video, camera or lens_alone(), rest, tip, recorded, told_s)
    if tracked.record:
        tracked.record.remove()
    return Filmed(recording, video, tip, tracked, errors_of(tracked.trace, motion, start_s, instrument))


def drive_twin(
    plan: Plan, protocol: PressureProtocol, straw: StrawParameters, plant: PressurePlant, output: Path
) -> TwinHistory:
    """Run a protocol on the emulator through the real driver, over a serial terminal where there is one, else TCP.

    Time stands still between two exchanges, so that the recording does not depend on the computer's load.
    """
    clock = SteppedClock()
    address = "pty" if os.name == "posix" else "127.0.0.1:0"
    with emulation(straw, protocol.initial_deployed, CONTROLLER, address, plant=plant, clock=clock) as emulated:
        rig = make_controller(CONTROLLER, emulated.url, clock=clock)
        drive(rig, protocol, output, straw.cells, run_id=plan.name, specimen=SPECIMEN, cycle=str(plan.cycle))
    return emulated.twin.history
