"""Speed of the model: against real time and SciPy's solvers, with other walls, cells and durations, on two cores.

    python -m tests.benchmarks.speed [--quick] [--limit SECONDS]

All after compilation, in one process on one core, with output at 240 Hz. Seconds are CPU time, which is wall time on an
idle machine; those of this model are the best of a few repeats.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one core for SciPy's matrices as well; before NumPy is loaded

import argparse
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from straw.model.batch import Job, simulate_many
from straw.model.simulate import TOLERANCE_M, Prediction, simulate
from straw.replay.paper.runs import DEPLOYMENT, DURATION_S, FOLDING, ValidationRun
from tests.benchmarks.accuracy import ERRORS_HEAD, TIME_S, Solution, good, reference, shown, truth
from tests.benchmarks.figures import publish, write_option
from tests.benchmarks.general_purpose import SOLVERS, Trial, loosest, solve

RUNS = (FOLDING, DEPLOYMENT)
REPEATS = 7
TOLERANCES_M = (TOLERANCE_M, 2 * TOLERANCE_M)
#: SciPy's fastest in a full search, for --quick.
FASTEST = {"folding": ("LSODA", 1e-5, 1.0), "deployment": ("Radau", 1e-2, 1.0)}
BATCH = 16


def ours(
    run: ValidationRun, duration_s: float = DURATION_S, tolerance_m: float = TOLERANCE_M
) -> tuple[Prediction, float]:
    """A run's prediction, and the least CPU time it took in a few repeats."""
    time_s = TIME_S if duration_s == DURATION_S else np.arange(round(duration_s * 240)) / 240
    walls = []
    for _ in range(REPEATS):
        start = time.process_time()
        predicted = simulate(run.straw, run.pressure_pa, time_s, run.deployed, tolerance_m=tolerance_m)
        walls.append(time.process_time() - start)
    return predicted, min(walls)


def against_real_time() -> dict[str, float]:
    """Print both runs at two tolerances; seconds of each at the default one."""
    print(f"\n{'ours':<12}{'tolerance':>11}{'steps':>7}{'CPU / s':>9}{'x real time':>12}{ERRORS_HEAD}")
    seconds = {}
    for run in RUNS:
        for tolerance_m in TOLERANCES_M:
            predicted, cpu_s = ours(run, tolerance_m=tolerance_m)
            errors = Solution.of_prediction(run, predicted).errors(truth(run))
            seconds.setdefault(run.name, cpu_s)
            print(
                f"{run.name:<12}{tolerance_m * 1e6:>8.1f} um{predicted.steps:>7}{cpu_s:>9.4f}"
                f"{DURATION_S / cpu_s:>12.0f}{shown(errors)}{'' if good(errors) else '  NOT within the accuracy asked'}"
            )
    return seconds


def against_scipy(seconds: dict[str, float], quick: bool, limit_s: float) -> dict[str, str]:
    """Print SciPy's solvers on both runs at the required accuracy, and how many times faster this model is, by run."""
    times = {}
    print(f"\n{'SciPy':<12}{'solver':<8}{'setting':<28}{'calls':>9}{'CPU / s':>9}{'ours x':>8}{ERRORS_HEAD}")
    for run in RUNS:
        best: Trial | None = None

        def errors(trial: Trial, run: ValidationRun = run) -> tuple[float, ...]:
            return (np.inf,) * 4 if trial.q is None else Solution.of_coordinates(run, trial.q).errors(truth(run))

        for solver in (FASTEST[run.name][0],) if quick else SOLVERS:
            if quick:
                trials = iter([solve(run, TIME_S, *FASTEST[run.name], limit_s)])
            else:  # a solver that takes ten times the fastest cannot win
                most_s = limit_s if best is None else min(limit_s, 10 * best.cpu_s)
                trials = loosest(run, TIME_S, solver, most_s, lambda t: good(errors(t)))
            for trial in trials:
                wrong = errors(trial)
                verdict = (
                    f"  {trial.trouble}" if trial.trouble else shown(wrong) + ("" if good(wrong) else "  too far off")
                )
                print(
                    f"{run.name:<12}{solver:<8}{trial.setting:<28}{trial.evaluations:>9}{trial.cpu_s:>9.2f}"
                    f"{trial.cpu_s / seconds[run.name]:>8.0f}{verdict}",
                    flush=True,
                )
                if good(wrong) and (best is None or trial.cpu_s < best.cpu_s):
                    best = trial
        if best is not None:
            times[run.name] = f"{best.cpu_s / seconds[run.name]:.0f}"
            print(
                f"{run.name}: ours is {best.cpu_s / seconds[run.name]:.0f} times faster than SciPy's fastest, "
                f"{best.solver} at {best.setting} (asked: 10, goal: 30)\n",
                flush=True,
            )
    return times


