"""The columns of a run (derivatives of its state by P parameters), and the scratch arrays that propagate them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.channel import STATES
from straw.model.compiled import allocates_nothing, compiled
from straw.model.constants import Constants
from straw.model.frusta import MEMORIES
from straw.model.given import Given
from straw.model.kinematics import Chain, empty_chain
from straw.model.links import JOINT, JOINT_IN_WORLD, LAW_IN, LAW_OUT, Links, links_for
from straw.model.load import Load, no_load
from straw.model.motion import Motion, still_motion
from straw.model.scheme import STAGES
from straw.model.sweeps import Sweeps, sweeps_for, wide

Floats = NDArray[np.float64]


class Columns(NamedTuple):
    """Derivatives of a run's state by P parameters; coordinates of a cell as in `straw.model.linearised`."""

    qv: Floats  # (cells, 2 moving wide) displacements, then rates, row by row, each padded with zeros
    memory: Floats  # (cells, 2, MEMORIES, 2, P)
    inlet: Floats  # (STATES, P)
    inside_pa: Floats  # (P,)


class Bench(NamedTuple):
    """Scratch arrays of the columns, allocated once."""

    motion: Motion
    chain: Chain
    load: Load
    links: Links
    sweeps: Sweeps
    found: Floats  # (cells, moving, wide) accelerations; behind the columns those per pascal inside
    qv: Floats  # (STAGES, cells, 2 moving wide) rates of the columns in each stage
    memory: Floats  # (STAGES, cells, 2, MEMORIES, 2, P)
    inlet: Floats  # (STAGES, STATES, P)
    known_memory: Floats
    known_inlet: Floats
    now_memory: Floats
    now_inlet: Floats
    external: Floats  # (P,)
    flow: Floats  # (wide,)
    inside_pa: Floats  # (wide,)
    slopes: Floats  # (cells, 2, 2, 4)
    memory_by: Floats  # (cells, 2, MEMORIES, 2, 7)
    law: Floats  # (cells + 1, LAW_OUT, LAW_IN)
    pushed: Floats  # (cells + 1, LAW_OUT)
    eliminating: Floats
    remembering: Floats  # (5, MEMORIES, 2)
    row: Floats  # (WIDTH,)
    zeta0: Floats  # (cells, 2)
    pushed_by: Floats  # (cells + 1, LAW_OUT)
    unpushed: Floats  # (cells + 1, LAW_OUT) zero
    ends: Floats  # (2, cells, 7)
    wall: Floats  # a row of straw.model.terms.shell_energy


@compiled
def bench_for(c: Constants, given: Given, P: int) -> Bench:
    """Scratch for P columns."""
    n, k = c.cells, 2 * c.active
    dims = JOINT_IN_WORLD if given.in_world else JOINT
    links = links_for(c, dims, 1 if given.odd_moves else 0)
    memory = np.zeros((c.cells, 2, MEMORIES, 2, P if given.remembers else 0))
    return Bench(
        still_motion(c),
        empty_chain(n),
        no_load(n),
        links,
        sweeps_for(c, links, P + 1),
        np.zeros((n, k, wide(P + 1))),
        np.zeros((STAGES, n, 2 * k * wide(P + 1))),
        np.zeros((STAGES, n, 2, MEMORIES, 2, memory.shape[4])),
        np.zeros((STAGES, STATES, P)),
        memory,
        np.zeros((STATES, P)),
        memory.copy(),
        np.zeros((STATES, P)),
        np.zeros(P),
        np.zeros(wide(P + 1)),
        np.zeros(wide(P + 1)),
        np.zeros((n, 2, 2, 4)),
        np.zeros((n, 2, MEMORIES, 2, 7)),
        np.zeros((n + 1, LAW_OUT, LAW_IN)),
        np.zeros((n + 1, LAW_OUT)),
        np.zeros((12, 24)),
        np.zeros((5, MEMORIES, 2)),
        np.zeros(c.terms.shape[2]),
        np.zeros((n, 2)),
        np.zeros((n + 1, LAW_OUT)),
        np.zeros((n + 1, LAW_OUT)),
        np.zeros((2, n, 7)),
        np.zeros(c.wall.shape[2]),
    )


@allocates_nothing
def add(share: float, row: Floats, out: Floats) -> None:
    """Add a multiple of a row to another."""
    for p in range(np.uint64(len(row))):
        out[p] += share * row[p]
