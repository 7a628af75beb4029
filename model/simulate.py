"""Simulates a straw under a pressure: a whole run at once, or step by step for a twin behind a wire."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.model.drive import Table
from straw.model.errors import ModelError
from straw.model.integrate import at_rest, integrate
from straw.model.kinematics import tip_pose
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.model.step import DONE, STEP_TOO_SMALL, TOO_MANY_STEPS
from straw.model.straw import seen, volume_at

Floats = NDArray[np.float64]

#: Accuracy of one step in zeta. Chosen against the reference runs, see tests/benchmarks/speed.py.
TOLERANCE_M = 1e-6
#: Steps a simulated second may take; the validation run with more snaps takes some 430.
MOST_STEPS_PER_S = 6_000.0
MAX_STEP_S = 0.02
FIRST_STEP_S = 1e-4
PRESSURE_GRID_S = 2.5e-4


@dataclass(frozen=True)
class Prediction:
    """A predicted run; arrays (n,), per-frustum arrays (n, cells, 2), SI, contract's frames."""

    time_s: Floats
    x_m: Floats
    z_m: Floats
    phi_rad: Floats
    external_pa: Floats
    pressure_pa: Floats
    volume_m3: Floats
    zeta_m: Floats
    frustum_phi_rad: Floats
    steps: int
    evaluations: int  # of the equations of motion, by Newton's iterations in the stages of all steps tried
    rest: Floats  # coordinates (coordinates,) it started from


def simulate(
    straw: StrawParameters,
    pressure: Callable[[Floats], Floats],
    time_s: Floats,
    deployed: Collection[int],
    *,
    tolerance_m: float = TOLERANCE_M,
    near: Floats | None = None,
) -> Prediction:
    """Motion of a straw from rest in a configuration, driven by an external pressure.

    ``pressure`` takes times in seconds (array) and returns Pa; a protocol is one, an interpolated recording is one.
    It is read on a 0.25 ms grid and taken as linear in between. ``time_s`` must increase; the run starts at rest at
    time_s[0], under the pressure of that moment. Raises ModelError where the pressure is not finite, the
    configuration has no rest state, or the motion leaves what the equations describe. ``near`` is the rest state
    (coordinates,) of a slightly different straw, which is faster to start from.
    """
    return run(straw, sampled(pressure, time_s), time_s, deployed, tolerance_m, near)


def sampled(pressure: Callable[[Floats], Floats], time_s: Floats) -> Table:
    """The pressure as the model takes it, over the span of ``time_s``; see `simulate` for the errors."""
    time_s = np.asarray(time_s, dtype=np.float64)
    if time_s.ndim != 1 or len(time_s) < 2 or not np.all(np.diff(time_s) > 0):
        raise ModelError("simulate: time_s must be at least two increasing times")
    start, end = float(time_s[0]), float(time_s[-1])
    points = int(np.ceil((end - start) / PRESSURE_GRID_S)) + 1
    grid = np.linspace(start, end, points)
    pressure_pa = np.require(np.broadcast_to(pressure(grid), grid.shape), np.float64, ("C", "W"))  # see `run`
    if not np.all(np.isfinite(pressure_pa)):
        when = grid[np.flatnonzero(~np.isfinite(pressure_pa))[0]]
        raise ModelError(f"simulate: the pressure is not a number at {when:.4g} s; fill the gap or cut the run there")
    return Table(start, (end - start) / (points - 1), pressure_pa)


def run(
    straw: StrawParameters,
    table: Table,
    time_s: Floats,
    deployed: Collection[int],
    tolerance_m: float = TOLERANCE_M,
    near: Floats | None = None,
    most_steps_per_s: float = MOST_STEPS_PER_S,
) -> Prediction:
    """`simulate` under a pressure that is `sampled` already; plain data in and out, so it can run anywhere."""
    # arrays that cannot be written are another type, for which all of the model would be compiled again
    time_s = np.require(time_s, np.float64, ("C", "W"))
    table = table._replace(pressure_pa=np.require(table.pressure_pa, np.float64, ("C", "W")))
    start, end, first_pa = float(time_s[0]), float(time_s[-1]), float(table.pressure_pa[0])
    c = straw.constants()
    q = rest_state(straw, deployed, first_pa, near=near)
    state = at_rest(c, q, start, first_pa, FIRST_STEP_S)
    out_q, out_v, out_pa = np.empty((len(time_s), len(q))), np.empty((len(time_s), len(q))), np.empty(len(time_s))
    counts = np.zeros(4, np.int64)
    status = integrate(
        c, state, table, time_s, end, tolerance_m, MAX_STEP_S, most_steps_per_s, out_q, out_v, out_pa, counts
    )
    check_status(status, float(state.clock[0]))
    return prediction(straw, table, time_s, out_q, out_pa, counts, q)


