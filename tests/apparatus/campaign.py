"""A campaign of eight runs of one specimen with concealed causes, as Run objects or files."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from straw.rig.run import PressureLog, Run
from straw.tracking.trace import TipTrace

from .effects import CLOGS, Cause, conceal
from .instrument import FINE_S, FRAME_S, GAUGE_S, SIGMA, SIGMA_PA, Instrument, kept_frames, tracking_noise
from .layout import CELLS
from .plans import PLANS, Plan, regulated
from .straw import Motion, Straw, move

FORKED_SIGMA = 25.0  # repeats of a straw that snaps into one state differ by 1 to 20 sigma, into two by 50 to 70


@dataclass(frozen=True)
class Scatter:
    """How far specimens and repeats differ: factors as one sigma or, for damping, the largest ratio."""

    damping_ratio: float = 5.0
    channel: float = 0.05
    young: float = 0.02
    thickness: float = 0.01
    zeta: float = 0.01
    repeat_young: float = 1.5e-3
    repeat_damping: float = 0.03
    repeat_angle_rad: float = 2e-4


NONE = Scatter(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
SCATTER = Scatter()


def drawn(seed: int, attempt: int, scatter: Scatter) -> Straw:
    """A random straw: damping and channel, E, h and zeta_0 near the recordings' base constants."""
    rng = np.random.default_rng([seed, 1, attempt])
    base = Straw()
    ratio = scatter.damping_ratio ** rng.uniform(-1.0, 1.0, size=2)
    near = 1.0 + np.clip(rng.normal(size=5), -2.0, 2.0) * np.array(
        [scatter.channel, scatter.young, scatter.thickness, scatter.zeta, scatter.zeta]
    )
    return replace(
        base, c_zeta=base.c_zeta * ratio[0], c_phi=base.c_phi * ratio[1], young_pa=base.young_pa * near[1],
        thickness_m=base.thickness_m * near[2], zeta_odd_m=base.zeta_odd_m * near[3],
        zeta_even_m=base.zeta_even_m * near[4],
    ).with_laws(R_CH=0.40e-3 * near[0])  # fmt: skip


@dataclass(frozen=True)
class Made:
    """One run without noise: the motion, the true pressure, and the instruments."""

    plan: Plan
    straw: Straw
    instrument: Instrument
    motion: Motion
    pressure_pa: np.ndarray
    index: int
    clock_s: float  # in the laboratory when it starts


def make(
    truth: tuple[Cause, ...],
    seed: int,
    runs: tuple[str, ...] | None = None,
    scatter: Scatter = SCATTER,
    plans: tuple[Plan, ...] = PLANS,
    straw: Straw | None = None,
) -> list[Made]:
    """The runs without noise; the same seed gives the same repeats, and the same specimen where no ``straw`` is given,
    whatever is concealed in it."""
    return _make(straw or specimen(seed, scatter), truth, seed, runs, scatter, plans)


@lru_cache(maxsize=512)
def specimen(seed: int, scatter: Scatter = SCATTER) -> Straw:
    """A reproducible straw for a seed: where a snap can end in either of two states (one straw in eight), repeats of
    a run differ by centimetres, and a lab would use another specimen."""
    for attempt in range(50):
        straw = drawn(seed, attempt, scatter)
        if scatter is NONE or max(_repeat_sigma(straw, seed, scatter).values()) < FORKED_SIGMA:
            return straw
    raise RuntimeError(f"seed {seed} draws no specimen that repeats")


def repeat_sigma(seed: int, scatter: Scatter = SCATTER) -> dict[str, float]:
    """Per run, how far the scatter from repeat to repeat moves the tip of the specimen with nothing concealed in it:
    rms over time and x, z, phi, in sigmas of one frame. No smaller effect can be detected."""
    return _repeat_sigma(specimen(seed, scatter), seed, scatter)


@lru_cache(maxsize=512)
def _repeat_sigma(straw: Straw, seed: int, scatter: Scatter) -> dict[str, float]:
    stamp = np.arange(0.0, 3.5, FRAME_S)
    pairs = zip(*(_make(straw, (), seed, None, s, PLANS) for s in (scatter, NONE)), strict=True)
    return {a.plan.run_id: _rms((a.motion.at(stamp) - b.motion.at(stamp)) / SIGMA) for a, b in pairs}


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _make(
    base: Straw,
    truth: tuple[Cause, ...],
    seed: int,
    runs: tuple[str, ...] | None,
    scatter: Scatter,
    plans: tuple[Plan, ...],
) -> list[Made]:
    settling_s = float(np.random.default_rng([seed, 2]).uniform(0.017, 0.023))
    clock, made = 0.0, []
    for index, plan in enumerate(plans):
        rng = np.random.default_rng([seed, 3, index])
        young, axial, bending, angle = rng.normal(size=4)
        straw = replace(
            base,
            young_pa=base.young_pa * (1.0 + scatter.repeat_young * young),
            c_zeta=base.c_zeta * (1.0 + scatter.repeat_damping * axial),
            c_phi=base.c_phi * (1.0 + scatter.repeat_damping * bending),
        ).with_laws(BASE_ANGLE=0.5 * np.pi + scatter.repeat_angle_rad * angle)
        instrument = Instrument()
        for cause in truth:
            straw, instrument = conceal((straw, instrument), cause)
            if cause.form == CLOGS:
                straw = straw.with_laws(R_CH=straw.laws["R_CH"] * (1.0 - cause.size) ** index)
        if "COHESION_N" in straw.laws:  # torn bonds recover only partly
            straw = straw.with_laws(COHESION_N=straw.laws["COHESION_N"] * (1.0 + plan.cycle) ** -0.6)
        if runs is None or plan.run_id in runs:
            time_s = np.arange(0.0, plan.seconds + 0.25, FINE_S)
            pressure = regulated(plan, time_s, settling_s)
            motion = move(straw, plan.deployed, plan.seconds + 0.2, pressure, FINE_S, clock_zero_s=clock)
            made.append(Made(plan, straw, instrument, motion, pressure, index, clock))
        clock += plan.seconds + 2.0
    return made


