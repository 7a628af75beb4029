"""zeta_01, zeta_02, h and E of a straw from two lengths and two snap pressures (section 3.1 of the paper)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, root

from straw.model.elasticity import EQUATION_7
from straw.model.errors import ModelError
from straw.model.frustum_table import frustum_of
from straw.model.parameters import StrawParameters
from straw.model.snap import snap_pair

Floats = NDArray[np.float64]

#: Readings within this of what the found constants give back are met, relative.
MET = 1e-6
#: Snaps are searched up to this many times the larger reading.
SEARCHED = 10.0


@dataclass(frozen=True)
class Readings:
    """What was read off a straw: lengths of a folded and a deployed cell, and where the first cell snaps, gauge.

    Resolutions are the caliper's (also of r_i and r_o) and the step in which the pressure was raised; a reading is
    taken to lie anywhere within one resolution.
    """

    folded_length_m: float
    deployed_length_m: float
    fold_pressure_pa: float
    deploy_pressure_pa: float
    length_resolution_m: float = 1e-5
    pressure_resolution_pa: float = 500.0

    def __post_init__(self) -> None:
        if not 0 < self.folded_length_m < self.deployed_length_m:
            raise ModelError(
                f"geometry: lengths {self.folded_length_m * 1e3:g} and {self.deployed_length_m * 1e3:g} mm; "
                "expected 0 < folded < deployed"
            )
        if not self.fold_pressure_pa < 0 < self.deploy_pressure_pa:
            raise ModelError(
                f"geometry: snap pressures {self.fold_pressure_pa / 1e3:g} and {self.deploy_pressure_pa / 1e3:g} kPa; "
                "expected fold < 0 < deploy"
            )
        if not (self.length_resolution_m >= 0 and self.pressure_resolution_pa >= 0):
            raise ModelError("geometry: a resolution is below zero; give the step of the scale that was read")

    @property
    def values(self) -> Floats:
        """The four readings, in the order of the class."""
        return np.array([self.folded_length_m, self.deployed_length_m, self.fold_pressure_pa, self.deploy_pressure_pa])


@dataclass(frozen=True)
class Geometry:
    """Constants found, each with the standard deviation that the readings' resolution leaves in it."""

    straw: StrawParameters
    zeta01_m: float
    zeta02_m: float
    h_m: float
    E_pa: float
    zeta01_sigma_m: float
    zeta02_sigma_m: float
    h_sigma_m: float
    E_sigma_pa: float


def identify_geometry(readings: Readings, straw: StrawParameters, *, held: bool = True) -> Geometry:
    """Constants, equal in all cells, with which the model gives the readings back; the rest is ``straw``'s.

    Four equations as in section 3.1: zeta_01 + zeta_02 is the folded length (zeta_02 < 0 is the stress-free folded
    state); zeta_01 + zeta_dep is the deployed one, zeta_dep the other stable root of equation 6a at phi = F = p = 0;
    the first active frustum, alone deployed or alone folded in the straw under gravity, loses stability at the two
    pressures: the 2 x 2 Jacobian of its own coordinates turns singular. With ``held`` (the paper's numbers come back
    to the last digit) the other frusta stay as they rest without pressure; without, the whole straw moves on with the
    pressure and its full stiffness decides.
    Sigmas are first-order: the readings' and the radii's resolutions, uniform, through the inverse Jacobian.
    Raises ModelError where no straw gives such readings.
    """

    def made(h_m: float, E_pa: float) -> StrawParameters:
        zeta02_m = _folded_height(readings, straw, h_m)
        zeta0_m = np.array([readings.folded_length_m - zeta02_m, zeta02_m])
        return straw.replace(zeta0_m=zeta0_m, h_m=np.array(h_m), E_pa=np.array(E_pa))

    def misfit(x: Floats) -> Floats:
        return np.asarray(_readings_of(made(*np.exp(x)), held, limit_pa)[2:] / readings.values[2:] - 1)

    limit_pa = SEARCHED * max(readings.deploy_pressure_pa, -readings.fold_pressure_pa)
    if straw.elasticity != EQUATION_7:
        best = _by_table(readings, straw, held, limit_pa)
        numbers = (*best.zeta0_m[0].tolist(), float(best.h_m[0, 0]), float(best.E_pa[0, 0]))
        return Geometry(best, *numbers, *_sigmas(best, readings, held, limit_pa).tolist())
    start = _without_gravity(readings, made, _thickest(readings, straw))
    try:
        found = root(misfit, np.log(start), tol=1e-9)
    except ModelError:
        raise ModelError(
            "geometry: a straw with these readings would not carry itself or not snap; check units and signs"
        ) from None
    if np.abs(found.fun).max() > MET:
        raise ModelError("geometry: no straw gives these lengths and snap pressures; check units and signs")
    h_m, E_pa = (float(x) for x in np.exp(found.x))
    best = made(h_m, E_pa)
    sigma = _sigmas(best, readings, held, limit_pa)
    zeta01_m, zeta02_m = (float(x) for x in best.zeta0_m[0])
    return Geometry(best, zeta01_m, zeta02_m, h_m, E_pa, *(float(x) for x in sigma))


