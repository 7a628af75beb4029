"""The straw: the sum of its terms, as a residual, an acceleration and the quantities a rig observes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from straw.model.channel import channel_of, still_pressure
from straw.model.compiled import allocates_nothing, called, compiled, composed, exposed
from straw.model.constants import Constants
from straw.model.frusta import MEMORIES, add_frusta, frusta_energy
from straw.model.inertia import add_inertia, mass_matrix
from straw.model.kinematics import Chain, chain_of, empty_chain, place, tip_pose
from straw.model.load import Load, no_load, project, unload
from straw.model.motion import Motion, motion_of, spread, still_motion
from straw.model.terms import COLUMNS, TERMS
from straw.model.terms.gravity import add_gravity
from straw.model.terms.pressure import add_pressure, pressure_per_pa
from straw.model.terms.tip_load import add_tip_load

Floats = NDArray[np.float64]


def _body_terms() -> Any:
    """One compiled function adding all terms that act on the bodies along the straw (see `straw.model.frusta`)."""

    @composed
    def total(c: Constants, k: Floats, s: Chain, load: Load) -> None:
        pass

    def plus(first: Callable[..., Any], force: Callable[..., Any], start: int, end: int) -> Any:
        @composed
        def both(c: Constants, k: Floats, s: Chain, load: Load) -> None:
            first(c, k, s, load)
            force(c, k[start:end], s, load)

        return both

    for name, term in TERMS.items():
        if term.kind == "body":
            total = plus(total, term.force, *COLUMNS[name])
    return total


_add_body_terms = _body_terms()


@called
def body_loads(c: Constants, k: Floats, s: Chain, load: Load) -> None:
    """What the terms that act on the bodies alone do, into ``load``; ``k`` is a row of all terms' constants."""
    unload(load)
    _add_body_terms(c, k, s, load)


class Room(NamedTuple):
    """Scratch arrays of one evaluation, allocated once."""

    motion: Motion
    chain: Chain
    load: Load


@compiled
def room_for(c: Constants) -> Room:
    """Allocate for a straw."""
    return Room(still_motion(c), empty_chain(c.cells), no_load(c.cells))


@allocates_nothing
def volume_rate(c: Constants, v: Floats) -> float:
    """Rate of the volume inside, m^3/s."""
    total = 0.0
    for i in range(len(v) // 2):
        total += v[i]
    return c.S * total


@exposed
def forces_left(
    c: Constants,
    q: Floats,
    v: Floats,
    a: Floats,
    inside_pa: float,
    known: Floats,
    now: Floats,
    step_s: float,
    room: Room,
    out: Floats,
) -> None:
    """Hamilton's principle for motion (q, v, a): generalised force left over, into out; zero where a is right.

    ``known``, ``now``: what the frusta remember before and after an implicit step (see `straw.model.frusta`).
    """
    m, s, load = room.motion, room.chain, room.load
    spread(c, q, v, a, m)
    m.inside_pa[0] = inside_pa
    place(c, m, s)
    unload(load)
    add_inertia(c, s, load)
    add_frusta(c, m, known, now, step_s, load)
    add_gravity(c, s, load)
    add_pressure(c, s, inside_pa, load)
    add_tip_load(c, load)
    _add_body_terms(c, c.terms[0, 0], s, load)
    project(c, s, load, out)


@compiled
def pressure_at(c: Constants, v: Floats, external_pa: float) -> float:
    """Pressure inside, Pa (equation 2, the laminar loss and leaks), where lag, gas and inertia of the inlet do not
    matter."""
    return still_pressure(channel_of(c), external_pa, volume_rate(c, v))[0]


@compiled
def residual(c: Constants, q: Floats, v: Floats, a: Floats, external_pa: float) -> Floats:
    """Generalised force left over (coordinates,) for a straw that remembers nothing, without lag or gas in the line."""
    inside_pa = pressure_at(c, v, external_pa) - channel_of(c).inertance * volume_rate(c, a)
    memory = np.zeros((c.cells, 2, MEMORIES, 2))
    out = np.empty_like(q)
    forces_left(c, q, v, a, inside_pa, memory, memory, 0.0, room_for(c), out)
    return out


@compiled
def mass_at(c: Constants, q: Floats) -> Floats:
    """Mass matrix at q, shape (coordinates, coordinates), with the inertia of the fluid in the channel."""
    still = np.zeros_like(q)
    n = len(q)
    M, push = np.empty((n, n)), np.empty(n)
    s = chain_of(c, motion_of(c, q, still, still))
    mass_matrix(c, s, M)
    pressure_per_pa(c, s, push)
    M[:, : n // 2] += channel_of(c).inertance * c.S * push.reshape(n, 1)
    return M


@compiled
def acceleration(c: Constants, q: Floats, v: Floats, external_pa: float) -> Floats:
    """Second derivative of q: M(q)^-1 times all forces.

    Only the truncated form has one. In the full form each cell's fluid, a rigid body with three velocities, has four
    coordinates, so M has rank 3 (N + 1) at most, below 4 N from N = 4 on: inertia alone does not say how the
    coordinates accelerate, and what comes back is rounding error. `straw.model.integrate` never divides by M.
    """
    return np.asarray(np.linalg.solve(mass_at(c, q), residual(c, q, v, np.zeros_like(q), external_pa)), np.float64)


@compiled
def volume_at(c: Constants, q: Floats) -> float:
    """Volume of the fluid inside the straw, m^3."""
    height = 0.0
    for i in range(c.cells):
        height += q[i] + (q[c.cells + i] if c.active == 2 else c.zeta0[i, 0])
    return float(c.S * height)


@compiled
def seen(c: Constants, q: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Tip X, Z (m), Phi (rad) and volume (m^3), each (n,), of states q (n, coordinates)."""
    x_m, z_m, phi_rad, volume_m3 = np.empty(len(q)), np.empty(len(q)), np.empty(len(q)), np.empty(len(q))
    for i in range(len(q)):
        x_m[i], z_m[i], phi_rad[i] = tip_pose(c, q[i])
        volume_m3[i] = volume_at(c, q[i])
    return x_m, z_m, phi_rad, volume_m3


@compiled
def kinetic_energy_at(c: Constants, q: Floats, v: Floats) -> float:
    """Kinetic energy, J (equation 3)."""
    s = chain_of(c, motion_of(c, q, v, np.zeros_like(q)))
    energy = 0.0
    for i in range(c.cells + 1):
        energy += s.mass[i] * (s.velocity[i, 0] ** 2 + s.velocity[i, 1] ** 2) / 2 + s.inertia[i] * s.spin[i] ** 2 / 2
    return energy


@compiled
def potential_energy_at(c: Constants, q: Floats) -> float:
    """Energy stored in the frusta and in height above the base, J (equation 5)."""
    still = np.zeros_like(q)
    m = motion_of(c, q, still, still)
    s = chain_of(c, m)
    energy = frusta_energy(c, m)
    for i in range(c.cells + 1):
        energy += s.mass[i] * c.g * s.position[i, 1]
    return energy
