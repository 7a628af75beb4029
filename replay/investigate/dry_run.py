"""Dry run: a proposed protocol checked against its limits, and the motion that the model predicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.replay.diagnose.systems.straw.snaps import crossings, levels_of
from straw.replay.investigate.steps import Plan
from straw.replay.protocol.prediction import predict_protocol
from straw.rig.limits import PressureLimits
from straw.rig.protocol import PressureProtocol

#: Points of a prediction that are kept to be drawn: a line of the log of some 10 kB.
DRAWN = 240


def planned(protocol: PressureProtocol, model: StrawParameters, limits: PressureLimits, *, by_hand: bool) -> Plan:
    """The plan of a protocol; ``by_hand``: the cells are set by hand first. ModelError where it cannot be predicted."""
    seen, _ = predict_protocol(model, protocol)
    ends, predicted = None, None
    if isinstance(seen, Prediction):  # one of hours leaves out what happens inside
        ends = tuple(int(c) + 1 for c in np.flatnonzero(seen.zeta_m[-1, :, 1] > 0))
        predicted = _columns(seen, protocol)
    begins = crossings(seen.time_s, seen.phi_rad, levels_of(seen.phi_rad))[::2] - protocol.zero_s
    low, high = protocol.pressure_pa.min() / 1e3, protocol.pressure_pa.max() / 1e3
    snaps = f"{len(begins)} snaps, the first at {begins[0]:.2f} s" if len(begins) else "no snap"
    says = (
        f"{protocol.name}: {low:g} to {high:g} kPa within {limits}, {protocol.duration_s:.1f} s; predicted: "
        f"{snaps}{'' if ends is None else f', then deployed: {cells(ends)}'}"
    )
    begin = cells(protocol.initial_deployed)
    hand = f"set the straw so that these cells are deployed, and no others: {begin}" if by_hand else ""
    return Plan(protocol.duration_s / 60, len(begins), says, hand, ends, predicted)


def cells(numbers: Sequence[int]) -> str:
    """Cells as a person reads them."""
    return ", ".join(map(str, numbers)) or "none"


def _columns(seen: Prediction, protocol: PressureProtocol) -> dict[str, list[float]]:
    at = np.unique(np.linspace(0, len(seen.time_s) - 1, DRAWN).astype(int))
    told_pa = np.array([float(protocol(t)) for t in seen.time_s[at]])

    def kept(values: NDArray[np.float64], digits: int) -> list[float]:
        return [float(v) for v in np.round(values, digits)]

    return {
        "time_s": kept(seen.time_s[at] - protocol.zero_s, 4),
        "pressure_pa": kept(told_pa, 1),
        "x_m": kept(seen.x_m[at], 7),
        "z_m": kept(seen.z_m[at], 7),
        "phi_rad": kept(seen.phi_rad[at], 6),
    }