def prediction(
    straw: StrawParameters,
    table: Table,
    time_s: Floats,
    out_q: Floats,
    out_pa: Floats,
    counts: NDArray[np.int64],
    rest: Floats,
) -> Prediction:
    """The prediction of states out_q (n, coordinates) and pressures inside; ``counts`` as `integrate` has them."""
    grid = table.start_s + table.step_s * np.arange(len(table.pressure_pa))
    external = np.interp(time_s, grid, table.pressure_pa)
    x_m, z_m, phi_rad, volume_m3 = seen(straw.constants(), out_q)
    zeta, phi = per_frustum(straw, out_q)
    return Prediction(
        time_s=time_s,
        x_m=x_m,
        z_m=z_m,
        phi_rad=phi_rad,
        external_pa=external,
        pressure_pa=out_pa,
        volume_m3=volume_m3,
        zeta_m=zeta,
        frustum_phi_rad=phi,
        steps=int(counts[0]),
        evaluations=int(counts[3]),
        rest=rest,
    )


class Stepper:
    """A straw that moves on as the pressure becomes known: the twin behind an emulated controller."""

    def __init__(self, straw: StrawParameters, deployed: Collection[int], time_s: float = 0.0) -> None:
        self._c = straw.constants()
        q = rest_state(straw, deployed)
        self._state = at_rest(self._c, q, time_s, 0.0, FIRST_STEP_S)
        self._none = np.empty((0, len(q)))

    def advance(self, time_s: float, pressure_start_pa: float, pressure_end_pa: float) -> None:
        """Move on to ``time_s`` under an external pressure that changes linearly meanwhile; the GIL is released."""
        now = self.time_s
        if not time_s > now:
            raise ModelError(f"twin: cannot go back from {now:.6g} s to {time_s:.6g} s")
        table = Table(now, time_s - now, np.array([pressure_start_pa, pressure_end_pa]))
        nothing, counts = np.empty(0), np.zeros(4, np.int64)
        status = integrate(
            self._c,
            self._state,
            table,
            nothing,
            time_s,
            TOLERANCE_M,
            MAX_STEP_S,
            MOST_STEPS_PER_S,
            self._none,
            self._none,
            nothing,
            counts,
        )
        check_status(status, self.time_s)

    @property
    def time_s(self) -> float:
        """Time reached, s."""
        return float(self._state.clock[0])

    @property
    def tip(self) -> tuple[float, float, float]:
        """Tip X (m), Z (m), Phi (rad)."""
        return tip_pose(self._c, self._state.q)

    @property
    def volume_m3(self) -> float:
        """Volume of the fluid inside, m^3."""
        return volume_at(self._c, self._state.q)

    @property
    def pressure_pa(self) -> float:
        """Pressure inside the straw, Pa."""
        return float(self._state.clock[2])


def check_status(status: int, time_s: float) -> None:
    """Raise ModelError, saying what happened at ``time_s``, unless ``integrate`` got to its end."""
    if status != DONE:
        what = {
            STEP_TOO_SMALL: "needs steps below a nanosecond",
            TOO_MANY_STEPS: "needs too many steps",
        }.get(status, "is no longer finite")
        raise ModelError(
            f"simulate: the motion {what} at {time_s:.4g} s; the straw's constants or the pressure are out of range"
        )


def per_frustum(straw: StrawParameters, q: Floats) -> tuple[Floats, Floats]:
    """zeta and phi of every frustum, (n, cells, 2), from coordinates (n, coordinates)."""
    n = straw.cells
    zeta = np.broadcast_to(straw.zeta0_m, (len(q), n, 2)).copy()
    phi = np.zeros((len(q), n, 2))
    k = 2 if straw.form == "full" else 1
    for j in range(k):
        zeta[:, :, j + 2 - k] = q[:, j * n : (j + 1) * n]
        phi[:, :, j + 2 - k] = q[:, (k + j) * n : (k + j + 1) * n]
    return zeta, phi
