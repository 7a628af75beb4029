"""One protocol three ways: recorded on a rig, run by the emulator behind its wire, predicted by the model alone."""

from __future__ import annotations

import itertools
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.replay.commands.rig_run import drive, emulation, write_true_tip
from straw.replay.compare.series import Series, differ, tip_series
from straw.replay.errors import ReplayError
from straw.replay.metrics import Metrics
from straw.replay.protocol.prediction import RATE_HZ, trace_of
from straw.rig.clock import SteppedClock
from straw.rig.drivers import make_controller
from straw.rig.outlet import Outlet
from straw.rig.protocol import PressureProtocol
from straw.rig.protocol_toml import load_protocol, protocol_from_toml
from straw.rig.run import Run
from straw.rig.run_read import read_run

ATTACHED = "protocol.toml"
CONTROLLER = "ob1-mk4"


@dataclass(frozen=True)
class ThreeWays:
    """Signals by origin ("recording", "emulator", "model"), times from the protocol's zero, and their differences:
    (one, other, signal) to metrics of other - one.
    """

    signals: dict[str, dict[str, Series]]
    differences: dict[tuple[str, str, str], Metrics]


def protocol_of(run: Run, given: Path | None) -> PressureProtocol:
    """The protocol a run was made with: as given, or the one it carries; ReplayError where there is none."""
    if given is not None:
        return load_protocol(given)
    if ATTACHED not in run.attachments:
        raise ReplayError(f"{run.path}: carries no protocol; give its file: --protocol P.toml")
    return protocol_from_toml(run.attachments[ATTACHED].decode(), f"{run.path}, {ATTACHED}")


def three_ways(run: Run, straw: StrawParameters, protocol: PressureProtocol) -> ThreeWays:
    """Run the protocol on emulator and model, and compare all three in pairs.

    Raises ReplayError where recording and protocol do not belong together, and what the emulator and the model raise.
    """
    if run.initial_deployed is not None and run.initial_deployed != protocol.initial_deployed:
        raise ReplayError(
            f"{run.path}: recorded with cells {run.initial_deployed} deployed, protocol {protocol.name} begins with "
            f"{protocol.initial_deployed}; give the protocol of that run"
        )
    worn = straw.in_run(run.cycle, run.zero_time_ns)
    signals = {
        "recording": _signals(run),
        "emulator": _emulated(worn, protocol),
        "model": _modelled(worn, protocol),
    }
    differences = {
        (one, other, name): differ(signals[one][name], signals[other][name], name)
        for one, other in itertools.combinations(signals, 2)
        for name in signals[one]
    }
    return ThreeWays(signals, differences)


def _signals(run: Run) -> dict[str, Series]:
    assert run.pressure is not None
    assert run.tip is not None
    return {
        "pressure": Series(run.pressure.time_s, run.pressure.pressure_pa, run.pressure.sigma_pa, "Pa"),
        **tip_series(run.tip),
    }


def _emulated(straw: StrawParameters, protocol: PressureProtocol) -> dict[str, Series]:
    """Driven through the real driver over a wire, faster than real time."""
    clock = SteppedClock()
    with tempfile.TemporaryDirectory() as folder:
        path, tip = Path(folder) / "run.mcap", Path(folder) / "tip.mcap"
        with emulation(straw, protocol.initial_deployed, CONTROLLER, clock=clock) as emulated:
            drive(make_controller(CONTROLLER, emulated.url, clock=clock), protocol, path, straw.cells)
        write_true_tip(tip, read_run(path), emulated.twin.history)
        recorded, seen = read_run(path), read_run(tip)
        assert recorded.pressure is not None
        assert seen.tip is not None
        log = recorded.pressure
        return {"pressure": Series(log.time_s, log.pressure_pa, log.sigma_pa, "Pa"), **tip_series(seen.tip)}


def _modelled(straw: StrawParameters, protocol: PressureProtocol) -> dict[str, Series]:
    """The model under the controller's nominal response to the command."""
    time_s = np.arange(0.0, protocol.duration_s, 1 / RATE_HZ)
    p = simulate(straw, Outlet(protocol), time_s, protocol.initial_deployed)
    since_zero_s = time_s - protocol.zero_s
    unknown = np.full(len(time_s), np.nan)
    return {"pressure": Series(since_zero_s, p.external_pa, unknown, "Pa"), **tip_series(trace_of(p, since_zero_s))}
