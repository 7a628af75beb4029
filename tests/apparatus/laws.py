"""Forces of one frustum, losses of the channel, loads on the tip: the paper's and the concealed ones, compiled."""

from __future__ import annotations

from math import exp, sqrt

from numba import njit

from . import layout as at
from .walls import wall_force

ATMOSPHERE_PA = 101_325.0
ADIABATIC = 1.4


@njit(cache=True)
def cohesion_n(gap_m, P):
    """Attraction across the gap of a folded frustum: a universal binding curve, or linearly falling traction."""
    reach = P[at.COHESION_REACH]
    if P[at.COHESION_FORM] == 0.0:
        return P[at.COHESION_N] * gap_m / reach * exp(1.0 - gap_m / reach) if gap_m > 0.0 else 0.0
    if gap_m <= 0.0 or gap_m >= reach:
        return 0.0
    contact = 0.05 * reach  # the traction rises elastically before it separates
    return P[at.COHESION_N] * (gap_m / contact if gap_m < contact else (reach - gap_m) / (reach - contact))


@njit(cache=True)
def frustum(active, zeta, phi, zeta_rate, phi_rate, p, d, c, cell, P, row):
    """Force and moment that resist zeta and phi (N, N m) without pressure, and the memory variables of the laws.

    ``d`` and ``c`` give the rates of the memory variables: rate = d x + c.
    """
    soft = (1.0 - P[at.SOFTENING] * P[at.CLOCK]) * (1.0 + P[at.STIFFENING] * p) if active else 1.0
    c1, c2, zeta_0 = row[at.C1] * soft, row[at.C2] * soft, row[at.ZETA_0]
    r2 = P[at.R_I] * P[at.R_I]
    bent = phi - row[at.PHI_SHIFT]
    force = 4.0 * c1 * zeta * (2.0 * (zeta * zeta - zeta_0 * zeta_0) + 3.0 * r2 * bent * bent)
    force += 2.0 * c2 * (zeta - zeta_0) + row[at.C_ZETA] * zeta_rate
    moment = r2 * bent * (c1 * (12.0 * zeta * zeta - 4.0 * zeta_0 * zeta_0 + 3.0 * r2 * bent * bent) + c2)
    if active and P[at.SHELL] != 0.0:  # a share of finite elements' walls in place of the disk spring
        shell_force, shell_moment = wall_force(zeta, bent, P[at.R_I], P, at.SERIES)
        spring = force - row[at.C_ZETA] * zeta_rate
        force += P[at.SHELL] * (row[at.YOUNG] * soft * shell_force - spring)
        moment += P[at.SHELL] * (row[at.YOUNG] * soft * shell_moment - moment)
    moment += row[at.C_PHI] * phi_rate
    s1 = s2 = s3 = bristle = 0.0
    if not active:
        return force, moment, s1, s2, s3, bristle
    gap = zeta - zeta_0
    force += P[at.SQUARE_DAMPING] * abs(zeta_rate) * zeta_rate
    if P[at.COHESION_N] != 0.0:
        force += cohesion_n(gap, P)
    if P[at.FILM] != 0.0:
        film = P[at.FILM] / (1.0 + max(gap, 0.0) / P[at.FILM_GAP]) ** P[at.FILM_POWER]
        force += film * zeta_rate
        moment += film * P[at.FILM_TILT] * phi_rate
    force += P[at.CREASE] * gap + P[at.CREASE_CUBIC] * gap**3
    moment += P[at.CREASE_PHI] * phi + P[at.CREASE_PHI_CUBIC] * phi**3
    if P[at.BUMP] != 0.0:  # energy -B(zeta) phi: the wall tilts to one side while it passes through the middle
        u = zeta / P[at.BUMP_WIDTH]
        if abs(u) < 1.0:
            w = 1.0 - u * u
            moment -= P[at.BUMP] * w * w * (1.0 + P[at.BUMP_SKEW] * u)
            slope = -4.0 * u * w * (1.0 + P[at.BUMP_SKEW] * u) + w * w * P[at.BUMP_SKEW]
            force -= P[at.BUMP] * slope / P[at.BUMP_WIDTH] * phi
    if P[at.BRANCH_1] != 0.0:
        branch = at.BRANCHES + at.BRANCH_COUNT * cell
        s1 = (P[at.BRANCH_1] * zeta_rate - c[branch]) / (d + 1.0 / P[at.TAU_1])
        s2 = (P[at.BRANCH_2] * zeta_rate - c[branch + 1]) / (d + 1.0 / P[at.TAU_2])
        s3 = (P[at.BRANCH_3] * zeta_rate - c[branch + 2]) / (d + 1.0 / P[at.TAU_3])
        force += s1 + s2 + s3
    if P[at.FRICTION] != 0.0:  # LuGre: bristles that deflect and slip, with a larger friction at rest
        stribeck = exp(-((zeta_rate / P[at.FRICTION_SPEED]) ** 2))
        level = P[at.FRICTION] * (1.0 + (P[at.FRICTION_STATIC] - 1.0) * stribeck) / P[at.FRICTION_STIFFNESS]
        speed = sqrt(zeta_rate * zeta_rate + 1e-12)
        memory = c[at.BRISTLES + cell]
        bristle = (zeta_rate - memory) / (d + speed / level)
        force += P[at.FRICTION_STIFFNESS] * bristle + 0.5 * (d * bristle + memory)
    if P[at.STOP_STIFFNESS] != 0.0 and zeta > row[at.STOP]:
        force += P[at.STOP_STIFFNESS] * (zeta - row[at.STOP])
    return force, moment, s1, s2, s3, bristle


