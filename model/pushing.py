"""Derivatives of the external forces on the bodies, by their motion and by the constants of the laws."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from straw.model.bench import Bench
from straw.model.compiled import allocates_nothing
from straw.model.constants import Constants
from straw.model.given import AREA, R_I, R_O, RHO, Given
from straw.model.kinematics import Chain
from straw.model.links import LAW_ANGLE, LAW_IN, pushed_loads
from straw.model.straw import body_loads
from straw.model.sweeps import Rows

Floats = NDArray[np.float64]

#: Steps of the derivatives of bodies' laws: place (m), velocity (m/s), mass (kg), spin (rad/s), the tip's angle (rad).
BODY_STEPS = (1e-7, 1e-7, 1e-6, 1e-6, 1e-8, 1e-5, 1e-6)


@allocates_nothing
def body_slopes(c: Constants, b: Bench) -> None:
    """Forces of bodies' laws and their derivatives by each body's own motion, by central differences of the laws."""
    k, s = c.terms[0, 0], b.chain
    _push(c, k, b, b.pushed, 0.0, 1.0)
    for x in range(LAW_IN):
        e = BODY_STEPS[x]
        for sign in (1.0, -1.0):
            _move(s, x, sign * e)
            _push(c, k, b, b.law[:, :, x], 1.0 if sign < 0 else 0.0, sign / (2 * e))
            _move(s, x, -sign * e)


@allocates_nothing
def _move(s: Chain, x: int, by: float) -> None:
    """Change one input of all bodies' laws."""
    if x == LAW_ANGLE:
        s.tip_angle[0] += by
        return
    for i in range(len(s.position)):
        if x < 2:
            s.position[i, x] += by
        elif x < 4:
            s.velocity[i, x - 2] += by
        elif x == 4:
            s.mass[i] += by
        else:
            s.spin[i] += by


@allocates_nothing
def _push(c: Constants, k: Floats, b: Bench, out: Floats, keep: float, share: float) -> None:
    """out (cells + 1, LAW_OUT) = keep out + share times what the bodies' laws do."""
    body_loads(c, k, b.chain, b.load)
    for i in range(c.cells + 1):
        out[i, 0] = keep * out[i, 0] + share * b.load.force[i, 0]
        out[i, 1] = keep * out[i, 1] + share * b.load.force[i, 1]
        out[i, 2] = keep * out[i, 2] + share * b.load.torque[i]


@allocates_nothing
def add_pushed(c: Constants, given: Given, b: Bench, rows: Rows) -> None:
    """Add to the block what directions change of the bodies' laws, column by column."""
    n, links, block, ends = c.cells, b.links, b.sweeps.block, b.ends
    for at in range(len(given.body)):
        p, e = given.body[at], given.body_steps[at]
        x = given.scalars
        for sign in (1.0, -1.0):
            more = sign * e
            for z in range(len(b.row)):
                b.row[z] = c.terms[0, 0, z] + more * given.body_rows[at, z]
            for i in range(n):
                for j in range(2):
                    b.zeta0[i, j] = c.zeta0[i, j] + more * given.body_zeta0[at, i, j]
            moved = Constants(
                c.cells,
                c.active,
                c.r_i + more * x[R_I, p],
                c.r_o + more * x[R_O, p],
                c.rho + more * x[RHO, p],
                c.g,
                c.phi_0,
                c.m_tip,
                c.I_tip,
                c.F_X,
                c.F_Z,
                c.M_Y,
                c.loss,
                c.S + more * x[AREA, p],
                c.C3,
                b.zeta0,
                c.C1,
                c.C2,
                c.wall,
                c.c_zeta,
                c.c_phi,
                c.cycle,
                c.start_s,
                c.plain,
                c.acts,
                c.remembers,
                c.terms,
            )
            # the mass is S rho times a length: laws that ask for it see it move as well
            for i in range(n):
                b.chain.mass[i] *= moved.rho * moved.S / (c.rho * c.S)
            _push(moved, b.row, b, b.pushed_by, 1.0 if sign < 0 else 0.0, sign / (2 * e))
            for i in range(n):
                b.chain.mass[i] /= moved.rho * moved.S / (c.rho * c.S)
        pushed_loads(c, b.motion, b.pushed_by, links, ends[0])
        for i in range(n):
            for z in range(3):
                block[i, z, p] += ends[0, i, z]
            for z in range(2 * c.active):
                block[i, rows.force + z, p] += ends[0, i, 3 + links.slots[z]]
        for z in range(3):
            block[n - 1, rows.beyond + z, p] += b.pushed_by[n, z]
