"""Eliminates a straw's linear equations from the tip to the base, for many right-hand sides; linear in the cells.

The straw beyond a joint is an articulated body: its wrench is linear in the joint's motion (Featherstone, Rigid Body
Dynamics Algorithms, chapter 7), here with the relations of an implicit stage between displacement, rate, acceleration.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import allocates_nothing, fused
from straw.model.constants import Constants
from straw.model.inverse import invert
from straw.model.links import (
    ANGLE,
    AX,
    AZ,
    D_SPIN,
    JOINT,
    JOINT_IN_WORLD,
    LAW_ANGLE,
    LAW_SPIN,
    SPIN,
    VX,
    VZ,
    Links,
    X,
    Z,
)
from straw.model.sweeps import Sweeps

Floats = NDArray[np.float64]


@fused
def _tip(c: Constants, s: Links, law: Floats, pushed: Floats, inside_pa: float, A: Floats, wrench: Floats) -> None:
    """The sealing: its wrench per motion of the tip, and the wrench itself."""
    dims, n, tip = s.next.shape[1], c.cells, s.joint[c.cells]
    for row in range(3):
        for d in range(dims):
            A[row, d] = 0.0
    A[0, AX] = A[1, AZ] = -c.m_tip
    A[2, D_SPIN] = -c.I_tip
    end = math.pi * c.r_i**2 * inside_pa
    fx, fz, torque = c.F_X, c.F_Z, c.M_Y
    if dims == JOINT_IN_WORLD:
        fx += pushed[n, 0]
        fz += pushed[n, 1]
        torque += pushed[n, 2]
        A[0, ANGLE] -= fz
        A[1, ANGLE] += fx
        for row in range(3):
            k = law[n, row]
            A[row, X] += k[0]
            A[row, Z] += k[1]
            A[row, VX] += k[2]
            A[row, VZ] += k[3]
            A[row, SPIN] += k[LAW_SPIN]
            A[row, ANGLE] += k[2] * tip[VZ] - k[3] * tip[VX] + k[LAW_ANGLE]
    wrench[0] = -c.m_tip * tip[AX] + end * s.axis[n, 0] + fx
    wrench[1] = -c.m_tip * tip[AZ] + end * s.axis[n, 1] + fz
    wrench[2] = -c.I_tip * tip[D_SPIN] + torque


@fused
def _beyond(A: Floats, there: Floats, column: int, dims: int, r: int) -> tuple[float, float, float]:
    """Wrench from beyond the outer joint by a column: A times what the joint does, whose other rows are zero."""
    fx = fz = moment = 0.0
    if column < dims:
        fx, fz, moment = A[0, column], A[1, column], A[2, column]
        if column == SPIN:
            for d in range(VX, VZ + 1):
                fx += A[0, d] * there[d, column]
                fz += A[1, d] * there[d, column]
                moment += A[2, d] * there[d, column]
        if column in (SPIN, D_SPIN):
            for d in range(AX, AZ + 1):
                fx += A[0, d] * there[d, column]
                fz += A[1, d] * there[d, column]
                moment += A[2, d] * there[d, column]
        if column == ANGLE:
            for d in range(X, Z + 1):
                fx += A[0, d] * there[d, column]
                fz += A[1, d] * there[d, column]
                moment += A[2, d] * there[d, column]
        return fx, fz, moment
    for d in range(AX if column >= dims + 2 * r else VX, dims if column < dims + r else JOINT):
        fx += A[0, d] * there[d, column]
        fz += A[1, d] * there[d, column]
        moment += A[2, d] * there[d, column]
    return fx, fz, moment


@allocates_nothing
def eliminate(
    c: Constants, s: Links, law: Floats, pushed: Floats, inside_pa: float, hg: float, work: Floats, e: Sweeps
) -> None:
    """Fill ``back`` and ``ahead`` from the links for stages of an effective length hg; ``work`` (12, 24) is scratch."""
    k, r, dims = 2 * c.active, len(s.slots), s.next.shape[1]
    if k == 2 and r == 2 and dims == JOINT:  # sizes known at compile time: most straws, in half the time
        _eliminate(c, s, law, pushed, inside_pa, hg, work, e, 2, 2, JOINT)
    elif k == 2 and r == 3 and dims == JOINT:
        _eliminate(c, s, law, pushed, inside_pa, hg, work, e, 2, 3, JOINT)
    else:
        _eliminate(c, s, law, pushed, inside_pa, hg, work, e, k, r, dims)


@fused
def _eliminate(
    c: Constants,
    s: Links,
    law: Floats,
    pushed: Floats,
    inside_pa: float,
    hg: float,
    work: Floats,
    e: Sweeps,
    k: int,
    r: int,
    dims: int,
) -> None:
    A, wrench = work[0:3], work[3]
    S, inverse = work[4:8], work[8:12]
    given, beyond, q, v = 3, 3 + k, 6 + k, 6 + 2 * k
    tied = k + r  # known displacements and rates of what moves, then displacements of what does not
    bends = dims + k - 1  # the displacement of phi_2, last of what moves
    _tip(c, s, law, pushed, inside_pa, A, wrench)
    for i in range(c.cells - 1, -1, -1):
        own, there, back, ahead = s.own[i], s.next[i], e.back[i], e.ahead[i]
        ux, uz, length = s.axis[i, 0], s.axis[i, 1], s.length[i]
        across = wrench[0] * uz - wrench[1] * ux
        # all columns of the outer part are added to the cell's own rows
        for column in range(dims + 3 * r):
            fx, fz, moment = _beyond(A, there, column, dims, r)
            if column == bends:  # the outer part turns, and the force that it transmits turns with it
                fx += wrench[1]
                fz -= wrench[0]
            arm = moment + length * (fx * uz - fz * ux)
            if dims <= column < dims + r and s.slots[column - dims] < 2:
                arm += across
            own[0, column] += fx
            own[1, column] += fz
            own[2, column] += arm
            for row in range(k):
                slot = s.slots[row]
                own[3 + row, column] += fx * ux + fz * uz if slot < 2 else arm if slot == 2 else moment
        wrench[2] += length * across + s.wrench[i, 2]
        wrench[0] += s.wrench[i, 0]
        wrench[1] += s.wrench[i, 1]
        if c.active == 2:
            own[0, dims + 2] += wrench[1]
            own[1, dims + 2] -= wrench[0]
        # displacements and rates follow accelerations: one matrix for what moves
        for row in range(3 + k):
            for x in range(k):
                own[row, dims + 2 * r + x] += hg * (own[row, dims + r + x] + hg * own[row, dims + x])
        for row in range(dims):
            for x in range(k):
                there[row, dims + 2 * r + x] += hg * (there[row, dims + r + x] + hg * there[row, dims + x])
        for row in range(k):
            for x in range(k):
                S[row, x] = own[3 + row, dims + 2 * r + x]
        invert(S, k, inverse)
        for row in range(k):
            for x in range(6 + k + tied):
                back[row, x] = 0.0
            for x in range(k):
                part, slot = inverse[row, x], s.slots[x]
                back[row, given + x] = part
                if slot < 2:
                    back[row, beyond] += part * ux
                    back[row, beyond + 1] += part * uz
                else:
                    back[row, beyond + 2] += part
                    if slot == 2:
                        back[row, beyond] += part * length * uz
                        back[row, beyond + 1] -= part * length * ux
                for y in range(r):
                    back[row, q + y if y < k else q + k + y] += part * own[3 + x, dims + y]
                    if y < k:
                        back[row, v + y] += part * own[3 + x, dims + r + y]
        for row in range(3):
            target = back[k + row]
            for x in range(6 + k + tied):
                target[x] = 0.0
            target[row] = target[beyond + row] = 1.0
            if row == 2:
                target[beyond], target[beyond + 1] = length * uz, -length * ux
            for y in range(r):
                target[q + y if y < k else q + k + y] = own[row, dims + y]
                if y < k:
                    target[v + y] = own[row, dims + r + y]
            for x in range(k):
                by = own[row, dims + 2 * r + x]
                for y in range(6 + k + tied):
                    target[y] -= by * back[x, y]
        for row in range(k):
            target = ahead[row]
            for x in range(tied + k):
                target[x] = 0.0
            target[tied + row] = -1.0
            for d in range(dims):
                total = 0.0
                for x in range(k):
                    total += inverse[row, x] * own[3 + x, d]
                target[tied + k + d] = -total
        for row in range(dims):
            target = ahead[k + row]
            for y in range(r):
                target[y if y < k else k + y] = there[row, dims + y]
                if y < k:
                    target[k + y] = there[row, dims + r + y]
            for x in range(k):
                target[tied + x] = -there[row, dims + 2 * r + x]
            for d in range(dims):
                total = there[row, d]
                for x in range(k):
                    total += there[row, dims + 2 * r + x] * ahead[x, tied + k + d]
                target[tied + k + d] = total
        for row in range(3):
            for d in range(dims):
                total = own[row, d]
                for x in range(k):
                    total += own[row, dims + 2 * r + x] * ahead[x, tied + k + d]
                A[row, d] = total
