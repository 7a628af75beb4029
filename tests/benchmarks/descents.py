"""Fits of concealed causes: by the diagnosis, and by SciPy's trust-region reflective algorithm in its unknowns u.

    python -m tests.benchmarks.descents

Single causes of opened decks beside the refitted base, from the proposal's starts and from their own two best, all
samples of all runs, at most 20 evaluations each, side by side in one run.
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from straw.replay.diagnose.at_once import proposed
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, clipped, cost_at, evaluated, fitted
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.pairs import telling
from straw.replay.diagnose.settings import ROBUST_SIGMAS, ROUNDS, STARTS
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.diagnose.tournament import look
from tests.apparatus.cases import deck, generate, recorded
from tests.benchmarks.concealed import BASE, SIX
from tests.benchmarks.figures import publish, table, write_option

Floats = NDArray[np.float64]

#: Opened cases of deck final: seed and number.
CASES = ((20261130, 4), (20261129, 24), (20261129, 16), (20261130, 28), (20261129, 108), (20261130, 48))
HEAD = ("case", "cause", "start", "left, diagnosis", "left, SciPy", "CPU, s, diagnosis", "CPU, s, SciPy")


def by_diagnosis(campaign: Campaign, start: Fit) -> float:
    """The cost where the diagnosis' fit ends."""
    return fitted(campaign, start.unknowns, start.u, rounds=ROUNDS).cost


def by_scipy(campaign: Campaign, start: Fit) -> float:
    """The cost where SciPy's algorithm ends, with the same loss, priors and bounds."""
    unknowns = start.unknowns
    low, high, mean, sd = (np.array([getattr(k, name) for k in unknowns]) for name in ("low", "high", "mean", "sd"))
    best = [start.cost]

    def rows(u: Floats) -> Floats:
        (residual,) = campaign.residuals(unknowns, [u])
        best[0] = min(best[0], cost_at(unknowns, u, residual))
        return np.concatenate([residual, (u - mean) / sd])

    def loss(z: Floats) -> Floats:
        root = np.sqrt(1 + z / ROBUST_SIGMAS**2)
        soft = [2 * ROBUST_SIGMAS**2 * (root - 1), 1 / root, -0.5 / (ROBUST_SIGMAS**2 * root**3)]
        return np.where(np.arange(len(z)) < len(start.residual), soft, [z, np.ones_like(z), np.zeros_like(z)])

    def jacobian(u: Floats) -> Floats:
        return np.vstack([evaluated(campaign, unknowns, u).slopes, np.diag(1 / sd)])

    with np.errstate(over="ignore"):
        inside = np.clip(start.u, low + 1e-10, high - 1e-10)
        least_squares(rows, inside, jacobian, bounds=(low, high), loss=loss, max_nfev=ROUNDS, ftol=1e-4)  # type: ignore[call-overload]
    return best[0]


def compared(seed: int, number: int) -> list[list[str]]:
    """A line for each start."""
    case = next(one for one in deck("final", seed) if one.name == f"final-{number:03d}")
    seen = sorted((observe(run) for run in generate(replace(case, runs=SIX), recorded).runs), key=lambda one: one.name)
    system, (cause,) = StrawSystem(BASE), case.label
    system.ready(seen)
    proposal = system.propose(seen, system.causes)
    lines = []
    with ThreadPoolExecutor(1) as pool:
        campaign = Campaign(seen, system, pool)
        null, wide_known = system.fit_base(campaign, [np.array([one.u for one in proposal.base])])
        wide = telling(Inquiry(campaign, null))
        known = evaluated(wide, wide_known.unknowns, wide_known.u)
        hypothesis = campaign.hypothesis([cause])
        starts = [("proposal", one) for one in proposed(known, hypothesis, proposal)]
        starts += [("own", one) for one in look(wide, known, hypothesis)[:STARTS]]
        for label, one in starts:
            unknowns = (*known.unknowns, *hypothesis.unknowns)
            start = evaluated(campaign, unknowns, clipped(unknowns, one.u))
            costs, cpu_s = [], []
            for way in (by_diagnosis, by_scipy):
                began = time.process_time()
                costs.append(f"{way(campaign, start):.0f}")
                cpu_s.append(f"{time.process_time() - began:.1f}")
            lines.append([f"{seed}-{number:03d}", cause.replace("_", " "), label, *costs, *cpu_s])
            print(*lines[-1], sep=" | ", flush=True)
    return lines


def main() -> None:
    """Print the table, and publish it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    write_option(parser)
    parsed = parser.parse_args()
    lines = [line for seed, number in CASES for line in compared(seed, number)]
    publish("descents", {"table": table(HEAD, lines)}, parsed.write)


if __name__ == "__main__":
    main()