def record(made: Made, seed: int, name: str) -> Run:
    """The run as the instruments record it."""
    plan = made.plan
    rng = np.random.default_rng([seed, 4, made.index])
    frame = np.arange(int(plan.seconds / FRAME_S))
    tip = made.instrument.film(made.motion, frame * FRAME_S) + tracking_noise(len(frame), rng)
    frame = np.flatnonzero(kept_frames(len(frame), rng))
    x, z, phi = tip[frame].T
    sigma = [np.full(len(frame), s) for s in SIGMA]
    trace = TipTrace(frame * FRAME_S, x, z, phi, *sigma, np.ones(len(frame), dtype=bool), frame.astype(np.int64))
    read_s = np.arange(round(plan.seconds / GAUGE_S) + 1) * GAUGE_S
    reading = read(made, read_s) + rng.normal(scale=SIGMA_PA, size=len(read_s))
    told_s, told_pa = np.array(plan.commands).T
    zero_ns = 1_795_000_000_000_000_000 + round(1e9 * made.clock_s)
    metadata = {
        "run_id": plan.run_id, "specimen": name, "initial_deployed": ",".join(map(str, plan.deployed)),
        "cycle": str(plan.cycle), "zero_time_ns": str(zero_ns), "cells": str(CELLS),
    }  # fmt: skip
    return Run(
        path=Path(f"{name}/{plan.run_id}.mcap"),
        sha256=hashlib.sha256(tip.tobytes() + reading.tobytes()).hexdigest(),
        run_id=plan.run_id, specimen=name, initial_deployed=plan.deployed, cycle=plan.cycle, cells=CELLS,
        zero_time_ns=zero_ns, metadata=metadata, attachments={},
        command=PressureLog(told_s, told_pa, np.full(len(told_s), np.nan), held=True),
        pressure=PressureLog(read_s, reading, np.full(len(read_s), SIGMA_PA)),
        tip=trace, predictions={}, events=(), lost=(),
    )  # fmt: skip


def read(made: Made, time_s: np.ndarray) -> np.ndarray:
    """Readings of the gauge (Pa) without noise."""
    fine_s = np.arange(len(made.pressure_pa)) * FINE_S
    return np.interp(time_s, fine_s, made.instrument.gauge(made.pressure_pa))


def campaign(
    truth: tuple[Cause, ...],
    seed: int,
    runs: tuple[str, ...] | None = None,
    scatter: Scatter = SCATTER,
    plans: tuple[Plan, ...] = PLANS,
    name: str = "concealed",
    straw: Straw | None = None,
) -> tuple[Run, ...]:
    """Runs of one specimen with the causes concealed in it, as ``straw diagnose`` would read them."""
    return tuple(record(made, seed, name) for made in make(truth, seed, runs, scatter, plans, straw))


def effect_sigma(made: list[Made], plain: list[Made]) -> dict[str, float]:
    """Per run, how far the causes move what is seen: rms over time and x, z, phi, in sigmas of one frame.

    ``plain`` are the same runs of the same seed without the causes. A fault of the gauge moves nothing by itself: its
    effect is how the straw would have moved under the pressure that the gauge reads.
    """
    found = {}
    for one, other in zip(made, plain, strict=True):
        stamp = np.arange(int(one.plan.seconds / FRAME_S)) * FRAME_S
        said = one.instrument.gauge(one.pressure_pa)
        motion = other.motion
        if not np.array_equal(said, one.pressure_pa):
            motion = move(other.straw, other.plan.deployed, one.plan.seconds + 0.2, said, FINE_S)
        away = (one.instrument.film(one.motion, stamp) - motion.at(stamp)) / SIGMA
        found[one.plan.run_id] = _rms(away)
    return found


def write(run: Run, path: Path) -> Path:
    """Write a run's command, pressure and tip as MCAP with JSON messages, as other loggers do."""
    from mcap.writer import Writer

    def rows():
        logs = (("command", run.command, {}), ("measured", run.pressure, {"sigma_pa": SIGMA_PA}))
        for topic, log, more in logs:
            for t, p in zip(log.time_s, log.pressure_pa, strict=True) if log else ():
                yield t, f"/pressure/{topic}", {"pressure_pa": float(p), "channel": 1, **more}
        names = ("x_m", "z_m", "phi_rad", "sigma_x_m", "sigma_z_m", "sigma_phi_rad")
        for i, t in enumerate(run.tip.time_s if run.tip else ()):
            pose = {key: float(getattr(run.tip, key)[i]) for key in names}
            yield t, "/tip/state", {**pose, "valid": True, "frame": int(run.tip.frame[i])}

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channels = {}
        for t, topic, message in sorted(rows(), key=lambda row: row[0]):
            if topic not in channels:
                schema = writer.register_schema(topic, "jsonschema", b'{"type": "object"}')
                channels[topic] = writer.register_channel(topic, "json", schema)
            ns = run.zero_time_ns + round(float(t) * 1e9)
            writer.add_message(channels[topic], ns, json.dumps(message).encode(), ns)
        writer.add_metadata("straw.run", dict(run.metadata))
        for name, data in run.attachments.items():
            writer.add_attachment(run.zero_time_ns, run.zero_time_ns, name, "text/plain", data)
        writer.finish()
    return path