def walls() -> None:
    """Print the cost of walls by finite elements relative to equation 7, run alternately: ratios of least CPU times."""
    print(f"\n{'walls':<12}{'equation 7 / ms':>17}{'shell / ms':>12}{'ratio':>7}{'steps':>12}")
    for run in RUNS:
        runs = [run, replace(run, straw=run.straw.replace(elasticity="shell"))]
        tried = [[ours(one) for one in runs] for _ in range(3)]
        (base, base_s), (shell, shell_s) = (min(column, key=lambda one: one[1]) for column in zip(*tried, strict=True))
        print(
            f"{run.name:<12}{1e3 * base_s:>17.2f}{1e3 * shell_s:>12.2f}{shell_s / base_s:>7.2f}"
            f"{base.steps:>6}{shell.steps:>6}"
        )


def growth() -> None:
    """Print how cost grows with the number of cells and with duration."""
    columns = f"{'CPU / s':>10}{'steps':>7}{'us a step':>11}{'of N = 9':>10}"
    print(f"\n{'':<9}{'folding (cell 1 deployed)':^38}{'deployment (all folded)':^38}\n{'cells':<9}{columns}{columns}")
    # a long horizontal straw carries its weight only if most of it is folded
    starts = [(replace(FOLDING, deployed=(1,))), replace(DEPLOYMENT, deployed=())]
    nine = [ours(run)[1] for run in starts]
    for cells in (1, 3, 9, 18, 30):
        line = f"{cells:<9}"
        for run, nine_s in zip(starts, nine, strict=True):
            predicted, cpu_s = ours(replace(run, straw=run.straw.replace(cells=cells)))
            line += f"{cpu_s:>10.4f}{predicted.steps:>7}{cpu_s / predicted.steps * 1e6:>11.1f}{cpu_s / nine_s:>10.2f}"
        print(line)
    columns = f"{'CPU / s':>10}{'steps':>7}{'of 6 s':>10}"
    print(f"\n{'':<9}{'folding':^27}{'deployment':^27}\n{'seconds':<9}{columns}{columns}")
    six = [ours(run)[1] for run in RUNS]
    for duration_s in (1.5, 3.0, 6.0, 12.0):
        line = f"{duration_s:<9}"
        for run, six_s in zip(RUNS, six, strict=True):
            predicted, cpu_s = ours(run, duration_s)
            line += f"{cpu_s:>10.4f}{predicted.steps:>7}{cpu_s / six_s:>10.2f}"
        print(line)


def on_two_cores() -> None:
    """Print the speed-up by a second thread in a batch: wall time, since CPU time does not shrink."""
    jobs = [
        Job(
            DEPLOYMENT.straw.replace(c_zeta_n_s_per_m=0.1 + 0.01 * i),
            DEPLOYMENT.pressure_pa,
            TIME_S,
            DEPLOYMENT.deployed,
        )
        for i in range(BATCH)
    ]

    def wall_s(work: Callable[[], object]) -> float:
        start = time.perf_counter()
        work()
        return time.perf_counter() - start

    alone, both = [], []
    for _ in range(3):
        for threads, walls in ((1, alone), (2, both)):
            with ThreadPoolExecutor(threads) as executor:
                walls.append(wall_s(lambda e=executor: list(simulate_many(jobs, e))))
    print(
        f"\nbatch of {BATCH} deployments: 1 thread {min(alone):.2f} s, 2 threads {min(both):.2f} s, "
        f"{min(alone) / min(both):.2f} times faster ({os.cpu_count()} cores)"
    )


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="ours, and SciPy's fastest at a known setting only")
    parser.add_argument("--limit", type=float, default=120.0, help="CPU seconds one SciPy run may take (120)")
    write_option(parser)
    asked = parser.parse_args()
    if reference("folding") is None:
        print("no ../shared/reference: errors are against our own solution at a hundredth of the tolerance")
    simulate(FOLDING.straw, FOLDING.pressure_pa, TIME_S[:3], FOLDING.deployed)  # compiles
    seconds = against_real_time()
    walls()
    if not asked.quick:
        growth()
        on_two_cores()
    times = against_scipy(seconds, asked.quick, asked.limit)
    publish("speed_quick", {name: f"{DURATION_S / cpu_s:.0f}" for name, cpu_s in seconds.items()}, asked.write)
    if not asked.quick:
        publish("speed", times, asked.write)


if __name__ == "__main__":
    main()
