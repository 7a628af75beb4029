"""SciPy's stiff solvers on the straw: y' = f(t, y) with y = (q, q'), compiled, called once from Python a step asks."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from model.compiled import compiled
from model.constants import Constants
from model.rest import rest_state
from model.straw import acceleration
from replay.paper.runs import RISE_PER_S, ValidationRun

Floats = NDArray[np.float64]

SOLVERS = ("LSODA", "Radau", "BDF")
#: Sizes that make an absolute tolerance of one relative tolerance: heights (m), angles (rad), and both's rates.
SCALES = (2e-3, 0.2, 2e-2, 2.0)
#: Relative tolerances from loose to tight, and how far below rtol * SCALES the absolute ones lie.
RELATIVE = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6)
BELOW = (1.0, 0.1, 0.01)


@compiled
def rate(time_s: float, y: Floats, numbers: Floats, frusta: Floats, terms: Floats) -> Floats:
    """y' (2 coordinates,) of a truncated straw under the validation runs' pressure.

    The straw comes as three arrays, since taking a NamedTuple apart on each call takes longer than the physics.
    """
    n = len(y) // 2
    c = Constants(
        n // 2,
        1,
        numbers[0],
        numbers[1],
        numbers[2],
        numbers[3],
        numbers[4],
        numbers[5],
        numbers[6],
        numbers[7],
        numbers[8],
        numbers[9],
        numbers[10],
        numbers[11],
        numbers[12],
        frusta[0],
        frusta[1],
        frusta[2],
        frusta[3],
        frusta[4],
        numbers[13],
        True,
        False,
        terms,
    )
    out = np.empty_like(y)
    out[:n] = y[n:]
    external_pa = numbers[14] * (1 - np.exp(-RISE_PER_S * time_s))
    out[n:] = acceleration(c, y[:n], y[n:], external_pa)
    return out


class TimeIsUpError(Exception):
    """A solver took longer than it was given."""


@dataclass(frozen=True)
class Answer:
    """Coordinates (n, coordinates) at the wanted times, what they cost, and the setting."""

    q: Floats
    cpu_s: float
    evaluations: int
    solver: str
    rtol: float
    below: float

    @property
    def setting(self) -> str:
        """The setting, as a table shows it."""
        return setting(self.rtol, self.below)


def setting(rtol: float, below: float) -> str:
    """Relative tolerance, and the absolute one on heights."""
    return f"rtol {rtol:.0e}, atol {rtol * below * SCALES[0]:.0e} m"


def solve(run: ValidationRun, time_s: Floats, solver: str, rtol: float, below: float, limit_s: float) -> Answer:
    """Solve a validation run; TimeIsUpError after ``limit_s`` of CPU time."""
    assert run.straw.form == "truncated", "M is singular in the full form: there is no y' = f(t, y)"
    c = run.straw.constants()
    numbers = np.array([*c[2:15], c.cycle, run.steady_pa])
    frusta, terms = np.array(c[15:20]), c.terms.copy()
    q = rest_state(run.straw, run.deployed)
    n = len(q) // 2
    deadline = time.process_time() + limit_s

    def f(t: float, y: Floats) -> Floats:
        if time.process_time() > deadline:
            raise TimeIsUpError
        return rate(t, y, numbers, frusta, terms)

    y = np.concatenate([q, np.zeros_like(q)])
    f(0.0, y)  # compiles
    start = time.process_time()
    atol = rtol * below * np.repeat(SCALES, n)
    answer = solve_ivp(f, (0.0, time_s[-1]), y, solver, time_s, rtol=rtol, atol=atol)
    if not answer.success:
        raise TimeIsUpError
    return Answer(answer.y[: 2 * n].T, time.process_time() - start, int(answer.nfev), solver, rtol, below)


def loosest(
    run: ValidationRun, time_s: Floats, solver: str, limit_s: float, good: Callable[[Answer], bool]
) -> Iterator[Answer | str]:
    """The solutions that are good enough, each at the loosest rtol for its atol; or a line that says why not.

    Looser relative tolerances are tried first, so that nothing tighter than needed is measured.
    """
    for below in BELOW:
        for rtol in RELATIVE:
            try:
                found = solve(run, time_s, solver, rtol, below, limit_s)
            except TimeIsUpError:
                yield f"{solver}, {setting(rtol, below)}: > {limit_s:.0f} s, given up"
                break
            if good(found):
                yield found
                break
            yield f"{solver}, {found.setting}: {found.cpu_s:.2f} s, not accurate enough"
