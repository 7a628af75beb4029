"""Simulates training campaigns and keeps them as files: motions without noise, from which recordings are made.

A group shares protocols and the nominal straw, whose predictions are then simulated once for all of its specimens, and
once more for each fault of the gauge that a recording of the group may have.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from straw.model.drive import Table
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.simulate import run
from straw.model.straw_file import straw_from_toml
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.propose.protocols import USUAL, Protocol, drawn
from straw.replay.diagnose.propose.specimens import (
    another_time,
    base_by_chance,
    causes_by_chance,
    cells_differ,
    fault_by_chance,
    nearness,
    nominal,
)
from straw.replay.diagnose.systems.straw.constants import applied, base_unknowns
from straw.replay.diagnose.systems.straw.instrument import Instrument
from straw.replay.diagnose.systems.straw.library import causes

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

#: Specimens that share their protocols, and share of groups that run the usual ones.
SPECIMENS, USUALLY = 12, 0.4
#: Time between pictures of the camera, and between points of the pressure's table, s.
FRAME_S, TABLE_S = 1 / 240, 1e-3
#: Extra duration of a simulated motion, for clocks that are early.
BEYOND_S = 0.3
#: Below the camera's noise of 25 um; a motion with more steps keeps ringing and costs as much as many others.
TOLERANCE_M, MOST_STEPS_PER_S = 1.5e-6, 1200.0
#: Time constant of a regulator, s.
SETTLING_S = (5e-3, 40e-3)


@dataclass(frozen=True, eq=False)
class Group:
    """Specimens (m) under the same protocols (n); motions (m, n, 3, t) = X, Z, Phi every `FRAME_S`, NaN beyond a run.

    ``predicted`` (1 + faults, n, 3, t) is the nominal straw under the pressure as a good gauge shows it, then as each
    of ``gauges`` (offset Pa, gain) does. ``base_u`` (m, base) and ``cause_u`` (m, unknowns) are the truth in the
    library's u, NaN for a cause that is not there.
    """

    nominal: StrawParameters
    protocols: tuple[Protocol, ...]
    settling_s: float
    gauges: Floats
    motion: Singles
    predicted: Singles
    base_u: Floats
    cause_u: Floats
    usual: bool

    def save(self, path: Path) -> None:
        """Write it whole or not at all."""
        about = {
            "nominal": self.nominal.to_toml(),
            "protocols": [asdict(p) for p in self.protocols],
            "settling_s": self.settling_s,
            "usual": self.usual,
            "unknowns": [one.target for _, one in library_unknowns(self.nominal.cells)],
        }
        arrays = {name: getattr(self, name) for name in ("gauges", "motion", "predicted", "base_u", "cause_u")}
        part = path.with_suffix(".part")
        with part.open("wb") as file:
            np.savez(file, about=np.array(json.dumps(about)), **arrays)
        part.replace(path)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a group back; unknowns added to the library since then are absent, NaN."""
        with np.load(path) as data:
            about = json.loads(str(data["about"]))
            arrays = {name: data[name] for name in ("gauges", "motion", "predicted", "base_u", "cause_u")}
        straw = straw_from_toml(about["nominal"])
        column = {target: k for k, target in enumerate(about["unknowns"])}
        cause_u = np.full((len(arrays["cause_u"]), len(library_unknowns(straw.cells))), np.nan)
        for k, (_, one) in enumerate(library_unknowns(straw.cells)):
            if one.target in column:
                cause_u[:, k] = arrays["cause_u"][:, column[one.target]]
        arrays["cause_u"] = cause_u
        protocols = tuple(
            Protocol(tuple(map(tuple, p["commands"])), tuple(p["deployed"]), p["cycle"], p["seconds"])
            for p in about["protocols"]
        )
        return cls(straw, protocols, about["settling_s"], usual=about["usual"], **arrays)


def library_unknowns(cells: int) -> list[tuple[str, Unknown]]:
    """Every unknown of the library with the name of its cause, in the order of the columns of ``cause_u``."""
    return [(name, one) for name, (unknowns, _) in causes(cells).items() for one in unknowns]


def simulated_group(seed: int) -> Group | None:
    """A random group; the same seed gives the same. None where nothing of it can be simulated."""
    rng = np.random.default_rng([seed, 30])
    straw, near = nominal(rng), nearness(rng)
    usual = bool(rng.random() < USUALLY)
    protocols = USUAL if usual else drawn(rng, straw.cells)
    settling_s = float(np.exp(rng.uniform(*np.log(SETTLING_S))))
    gauges = np.array([_gauge_fault(rng, straw.cells, name) for name in ("gauge_offset", "gauge_gain", "gauge_offset")])
    plain = [(p, _predicted(straw, p, settling_s)) for p in protocols]
    playable = [(p, one) for p, one in plain if one is not None]
    if len(playable) < 2:
        return None
    protocols, rests = tuple(p for p, _ in playable), [rest for _, (_, rest) in playable]
    predicted = [[tip for _, (tip, _) in playable]]
    for offset_pa, gain in gauges:
        shown = [_predicted(straw, p, settling_s, (offset_pa, gain), r) for p, r in zip(protocols, rests, strict=True)]
        predicted.append([good if one is None else one[0] for one, good in zip(shown, predicted[0], strict=True)])
    motion, base_u, cause_u = [], [], []
    for _ in range(SPECIMENS):
        u, drawn_causes = base_by_chance(rng, straw, near), causes_by_chance(rng, straw.cells)
        moved = _moved(rng, straw, u, drawn_causes, protocols, settling_s, rests)
        if moved is not None:
            motion.append(moved)
            base_u.append(u)
            cause_u.append(_row(straw.cells, drawn_causes))
    if not motion:
        return None
    return Group(
        straw, protocols, settling_s, gauges, _stacked(motion), _stacked(predicted),
        np.array(base_u), np.array(cause_u), usual,
    )  # fmt: skip


