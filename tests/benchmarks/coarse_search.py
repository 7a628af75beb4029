"""How far the truth is from the best during a coarse search, on opened cases: figures behind its constants.

    python -m tests.benchmarks.coarse_search --split two --seed 20261218 --cases 14

Cases whose base leaves little are left out. Labels are used: only opened cases are suited. One line per case:
``true`` is the least that a concealed cause leaves after brief fits over the least of all causes (`OUT`); ``own`` the
largest factor by which own starts lowered a brief fit from the proposal's constants (`FAR_BEHIND`); ``gain`` what the
other cause of a pair, or the best wrong one beside a single cause, promises beside the leading cause, and its rank
(`SHOWS`); ``explained`` whether that one explains the comparison.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.coarse_search import in_turn, telling
from straw.replay.diagnose.fit import Contestant, evaluated, fitted
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.judge import unexplained
from straw.replay.diagnose.one_thread import one_blas_thread
from straw.replay.diagnose.random_effects import linearise
from straw.replay.diagnose.refine import explains
from straw.replay.diagnose.screen import screen
from straw.replay.diagnose.second_causes import from_proposal
from straw.replay.diagnose.settings import COARSE_ROUNDS, FAR, FIRST_ROUNDS, STARTS
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.diagnose.tournament import best_of_each, by_cost, fitted_contestants, halved, look
from tests.apparatus.cases import RUN_IDS, Case, deck, generate, recorded
from tests.benchmarks.concealed import BASE, SIX


def main() -> None:
    """Print a line for each case."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("--split", choices=("develop", "final", "strong", "two"), default="two")
    ask.add_argument("--seed", type=int, default=20261218)
    ask.add_argument("--cases", type=int, default=14)
    args = ask.parse_args()
    print(f"{'case':10s}{'true':>8s}{'own':>8s}{'gain':>8s}{'rank':>6s}  explained  leading; concealed")
    for case in deck(args.split, args.seed)[: args.cases]:
        if case.kind in ("single", "instrument", "two") and (line := searched(case)):
            print(f"{case.name:10s}{line}  {'+'.join(case.label)}", flush=True)


@one_blas_thread()
def searched(case: Case) -> str | None:
    """A case's line; None where the base leaves little."""
    made = generate(replace(case, runs=SIX) if case.runs == RUN_IDS else case, recorded)
    observations, system = sorted((observe(run) for run in made.runs), key=lambda one: one.name), StrawSystem(BASE)
    system.ready(observations)
    proposal = system.propose(observations, system.causes)
    with ThreadPoolExecutor(1) as pool:
        campaign = Campaign(observations, system, pool)
        null, base = system.fit_base(campaign, [])
        linearise(campaign, null)
        found = Inquiry(campaign, fitted(campaign, null.unknowns, null.u, rounds=FIRST_ROUNDS))
        if unexplained(campaign, found.null) <= FAR:
            return None
        wide = telling(found)
        known = evaluated(wide, base.unknowns, base.u)
        every = [campaign.hypothesis([name]) for name in system.causes]
        group = in_turn(every, proposal)[0]
        starts = [start for h in group for start in look(wide, known, h)[:STARTS]]
        own = best_of_each(fitted_contestants(wide, starts, COARSE_ROUNDS[0], known.unknowns, brief=True))
        given = from_proposal(wide, known, group, proposal)
        ranked = halved(wide, best_of_each([*own, *given]), len(group))
        leader = ranked[0]
        others = [h for h in every if h.name != leader.name]
        screened = screen(wide, leader.fit, others, leader.hypothesis)
    at = {one.name: one.cost for one in own}
    lowered = max((one.cost / at[one.name] for one in given), default=float("nan"))
    gains: dict[str, float] = {}
    for start in screened:
        gains.setdefault(next(c for c in start.hypothesis.causes if c != leader.name), start.gain)
    other = set(case.label) - {leader.name}
    wanted = other if len(case.label) == 2 else set(gains) - other
    shown = next(((k, gains[c]) for k, c in enumerate(gains, 1) if c in wanted), (0, float("nan")))
    if leader.name not in case.label:
        shown = (0, float("nan"))  # a wrong one leads
    figures = f"{truth_over_best(case, [*own, *given]):8.2f}{lowered:8.2f}{shown[1]:8.0f}{shown[0]:6d}"
    return f"{figures}  {'yes' if explains(leader.fit) else 'no':9s}  {leader.name};"


def truth_over_best(case: Case, brief: list[Contestant]) -> float:
    """The least that a concealed cause leaves over the least of all; infinite where none is among them."""
    ranked = by_cost(brief)
    return min((one.cost for one in ranked if one.name in case.label), default=float("inf")) / ranked[0].cost


if __name__ == "__main__":
    main()
