"""SciPy's stiff solvers on the straw: y' = f(t, y) with y = (q, q'), compiled, called from Python per evaluation."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from straw.model.compiled import compiled
from straw.model.constants import Constants
from straw.model.rest import rest_state
from straw.model.straw import acceleration
from straw.replay.paper.runs import RISE_PER_S, ValidationRun

Floats = NDArray[np.float64]

SOLVERS = ("LSODA", "Radau", "BDF")
#: Scales that turn one relative tolerance into absolute ones: heights (m), angles (rad), and the rates of both.
SCALES = (2e-3, 0.2, 2e-2, 2.0)
#: Relative tolerances from loose to tight, and how far below rtol * SCALES the absolute ones lie.
RELATIVE = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6)
BELOW = (1.0, 0.1, 0.01)


@compiled
def rate(time_s: float, y: Floats, numbers: Floats, frusta: Floats, wall: Floats, terms: Floats) -> Floats:
    """y' (2 coordinates,) of a truncated straw under a validation run's pressure.

    The straw comes as four arrays, since taking a NamedTuple apart on each call takes longer than the physics.
    """
    r_i, r_o, rho, g, phi_0, m_tip, I_tip, F_X, F_Z, M_Y, loss, S, C3, cycle, steady_pa = numbers
    n = len(y) // 2
    c = Constants(
        n // 2,
        1,  # the even frusta move
        r_i,
        r_o,
        rho,
        g,
        phi_0,
        m_tip,
        I_tip,
        F_X,
        F_Z,
        M_Y,
        loss,
        S,
        C3,
        frusta[0],
        frusta[1],
        frusta[2],
        wall,
        frusta[3],
        frusta[4],
        cycle,
        0.0,  # the run's start
        True,  # no terms beyond the base model
        False,
        terms,
    )
    out = np.empty_like(y)
    out[:n] = y[n:]
    out[n:] = acceleration(c, y[:n], y[n:], steady_pa * (1 - np.exp(-RISE_PER_S * time_s)))
    return out


@dataclass(frozen=True)
class Trial:
    """One solver at one setting: coordinates (n, coordinates), None where it did not finish, and its cost."""

    solver: str
    rtol: float
    below: float
    q: Floats | None
    trouble: str
    cpu_s: float
    evaluations: int

    @property
    def setting(self) -> str:
        """Relative tolerance, and the absolute one on heights."""
        return f"rtol {self.rtol:.0e}, atol {self.rtol * self.below * SCALES[0]:.0e} m"


class _TimeIsUpError(Exception):
    pass


def solve(run: ValidationRun, time_s: Floats, solver: str, rtol: float, below: float, limit_s: float) -> Trial:
    """Solve a validation run within ``limit_s`` of CPU time."""
    assert run.straw.form == "truncated", "M is singular in the full form: there is no y' = f(t, y)"
    c = run.straw.constants()
    numbers = np.array([*c[2:15], c.cycle, run.steady_pa])
    frusta, wall, terms = np.array([c.zeta0, c.C1, c.C2, c.c_zeta, c.c_phi]), c.wall.copy(), c.terms.copy()
    q = rest_state(run.straw, run.deployed)
    y = np.concatenate([q, np.zeros_like(q)])
    for layout in (y, np.repeat(y, 2)[::2]):  # compiles: columns of a matrix have another type
        rate(0.0, layout, numbers, frusta, wall, terms)
    evaluations = 0
    start = time.process_time()

    def f(t: float, y: Floats) -> Floats:
        nonlocal evaluations
        evaluations += 1
        if evaluations % 1000 == 0 and time.process_time() - start > limit_s:
            raise _TimeIsUpError
        return rate(t, y, numbers, frusta, wall, terms)

    found, trouble = None, ""
    with warnings.catch_warnings(action="ignore"):  # LSODA's warnings of failed convergence; the accuracy is checked
        try:
            answer = solve_ivp(
                f, (0.0, time_s[-1]), y, solver, time_s, rtol=rtol, atol=rtol * below * np.repeat(SCALES, len(q) // 2)
            )
            if answer.success:
                found = answer.y[: len(q)].T
            else:
                trouble = "failed"
        except _TimeIsUpError:
            trouble = f"> {limit_s:.0f} s"
    return Trial(solver, rtol, below, found, trouble, time.process_time() - start, evaluations)


def loosest(
    run: ValidationRun, time_s: Floats, solver: str, limit_s: float, good: Callable[[Trial], bool]
) -> Iterator[Trial]:
    """All trials up to the loosest rtol that is accurate enough for each atol, or that did not finish."""
    for below in BELOW:
        for rtol in RELATIVE:
            trial = solve(run, time_s, solver, rtol, below, limit_s)
            yield trial
            if trial.q is None or good(trial):
                break