@njit(cache=True)
def channel(volume_rate, volume, p_gauge, p, d, c, P):
    """Pressure inside the straw (Pa), flow (m3/s), gas (m3), the line's two stages (Pa), and -dp/d(volume rate)."""
    bernoulli = P[at.RHO] / (2.0 * 9.869604401089358 * P[at.R_CH] ** 4)
    inertance = P[at.INERTANCE] * (1.0 + P[at.INERTANCE_VOLUME] * volume)
    squared = 0.5 * P[at.INERTANCE] * P[at.INERTANCE_VOLUME]  # of 1/2 I(V) Q^2
    first = p_gauge
    if P[at.LAG_1] > 0.0:
        first = (p_gauge / P[at.LAG_1] - c[at.STAGE_1]) / (d + 1.0 / P[at.LAG_1])
    gas = flow = second = impedance = 0.0
    for _ in range(40):
        gas_rate = slope = 0.0
        if P[at.GAS_VOLUME] > 0.0:
            squeezed = max(ATMOSPHERE_PA + p, 2e3)
            gas = P[at.GAS_VOLUME] * (ATMOSPHERE_PA / squeezed) ** (1.0 / ADIABATIC)
            slope = gas / (ADIABATIC * squeezed) * d
            gas_rate = d * gas + c[at.GAS]
        flow = volume_rate - gas_rate + P[at.LEAK] * p
        second, lag_impedance = first, 0.0
        if P[at.LAG_2] > 0.0:
            rate = d + 1.0 / P[at.LAG_2]
            drawn = flow / P[at.LAG_CAPACITY] if P[at.LAG_CAPACITY] > 0.0 else 0.0
            second = (first / P[at.LAG_2] - drawn - c[at.STAGE_2]) / rate
            lag_impedance = 1.0 / (P[at.LAG_CAPACITY] * rate) if P[at.LAG_CAPACITY] > 0.0 else 0.0
        viscous = 0.0
        if P[at.VISCOUS] > 0.0:
            viscous = P[at.VISCOUS] * (1.0 + (flow / P[at.VISCOUS_FLOW]) ** 2) ** (0.5 * (P[at.VISCOUS_POWER] - 1.0))
        loss = (bernoulli * abs(flow) + viscous + squared * flow) * flow + inertance * (d * flow + c[at.FLOW])
        impedance = 2.0 * bernoulli * abs(flow) + viscous + 2.0 * squared * flow + inertance * d + lag_impedance
        wrong = p - second + loss
        answer = 1.0 + impedance * (slope + P[at.LEAK])
        p -= wrong / answer
        if abs(wrong / answer) < 1e-6 or (P[at.GAS_VOLUME] == 0.0 and P[at.LEAK] == 0.0):
            impedance /= answer
            break
    return p, flow, gas, first, second, impedance


@njit(cache=True)
def drag_n(vx, vz, share, P):
    """Force of the ambient air on a body: its coefficient rises as the Reynolds number falls."""
    speed = sqrt(vx * vx + vz * vz + 1e-12)
    size = share * P[at.DRAG] * speed * (1.0 + (P[at.DRAG_SPEED] / speed) ** 0.687)
    return -size * vx, -size * vz


@njit(cache=True)
def tip_load_n(x, z, vx, vz, P):
    """Load of a wind, a stop, a wall beside it, a magnet or a self-excitation on the sealed end."""
    fx, fz = P[at.WIND_X], P[at.WIND_Z]
    if P[at.BOARD_STIFFNESS] > 0.0 and x > P[at.BOARD_STOP]:
        deep = x - P[at.BOARD_STOP]
        fx -= P[at.BOARD_STIFFNESS] * deep * max(0.0, 1.0 + 0.5 * vx)
    if P[at.WALL_STIFFNESS] > 0.0 and z < P[at.WALL_Z]:
        fz += P[at.WALL_STIFFNESS] * (P[at.WALL_Z] - z)
    if P[at.PUSH] != 0.0:
        gain = P[at.PUSH] * (1.0 - (vx * vx + vz * vz) / P[at.PUSH_SPEED] ** 2)
        gain = max(gain, -5.0 * P[at.PUSH])
        fx += gain * vx
        fz += gain * vz
    if P[at.MAGNET] != 0.0:
        dx, dz = P[at.MAGNET_X] - x, P[at.MAGNET_Z] - z
        far2 = dx * dx + dz * dz + 4e-6
        size = P[at.MAGNET] * (1e-4 / far2) / sqrt(far2)
        fx += size * dx
        fz += size * dz
    return fx, fz


@njit(cache=True)
def tip_moment_n_m(phi, P):
    """Moment of a tether that goes taut on the sealed end, and its slope over the angle."""
    over = phi - P[at.TETHER_RAD]
    if P[at.TETHER] == 0.0 or over < 0.0:
        return 0.0, 0.0
    return -P[at.TETHER] * over, -P[at.TETHER]