def simulate_until(folder: Path, seeds: Sequence[int], stop: Any = lambda: False) -> int:
    """Simulate the groups of some seeds that are not in the folder yet; return how many campaigns they hold."""
    folder.mkdir(parents=True, exist_ok=True)
    count = 0
    for seed in seeds:
        path = folder / f"group-{seed:06d}.npz"
        if stop():
            break
        if not path.exists() and (group := simulated_group(seed)) is not None:
            group.save(path)
            count += len(group.motion)
    return count


def played(
    straw: StrawParameters,
    table: Table,
    time_s: Floats,
    deployed: Collection[int],
    cycle: int,
    near: Floats | None = None,
) -> tuple[Floats, Floats]:
    """Tip (3, n) of a straw at times (n,), and the rest it starts from, ``near`` one if given; ModelError where it
    cannot."""
    seen = run(straw.replace(cycle=float(cycle)), table, time_s, deployed, TOLERANCE_M, near, MOST_STEPS_PER_S)
    return np.stack([seen.x_m, seen.z_m, seen.phi_rad]), seen.rest


def _gauge_fault(rng: np.random.Generator, cells: int, name: str) -> tuple[float, float]:
    """Random offset (Pa) and gain of a gauge."""
    unknowns = causes(cells)[name][0]
    values = {
        one.target: one.value(float(u)) for one, u in zip(unknowns, fault_by_chance(rng, cells, name), strict=True)
    }
    return values.get("instrument.gauge_offset_pa", 0.0), values.get("instrument.gauge_gain", 0.0)


def _predicted(
    straw: StrawParameters,
    protocol: Protocol,
    settling_s: float,
    gauge: tuple[float, float] = (0.0, 0.0),
    near: Floats | None = None,
) -> tuple[Floats, Floats] | None:
    """Tip and rest of a straw under the pressure that a gauge with this offset (Pa) and gain shows; None where it
    cannot follow."""
    offset_pa, gain = gauge
    table_s = np.arange(0.0, protocol.seconds + BEYOND_S + TABLE_S, TABLE_S)
    shown_pa = (1 + gain) * protocol.regulated(table_s, settling_s) + offset_pa
    frames_s = np.arange(0.0, protocol.seconds + BEYOND_S, FRAME_S)
    try:
        return played(straw, Table(0.0, TABLE_S, shown_pa), frames_s, protocol.deployed, protocol.cycle, near)
    except ModelError:
        return None


def _moved(
    rng: np.random.Generator,
    nominal_straw: StrawParameters,
    base_u: Floats,
    drawn_causes: dict[str, Floats],
    protocols: Sequence[Protocol],
    settling_s: float,
    rests: Sequence[Floats],
) -> list[Floats] | None:
    """Motions of one specimen; None where one of its runs cannot be simulated."""
    library = causes(nominal_straw.cells)
    unknowns = base_unknowns(nominal_straw) + tuple(one for name in drawn_causes for one in library[name][0])
    try:
        straw, instrument = applied(nominal_straw, unknowns, np.concatenate([base_u, *drawn_causes.values()]))
        straw = cells_differ(rng, straw)
    except ModelError:
        return None
    assert instrument == Instrument()
    out = []
    for protocol, rest in zip(protocols, rests, strict=True):
        near = rest if len(rest) == straw.coordinates else None
        found = _predicted(another_time(rng, straw), protocol, settling_s, near=near)
        if found is None:
            return None
        out.append(found[0])
    return out


def _row(cells: int, drawn_causes: dict[str, Floats]) -> Floats:
    return np.concatenate(
        [drawn_causes.get(name, np.full(len(unknowns), np.nan)) for name, (unknowns, _) in causes(cells).items()]
    )


def _stacked(rows: Sequence[Sequence[Floats]]) -> Singles:
    """Motions (rows, n, 3, t), NaN beyond the end of the shorter."""
    longest = max(one.shape[1] for row in rows for one in row)
    out = np.full((len(rows), len(rows[0]), 3, longest), np.nan, dtype=np.float32)
    for i, row in enumerate(rows):
        for j, one in enumerate(row):
            out[i, j, :, : one.shape[1]] = one
    return out