def _by_table(readings: Readings, straw: StrawParameters, held: bool, limit_pa: float) -> StrawParameters:
    """The straw that gives the readings where finite elements take equation 7's place: nothing in closed form."""

    def made(x: Floats) -> StrawParameters:
        zeta02_m = -math.exp(x[0])
        zeta0_m = np.array([readings.folded_length_m - zeta02_m, zeta02_m])
        return straw.replace(zeta0_m=zeta0_m, h_m=np.array(math.exp(x[1])), E_pa=np.array(math.exp(x[2])))

    def misfit(x: Floats) -> Floats:
        return np.asarray(_readings_of(made(x), held, limit_pa)[1:] / readings.values[1:] - 1)

    start = np.log([-straw.zeta0_m[0, 1], straw.h_m[0, 1], straw.E_pa[0, 1]])
    found = root(misfit, start, tol=1e-9)
    if np.abs(found.fun).max() > MET:
        raise ModelError(
            "geometry: no straw near this elasticity's geometry gives these readings; check units and signs"
        )
    return made(found.x)


def _readings_of(straw: StrawParameters, held: bool, limit_pa: float) -> Floats:
    """The four readings of a straw: lengths (m) of its unloaded first cell, snap pressures (Pa) of its first cell."""
    odd, even = straw.zeta0_m[0]
    deployed = frustum_of(straw).equilibria()[0].zeta_m
    down, up = snap_pair(straw, 1, held=held, limit_pa=limit_pa)
    return np.array([odd + even, odd + deployed, down.pressure_pa, up.pressure_pa])


def _thickest(readings: Readings, straw: StrawParameters) -> float:
    """Thickness above which no frustum has the travel that was read, m; see `_folded_height`."""
    c, travel = straw.constants(), readings.deployed_length_m - readings.folded_length_m
    return travel * float(straw.h_m[0, 1] * np.sqrt(c.C1[0, 1] / (2 * c.C2[0, 1])))


def _folded_height(readings: Readings, straw: StrawParameters, h_m: float) -> float:
    """zeta_02 of a straw of some thickness, m.

    With z = |zeta_02| and k = C2 / (4 C1), which grows as h^2, zeta_dep solves x^2 - z x + k = 0. What a cell
    lengthens by is zeta_dep + z, so that 2 z^2 - 3 travel z + travel^2 + k = 0, with z = travel / 2 for a thin wall.
    """
    travel = readings.deployed_length_m - readings.folded_length_m
    k = travel**2 / 8 * (h_m / _thickest(readings, straw)) ** 2
    return -(3 * travel - math.sqrt(travel**2 - 8 * k)) / 4


def _without_gravity(readings: Readings, made: Callable[[float, float], StrawParameters], h_max: float) -> Floats:
    """(h, E) of the straw that would snap there without gravity: h sets the pressures' ratio, E scales both."""
    wanted = readings.deploy_pressure_pa / -readings.fold_pressure_pa

    def pressures(h_m: float) -> tuple[float, float]:
        low, _, _, high = frustum_of(made(h_m, 1e9), sealed=True).bifurcation_pressures()
        return low, high

    def ratio(h_m: float) -> float:
        low, high = pressures(h_m)
        return high / -low - wanted

    try:
        h_m = float(brentq(ratio, 1e-3 * h_max, 0.999 * h_max))
    except (ModelError, ValueError):
        raise ModelError(
            f"geometry: no wall thickness makes a frustum deploy at {wanted:.3g} times the pressure it folds at; "
            "check the readings"
        ) from None
    return np.array([h_m, 1e9 * readings.fold_pressure_pa / pressures(h_m)[0]])


def _sigmas(straw: StrawParameters, readings: Readings, held: bool, limit_pa: float) -> Floats:
    """Standard deviations of (zeta_01, zeta_02, h, E), (4,)."""
    x = np.array([*straw.zeta0_m[0], straw.h_m[0, 0], straw.E_pa[0, 0], straw.r_i_m, straw.r_o_m])
    step = 1e-4 * np.abs(x)
    by = np.empty((4, len(x)))
    for j in range(len(x)):
        moved = []
        for sign in (1, -1):
            y = x.copy()
            y[j] += sign * step[j]
            changed = straw.replace(zeta0_m=y[:2], h_m=np.array(y[2]), E_pa=np.array(y[3]), r_i_m=y[4], r_o_m=y[5])
            moved.append(_readings_of(changed, held, limit_pa))
        by[:, j] = (moved[0] - moved[1]) / (2 * step[j])
    length, pressure = readings.length_resolution_m, readings.pressure_resolution_pa
    resolution = np.array([length, length, pressure, pressure, length, length]) / math.sqrt(12)
    back = np.linalg.inv(by[:, :4])
    return np.asarray(np.sqrt(np.square(np.hstack([back, -back @ by[:, 4:]]) * resolution).sum(axis=1)))
