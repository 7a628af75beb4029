"""Cost of exact derivatives: 0, 16 and 128 columns relative to plain runs, and its growth with the number of cells.

    python -m tests.benchmarks.derivatives [--cells]

All in one process on one core, with output at 240 Hz, CPU seconds.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from straw.model.derivative import differentiate
from straw.model.direction import Direction
from straw.model.parameters import StrawParameters
from straw.model.simulate import simulate
from straw.replay.paper.runs import DEPLOYMENT, FOLDING, ValidationRun
from tests.benchmarks.accuracy import TIME_S
from tests.benchmarks.figures import publish, write_option

Floats = NDArray[np.float64]

REPEATS = 5
#: Constants of the straw, terms of zero strength, the pressure, one by one, and those of each frustum.
WHOLE = ("E_pa", "h_m", "zeta0_m", "c_zeta_n_s_per_m", "c_phi_n_m_s_per_rad", "r_ch_m", "m_tip_kg", "rho_kg_per_m3")
CANDIDATES = (
    "terms.cohesion.force_n",
    "terms.crease_stiffness.zeta_n_per_m",
    "terms.crease_stiffness.phi_n_m_per_rad",
    "terms.asymmetry.moment_n_m",
    "terms.squeeze_film.folded_n_s_per_m",
    "terms.poiseuille_loss.resistance_pa_s_per_m3",
    "terms.fluid_inertia.inertance_kg_per_m4",
)
BY_CELL = (
    "E_pa", "h_m", "zeta0_m", "c_zeta_n_s_per_m", "c_phi_n_m_s_per_rad", *(name for name in CANDIDATES[:5]),
    "terms.frustum_spread.E_relative", "terms.frustum_spread.zeta0_relative", "terms.intrinsic_curvature.phi_0_rad",
)  # fmt: skip


def columns(run: ValidationRun, many: int) -> list[Direction]:
    """The requested number of directions."""
    straw = run.straw
    found = [Direction.of(straw, name) for name in (*WHOLE, *CANDIDATES)]
    found.append(Direction.delay(straw, run.pressure_pa))
    found += [
        Direction.of(straw, name, cell=cell, frustum="even") for name in BY_CELL for cell in range(1, straw.cells + 1)
    ]
    return found[:many]


def taken_s(work: Callable[[], object]) -> float:
    """CPU time of one call."""
    start = time.process_time()
    work()
    return time.process_time() - start


def ratios(plain: Callable[[], object], work: Callable[[], object]) -> Floats:
    """CPU time of the work in plain runs, timed before and after it as other processes may slow both (REPEATS,)."""
    plain(), work()
    out = []
    for _ in range(REPEATS):
        before, own, after = taken_s(plain), taken_s(work), taken_s(plain)
        out.append(own / ((before + after) / 2))
    return np.array(out)


def cost(run: ValidationRun) -> dict[str, str]:
    """Print the cost of columns beside the plain run; the medians of 16 and 128 by name."""

    def plain() -> object:
        return simulate(run.straw, run.pressure_pa, TIME_S, run.deployed)

    print(f"\n{run.name}, in plain runs of some {min(taken_s(plain) for _ in range(5)) * 1e3:.0f} ms")
    print(f"{'columns':>8}{'median':>10}{'least':>8}{'most':>8}{'differences':>13}")
    medians = {}
    for many in (0, 1, 16, 128):
        directions = columns(run, many)
        assert len(directions) == many
        found = ratios(plain, lambda d=directions: differentiate(run.straw, run.pressure_pa, TIME_S, run.deployed, d))
        print(f"{many:>8}{np.median(found):>10.2f}{found.min():>8.2f}{found.max():>8.2f}{2 * many:>13}", flush=True)
        medians[f"{run.name}-{many}"] = f"{np.median(found):.1f}"
    return {name: text for name, text in medians.items() if name.endswith(("-16", "-128"))}


@contextmanager
def only(module: Any, name: str) -> Iterator[list[float]]:
    """CPU seconds that each call of a module's function takes: an integration without the rest state before it."""
    taken: list[float] = []
    work = getattr(module, name)

    def timed(*given: Any) -> Any:
        start = time.process_time()
        done = work(*given)
        taken.append(time.process_time() - start)
        return done

    with patch.object(module, name, timed):
        yield taken


def growth() -> dict[str, str]:
    """Print the cost of a step by the number of cells: plain, and with 16 columns; return it, us, by name."""
    figures = {}
    print(f"\n{'':<8}{'folding (cell 1 deployed)':^44}{'deployment (all folded)':^44}")
    head = f"{'steps':>8}{'us a step':>11}{'a cell':>9}{'16 columns':>16}"
    print(f"{'cells':<8}{head}{head}")
    for cells in (3, 9, 18, 30, 100, 300):
        line = f"{cells:<8}"
        for run in (replace(FOLDING, deployed=(1,)), replace(DEPLOYMENT, deployed=())):
            straw: StrawParameters = run.straw.replace(cells=cells, g_m_per_s2=0.0 if cells > 30 else 9.795)
            held = replace(run, straw=straw)
            time_s = TIME_S[(6.0 if cells <= 30 else 1.0) >= TIME_S]  # longer ones buckle later under the pressure
            given, along = (straw, held.pressure_pa, time_s, held.deployed), columns(held, 16)
            first = simulate(*given)
            near = first.rest
            with (
                only(sys.modules[simulate.__module__], "integrate") as plain,
                only(sys.modules[differentiate.__module__], "integrate_columns") as both,
            ):
                for _ in range(REPEATS):
                    simulate(*given, near=near)
                    differentiate(*given, along, near=near)
            each_us, by_us = (min(taken) / first.steps * 1e6 for taken in (plain, both))
            figures |= {f"{run.name}-{cells}": f"{each_us:.0f}", f"{run.name}-16-columns-{cells}": f"{by_us:.0f}"}
            line += (
                f"{first.steps:>8}{each_us:>11.1f}{each_us / cells:>9.2f}{by_us:>9.0f}{f'x {by_us / each_us:.1f}':>7}"
            )
        print(line, flush=True)
    print("without gravity beyond 30 cells: a longer horizontal straw does not carry itself")
    return {name: text for name, text in figures.items() if not name.endswith("-3")}


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", action="store_true", help="also how cost grows with the number of cells")
    write_option(parser)
    asked = parser.parse_args()
    publish("derivatives", cost(FOLDING) | cost(DEPLOYMENT), asked.write)
    if asked.cells:
        publish("derivatives_cells", growth(), asked.write)


if __name__ == "__main__":
    main()
