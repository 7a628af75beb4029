"""Fit: the landscape of a frustum as an even polynomial with its end, and how well it follows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from straw.model.elasticity import Elasticity
from straw.model.errors import ModelError
from straw.model.shell.landscape import Landscape
from straw.model.shell.strain import Floats
from straw.model.terms.shell_energy import POWERS, shell_energy, shell_force

#: A straw is in states of little energy: a point counts half where its energy is this many times the barrier's of
#: equation 7's scale, a quarter of the largest; and these are what errors of energy, force, moment weigh alike:
#: one per mille of the energy, the force that does it over the height, the moment over an angle of 0.2 rad.
SOFT_SHARE = 0.05
ENERGY_WEIGHT = 1e-3
#: Where the polynomial ends, |zeta| + r_i |phi| as a share of the slant: there the energy is four times the barrier and
#: rises so steeply that the wall behind is hardly stiffer; beyond, order 10 would follow less well where straws are.
END = 0.88
FEWEST_POINTS = 150


@dataclass(frozen=True)
class Quality:
    """How far a fit is from the finite elements: root mean squares over points of up to an energy."""

    below_j: float
    points: int
    energy_j: float
    force_n: float
    moment_n_m: float


def _derivatives(x: Floats, w: Floats, by_x: int, by_w: int) -> Floats:
    """Columns of all powers, differentiated so often, at x = zeta / end, w = r_i phi / end."""

    def one(a: Floats, power: int, times: int) -> Floats:
        if power < times:
            return np.zeros_like(a)
        return np.asarray(math.perm(power, times) * a ** (power - times))

    return np.column_stack([one(x, i, by_x) * one(w, j, by_w) for i, j in POWERS])


def fitted(land: Landscape, made: str = "") -> Elasticity:
    """The elasticity of a landscape; ModelError where it is too small or not of a cone."""
    problem = land.problem
    walls = problem.profile.walls
    if len(walls) != 1 or len(walls[0].points_m) != 2 or np.ptp(walls[0].thickness_m) > 0:
        raise ModelError("shell: an elasticity is made of one conical frustum of one thickness")
    if problem.pressure_pa != 0:
        raise ModelError("shell: an elasticity is made without pressure; the model adds it by itself")
    if len(land.points) < FEWEST_POINTS:
        raise ModelError(f"shell: a landscape of {len(land.points)} points, expected {FEWEST_POINTS} or more for a fit")
    r_o, r_i, zeta0 = (float(walls[0].points_m[i, j]) for i, j in ((0, 0), (1, 0), (1, 1)))
    h, w = float(walls[0].thickness_m[0]), r_o - r_i
    end = END * problem.slant_m
    land = replace(land, points=land.points[np.abs(land.points[:, 0]) + r_i * land.points[:, 1] <= 1.001 * end])
    x, y = land.column("zeta_m") / end, r_i * land.column("phi_rad") / end
    energy, force, moment = (land.column(name) for name in ("energy_j", "force_n", "moment_n_m"))
    soft = SOFT_SHARE * energy.max()
    weight = 1 / (1 + (energy / soft) ** 2)
    per = weight / (ENERGY_WEIGHT * soft)
    values = _derivatives(x, y, 0, 0)
    # forces over the distance between states, moments likewise: an error there is felt as the energy it makes
    reach, turn = 0.5 * end, 0.5 * end / r_i
    A = np.vstack(
        [
            values * per[:, None],
            _derivatives(x, y, 1, 0) / end * (per * reach)[:, None],
            _derivatives(x, y, 0, 1) * r_i / end * (per * turn)[:, None],
        ]
    )
    b = np.concatenate([energy * per, force * per * reach, moment * per * turn])
    whole = _solved(A, b)
    bending = _solved(values * per[:, None], land.column("bending_j") * per)
    by_zeta0 = _solved(values * per[:, None], land.column("by_zeta0_n") * per)
    C1 = math.pi * problem.E_pa * h / (8 * w**3) * ((r_o + r_i) / 2 - w / math.log(r_o / r_i))
    rim = np.abs(x) + y > 0.9
    outward = (np.abs(force) + np.abs(moment) / r_i)[rim].max() if rim.any() else np.abs(force).max()
    return Elasticity(
        r_i,
        r_o,
        zeta0,
        h,
        problem.nu,
        end,
        (whole - bending) / (C1 * w**4),
        bending / (C1 * w**4),
        by_zeta0 / (C1 * w**3),
        float(outward / (C1 * w**3)),
        made,
    )


def _solved(A: Floats, b: Floats) -> Floats:
    scale = np.linalg.norm(A, axis=0)
    return np.asarray(np.linalg.lstsq(A / scale, b, rcond=None)[0] / scale)


def quality(land: Landscape, elasticity: Elasticity, below_j: float) -> Quality:
    """How well the fit follows the landscape's points up to an energy."""
    problem = land.problem
    r_i, r_o, h = elasticity.r_i_m, elasticity.r_o_m, elasticity.h_m
    w, log = r_o - r_i, math.log(r_o / r_i)
    C1 = math.pi * problem.E_pa * h / (8 * w**3) * ((r_o + r_i) / 2 - w / log)
    C2 = math.pi * problem.E_pa * h**3 * log / (12 * w**2)
    row = elasticity.row(C1, C2, elasticity.zeta0_m, r_i, r_o)
    within = np.abs(land.column("zeta_m")) + r_i * land.column("phi_rad") <= elasticity.end_m
    inside = land.points[within & (land.column("energy_j") <= below_j)]
    errors = []
    for point in inside:
        force, moment = shell_force(point[0], point[1], r_i, row)
        errors.append([shell_energy(point[0], point[1], r_i, row) - point[2], -force - point[3], -moment - point[4]])
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    return Quality(below_j, len(inside), *(float(x) for x in rms))
