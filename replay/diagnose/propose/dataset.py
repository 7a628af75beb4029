"""Training data: features of recordings made of simulated groups, kept beside them as files."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.propose import features as features_module
from straw.replay.diagnose.propose import movement, recorded, seen
from straw.replay.diagnose.propose.features import features
from straw.replay.diagnose.propose.network import Batch, Truth
from straw.replay.diagnose.propose.recorded import recorded as recording_of
from straw.replay.diagnose.propose.simulate_campaigns import Group, library_unknowns
from straw.replay.diagnose.systems.straw.constants import base_unknowns
from straw.replay.diagnose.systems.straw.library import causes

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


@dataclass(frozen=True)
class Number:
    """One number the network estimates: u of an unknown, or its magnitude."""

    cause: str  # empty for the base's constants
    unknown: Unknown
    size_only: bool = False

    @property
    def name(self) -> str:
        """Its name in the weights."""
        return f"{self.cause}|{self.unknown.target}" + ("|size" if self.size_only else "")


def numbers(straw: StrawParameters) -> list[Number]:
    """All numbers estimated for a campaign with this nominal straw."""
    out = [Number("", one) for one in base_unknowns(straw)]
    of_causes = library_unknowns(straw.cells)
    out += [Number(name, one) for name, one in of_causes]
    out += [Number(name, one, True) for name, one in of_causes if one.kind == "strength" and one.low < 0]
    return out


@dataclass(frozen=True, eq=False)
class Examples:
    """Recordings one after the other: features of their runs (runs, features), where each begins, and the truth."""

    x: NDArray[np.float16]
    starts: NDArray[np.int64]
    present: NDArray[np.bool_]
    values: Singles
    usual: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.starts)

    def batch(self, which: NDArray[np.int64], rng: np.random.Generator | None = None) -> Batch:
        """Some of the recordings; with ``rng`` half of them keep only some of their runs."""
        ends = np.append(self.starts[1:], len(self.x))
        rows, starts, at = [], [], 0
        for k in which:
            mine = np.arange(self.starts[k], ends[k])
            if rng is not None and len(mine) > 1 and rng.random() < 0.5:
                mine = rng.choice(mine, int(rng.integers(1, len(mine))), replace=False)
            rows.append(mine)
            starts.append(at)
            at += len(mine)
        return Batch(self.x[np.concatenate(rows)].astype(np.float32), np.array(starts))

    def truth(self, which: NDArray[np.int64], scales: Singles) -> Truth:
        """The targets, each number in units of its scale."""
        return Truth(self.present[which].astype(np.float32), self.values[which] / scales)


def recipe() -> str:
    """Hash of the code and settings that make features of a group: if it changes they are made again."""
    return hash_of_code(features_module, movement, seen, recorded)


def hash_of_code(*modules: ModuleType) -> str:
    """Hash of some modules' code, independent of its layout."""
    code = (ast.dump(ast.parse(Path(str(m.__file__)).read_text(encoding="utf-8"))) for m in modules)
    return hashlib.sha256("".join(code).encode()).hexdigest()[:12]


def examples_of(path: Path, times: int) -> Examples:
    """Recordings of every specimen of a group, ``times`` each with noise and faults of their own."""
    group = Group.load(path)
    rng = np.random.default_rng([int(path.stem.split("-")[1]), 32])
    kept = path.parent.parent / f"features-{recipe()}-{times}" / path.name
    if not kept.exists():
        rows, starts, base, cause, at = [], [], [], [], 0
        for specimen in range(len(group.motion)):
            for _ in range(times):
                one = recording_of(group, specimen, rng)
                rows.append(features(one.runs).astype(np.float16))
                starts.append(at)
                at += len(one.runs)
                base.append(one.base_u)
                cause.append(one.cause_u)
        kept.parent.mkdir(exist_ok=True)
        part = kept.with_suffix(".part")
        with part.open("wb") as file:
            np.savez(file, x=np.concatenate(rows), starts=np.array(starts), base=np.array(base), cause=np.array(cause))
        part.replace(kept)
    with np.load(kept) as data:
        present, values = _truth(group, data["base"], data["cause"])
        usual = np.full(len(data["starts"]), group.usual)
        return Examples(data["x"], data["starts"], present, values, usual)


def _truth(group: Group, base_u: Floats, cause_u: Floats) -> tuple[NDArray[np.bool_], Singles]:
    columns = [name for name, _ in library_unknowns(group.nominal.cells)]
    there = np.isfinite(cause_u)
    present = np.stack([there[:, columns.index(name)] for name in causes(group.nominal.cells)], axis=1)
    u = np.concatenate([base_u, cause_u], axis=1)
    signed = [len(base_u[0]) + k for k, (_, one) in enumerate(library_unknowns(group.nominal.cells))
              if one.kind == "strength" and one.low < 0]  # fmt: skip
    u = np.concatenate([u, np.abs(u[:, signed])], axis=1)
    return present, u.astype(np.float32)


def joined(parts: Sequence[Examples]) -> Examples:
    """All recordings of several groups."""
    offsets = np.cumsum([0, *(len(p.x) for p in parts[:-1])])
    return Examples(
        np.concatenate([p.x for p in parts]),
        np.concatenate([p.starts + o for p, o in zip(parts, offsets, strict=True)]),
        np.concatenate([p.present for p in parts]),
        np.concatenate([p.values for p in parts]),
        np.concatenate([p.usual for p in parts]),
    )
