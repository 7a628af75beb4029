"""Training recordings: a simulated motion as seen by camera, clock and gauge, with random faults."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.propose.seen import RATE_HZ, Seen
from straw.replay.diagnose.propose.simulate_campaigns import FRAME_S, Group, library_unknowns
from straw.replay.diagnose.propose.specimens import fault_by_chance
from straw.replay.diagnose.systems.straw.constants import MEASUREMENT
from straw.replay.diagnose.systems.straw.instrument import Instrument
from straw.replay.diagnose.systems.straw.library import causes

Floats = NDArray[np.float64]

#: Number of faults of a recording, by the number of physical causes: with `specimens.HOW_MANY` 10 % of all have
#: nothing, 43 % one cause, the others two.
FAULTS = ((0.42, 0.5, 0.08), (0.65, 0.35), (1.0,))
#: Noise of a frame (m, m, rad), the factor by which it varies, and the correlated share of its variance with its time.
NOISE, NOISE_RATIO, LASTING, LASTS_S = np.array([25e-6, 25e-6, 1.5e-3]), 2.0, 0.7, 0.06
#: A regulator's deviation from its command in half of all laboratories: share, Pa. And of means of readings, Pa.
REGULATED, REGULATED_PA, READ_PA = 3e-3, 40.0, 5.0


@dataclass(frozen=True, eq=False)
class Labelled:
    """Runs of one campaign with the truth: u of the base's constants and of all unknowns of the library, NaN where a
    cause is not there."""

    runs: tuple[Seen, ...]
    base_u: Floats
    cause_u: Floats


def recorded(group: Group, specimen: int, rng: np.random.Generator) -> Labelled:
    """A recording of one specimen of a group, with random faults."""
    straw = group.nominal
    cause_u = group.cause_u[specimen].copy()
    names = [name for name, _ in library_unknowns(straw.cells)]
    there = {name for name, u in zip(names, cause_u, strict=True) if np.isfinite(u)}
    shares = FAULTS[min(len(there), len(FAULTS) - 1)]
    faults = rng.choice(list(MEASUREMENT), rng.choice(len(shares), p=shares), replace=False)
    if {"gauge_offset", "gauge_gain"} <= set(faults):  # predictions are simulated for one of them at a time
        faults = faults[:1]
    values: dict[str, float] = {}
    which_gauge = 0
    for fault in map(str, faults):
        unknowns = causes(straw.cells)[fault][0]
        u = fault_by_chance(rng, straw.cells, fault)
        if fault.startswith("gauge"):
            column = ("gauge_offset", "gauge_gain").index(fault)
            which_gauge = 1 + int(rng.choice(np.flatnonzero(group.gauges[:, column])))
            u = np.array([unknowns[0].at(group.gauges[which_gauge - 1][column] / unknowns[0].scale)])
        else:
            values.update({k.target.split(".")[1]: k.value(float(x)) for k, x in zip(unknowns, u, strict=True)})
        cause_u[[k for k, name in enumerate(names) if name == fault]] = u
    offset_pa, gain = group.gauges[which_gauge - 1] if which_gauge else (0.0, 0.0)
    instrument = Instrument.of({**values, "gauge_offset_pa": offset_pa, "gauge_gain": gain})
    runs = _filmed(group, specimen, which_gauge, instrument, rng)
    return Labelled(runs, group.base_u[specimen], cause_u)


def _filmed(
    group: Group, specimen: int, which_gauge: int, instrument: Instrument, rng: np.random.Generator
) -> tuple[Seen, ...]:
    ratio = NOISE_RATIO ** rng.uniform(-1, 1)
    lasting = rng.uniform(0, LASTING)
    regulated_by_it, careless = rng.random() < 0.5, rng.random() < 0.5
    off_pa, off = careless * rng.normal(scale=REGULATED_PA), careless * rng.normal(scale=REGULATED)
    out = []
    for k, protocol in enumerate(group.protocols):
        stamped_s = np.arange(0.0, protocol.seconds, FRAME_S)
        true_s = np.arange(group.motion.shape[-1]) * FRAME_S
        motion = group.motion[specimen, k].astype(np.float64)
        at_s = np.clip(instrument.true_time(stamped_s), 0.0, true_s[np.flatnonzero(np.isfinite(motion[0]))[-1]])
        tip = instrument.seen(np.stack([np.interp(at_s, true_s, channel) for channel in motion]), at_s)
        tip += ratio * NOISE[:, None] * _noise(rng, len(stamped_s), lasting)
        pressure_pa = protocol.regulated(stamped_s, group.settling_s)
        shown_pa = (1 + instrument.gauge_gain) * pressure_pa + instrument.gauge_offset_pa
        target_pa = np.array([p for _, p in protocol.commands])
        told_pa = np.array([instrument.shown_pressure(p) for p in target_pa]) if regulated_by_it else target_pa
        told_pa = np.where(target_pa == 0, 0.0, told_pa * (1 + off) + off_pa)
        read_pa = shown_pa + rng.normal(scale=READ_PA)
        predicted = group.predicted[which_gauge, k, :, : len(stamped_s)].astype(np.float64)
        told_s = np.array([t for t, _ in protocol.commands])
        out.append(
            Seen.of(
                stamped_s, tip, predicted, read_pa, (told_s, told_pa), protocol.deployed, protocol.cycle, group.nominal
            )
        )
    return tuple(out)


def _noise(rng: np.random.Generator, frames: int, lasting: float) -> Floats:
    """Noise (3, frames) of unit variance: white plus a correlated part."""
    from scipy.signal import lfilter

    fade = np.exp(-FRAME_S / LASTS_S)
    slow = lfilter([np.sqrt(1 - fade**2)], [1.0, -fade], rng.normal(size=(3, frames + 60)), axis=1)[:, 60:]
    return np.asarray(np.sqrt(1 - lasting) * rng.normal(size=(3, frames)) + np.sqrt(lasting) * slow)


assert round(1 / FRAME_S) % RATE_HZ == 0
