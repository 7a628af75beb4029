"""The links of a linearised straw, and the load that each cell's body transmits as its base joint moves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.body import I0, L0, MASS, T0, X0, Body, shape_of
from straw.model.compiled import compiled, fused
from straw.model.constants import Constants
from straw.model.motion import Motion

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

#: Motion of a joint: velocity (X, Z), spin, acceleration less gravity's (X, Z), angular acceleration; where the world's
#: axes matter as well its angle and position (X, Z).
JOINT, JOINT_IN_WORLD = 6, 9
VX, VZ, SPIN, AX, AZ, D_SPIN, ANGLE, X, Z = range(9)
#: Number of a body's quantities that a column changes, see `_rows`.
CHANGES = 9
#: Inputs of a body's law of force (place, velocity, mass, spin, and the tip's angle) and its outputs in a
#: `straw.model.load.Load`.
LAW_IN, LAW_OUT = 7, 3
LAW_SPIN, LAW_ANGLE = 5, 6


class Links(NamedTuple):
    """Every cell's linear equations; columns are the joint's ``dims``, then displacements, rates, accelerations.

    Coordinates of a cell come in the order of ``slots`` (0 zeta_1, 1 zeta_2, 2 phi_1, 3 phi_2): those that move, and
    behind them those a direction may change all the same.
    """

    slots: Indices
    own: Floats  # (cells, 3 + moving, dims + 3 slots): wrench about the base joint; generalised force on what moves
    next: Floats  # (cells, dims, dims + 3 slots): what the outer joint does
    wrench: Floats  # (cells, 3) force and moment about the base joint of the cell's own body
    axis: Floats  # (cells + 1, 2) of each cell after its first angle; the last is the tip's
    length: Floats  # (cells,)
    force: Floats  # (cells, slots) of the cell's own body on its coordinates
    joint: Floats  # (cells + 1, JOINT_IN_WORLD) what each cell's base joint does; the last is the tip
    by: Floats  # (4, 12) scratch, see straw.model.body
    second: Floats  # (4, 4) scratch
    changes: Floats  # (21, CHANGES) scratch


@compiled
def links_for(c: Constants, dims: int, extra: int) -> Links:
    """Room for a straw's links; ``extra`` is 1 where a rigid odd frustum's height may be changed."""
    n, k = c.cells, 2 * c.active
    slots = np.array([0, 1, 2, 3]) if c.active == 2 else np.array([1, 3, 0])[: 2 + extra]
    columns = dims + 3 * len(slots)
    return Links(
        slots,
        np.zeros((n, 3 + k, columns)),
        np.zeros((n, dims, columns)),
        np.zeros((n, 3)),
        np.zeros((n + 1, 2)),
        np.zeros(n),
        np.zeros((n, len(slots))),
        np.zeros((n + 1, JOINT_IN_WORLD)),
        np.zeros((4, 12)),
        np.zeros((4, 4)),
        np.zeros((JOINT_IN_WORLD + 12, CHANGES)),
    )


class Loads(NamedTuple):
    """A cell's body in the cell's axes: velocity, acceleration less gravity's, spin, and the load that it transmits."""

    v_u: float
    v_w: float
    a_u: float
    a_w: float
    spin: float
    d_spin: float
    f_u: float
    f_w: float
    torque: float


@fused
def loads_of(
    b: Body, base: Floats, ux: float, uz: float, spin: float, d_spin: float, pushed: Floats, in_world: bool
) -> Loads:
    """A body's motion and transmitted load as its base moves, with ``spin`` after the cell's first angle."""
    v_u = base[VX] * ux + base[VZ] * uz + b.l1 - b.x0 * spin
    v_w = base[VX] * uz - base[VZ] * ux + b.l0 * spin + b.x1
    a_u = base[AX] * ux + base[AZ] * uz + b.l2 - b.l0 * spin**2 - 2 * b.x1 * spin - b.x0 * d_spin
    a_w = base[AX] * uz - base[AZ] * ux + 2 * b.l1 * spin + b.l0 * d_spin + b.x2 - b.x0 * spin**2
    turning, d_turning = spin + b.tilt1, d_spin + b.tilt2
    f_u, f_w = -b.mass * a_u - b.mass1 * v_u, -b.mass * a_w - b.mass1 * v_w
    torque = -b.inertia * d_turning - b.inertia1 * turning
    if in_world:
        f_u += pushed[0] * ux + pushed[1] * uz
        f_w += pushed[0] * uz - pushed[1] * ux
        torque += pushed[2]
    return Loads(v_u, v_w, a_u, a_w, turning, d_turning, f_u, f_w, torque)


@fused
def force_on(by: Floats, p: Loads) -> float:
    """Generalised force of a body on a coordinate, by how its place, tilt, mass and inertia change with it."""
    force = by[L0] * p.f_u + by[X0] * p.f_w + by[T0] * p.torque
    return float(force + by[MASS] * (p.v_u**2 + p.v_w**2) / 2 + by[I0] * p.spin**2 / 2)


@fused
def own_loads(c: Constants, m: Motion, pushed: Floats, s: Links, out: Floats) -> None:
    """Each cell's body alone, where the joints move as in the links, for constants that may be others: into out
    (cells, 7) its wrench about the base joint and its force on zeta_1, zeta_2, phi_1, phi_2."""
    in_world = s.next.shape[1] == JOINT_IN_WORLD
    for i in range(c.cells):
        base, ux, uz = s.joint[i], s.axis[i, 0], s.axis[i, 1]
        b = shape_of(c, m, i, s.slots, s.by)
        p = loads_of(b, base, ux, uz, base[SPIN] + m.d_phi[i, 0], base[D_SPIN] + m.dd_phi[i, 0], pushed[i], in_world)
        out[i, 0], out[i, 1] = p.f_u * ux + p.f_w * uz, p.f_u * uz - p.f_w * ux
        out[i, 2] = p.torque + b.l0 * p.f_w - b.x0 * p.f_u
        for at in range(len(s.slots)):
            slot = s.slots[at]
            out[i, 3 + slot] = force_on(s.by[slot], p)
        if c.active == 2:
            out[i, 5] += out[i, 2]  # phi_1 turns all of the cell


@fused
def pushed_loads(c: Constants, m: Motion, load: Floats, s: Links, out: Floats) -> None:
    """The same as `own_loads` for given forces and torques on the cells' bodies, load (cells + 1, 3)."""
    for i in range(c.cells):
        ux, uz = s.axis[i, 0], s.axis[i, 1]
        b = shape_of(c, m, i, s.slots, s.by)
        f_u, f_w, torque = load[i, 0] * ux + load[i, 1] * uz, load[i, 0] * uz - load[i, 1] * ux, load[i, 2]
        out[i, 0], out[i, 1], out[i, 2] = load[i, 0], load[i, 1], torque + b.l0 * f_w - b.x0 * f_u
        for at in range(len(s.slots)):
            slot = s.slots[at]
            out[i, 3 + slot] = s.by[slot, L0] * f_u + s.by[slot, X0] * f_w + s.by[slot, T0] * torque
        if c.active == 2:
            out[i, 5] += out[i, 2]
