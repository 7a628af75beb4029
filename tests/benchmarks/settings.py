"""Sensitivity of the diagnosis of development cases to a setting of the engine, halved and doubled.

    python -m tests.benchmarks.settings                        # every setting, the first case of each kind
    python -m tests.benchmarks.settings FOLLOWED FAR --cases develop-003 develop-017
    python -m tests.benchmarks.settings random_effects.SPREAD systems.straw.matching.LEFT_OUT_S

The last are constants of modules of the diagnosis that are not settings of the engine.

One line per setting and factor: verdicts that change, and the largest change of the probability of the truth. For
probabilities and shares the odds are halved and doubled. A case takes one to three minutes of a core, all settings a
night; lines are kept in a file (`--out`), and an interrupted run continues.
"""

from __future__ import annotations

import argparse
import importlib
import json
import pkgutil
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from types import ModuleType
from typing import Any

import straw.replay.diagnose
from straw.model.parameters import StrawParameters
from straw.replay.diagnose import settings
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import conclude
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.options import workers_options
from straw.replay.workers import workers
from tests.apparatus.cases import Case, deck, generate

BASE = StrawParameters(r_ch_m=0.40e-3, c_zeta_n_s_per_m=20.0, c_phi_n_m_s_per_rad=2e-3)
RUNS = ("fold-25kPa", "deploy-35kPa-1", "fold-20kPa-2-5", "staircase")
FACTORS = (0.5, 2.0)
#: Probabilities and shares, whose odds are changed.
SHARES = ("COVERED", "NAMED_ALONE", "LASTING", "SEARCHED")


def main() -> None:
    """Try every setting and print a table."""
    ask = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ask.add_argument("names", nargs="*", metavar="SETTING", help="which (all)")
    ask.add_argument("--seed", type=int, default=1, help="of the developing deck (1)")
    ask.add_argument("--cases", nargs="+", metavar="NAME", help="cases, as develop-003 (the first of each kind)")
    ask.add_argument("--out", type=Path, default=Path("settings.jsonl"), metavar="FILE", help="settings.jsonl")
    workers_options(ask, "processes")
    args = ask.parse_args()
    known = [name for name in vars(settings) if name.isupper()]
    for name in args.names:
        home, constant = _home(name)
        if not constant.isupper() or not hasattr(home, constant):
            sys.exit(f"{name}: no such constant of {home.__name__}; settings of the engine: {', '.join(known)}")
    cases = [case for case in deck("develop", args.seed) if args.cases is None or case.name in args.cases]
    if args.cases is None:
        cases = list({case.kind: case for case in reversed(cases)}.values())
    wanted = [("", 1.0), *((name, factor) for name in args.names or known for factor in FACTORS)]
    rows = [json.loads(line) for line in args.out.read_text().splitlines()] if args.out.exists() else []
    told = {(row["case"], row["setting"], row["factor"]): row for row in rows}
    with workers(max(2, args.jobs), args.dask) as pool, args.out.open("a") as out:
        assert pool is not None
        todo = [(c, name, f) for name, f in wanted for c in cases if (c.name, name, f) not in told]
        for job in as_completed([pool.submit(diagnosed, *one) for one in todo]):
            row = job.result()
            told[row["case"], row["setting"], row["factor"]] = row
            out.write(json.dumps(row) + "\n")
            out.flush()
            print(f"{len(told)} of {len(cases) * len(wanted)}", file=sys.stderr, flush=True)
    for name, factor in wanted[1:]:
        print(line(name, factor, [(told[c.name, "", 1.0], told[c.name, name, factor]) for c in cases]))


def diagnosed(case: Case, name: str, factor: float) -> dict[str, Any]:
    """Findings of a case with one setting changed; the setting is restored at the end."""
    home, constant = _home(name)
    before = getattr(home, constant) if name else None
    places = _places(before, constant) if name else []
    try:
        for module in places:
            setattr(module, constant, changed(constant, before, factor))
        made = generate(Case(case.name, case.kind, case.truth, case.seed, RUNS, case.pair))
        with ThreadPoolExecutor(1) as pool:
            found = inquire([observe(run) for run in made.runs], StrawSystem(BASE), executor=pool)
            findings = conclude(found, brief=True)
    finally:
        for module in places:
            setattr(module, constant, before)
    true = "+".join(case.label) or "complete"
    sure = {"+".join(sorted(n.split("+"))): p for n, p in findings.judgement.probability.items()}
    said = [findings.verdict, *sorted(findings.causes)]
    return {"case": case.name, "setting": name, "factor": factor, "said": said, "truth": sure.get(true, 0.0)}


def _home(name: str) -> tuple[ModuleType, str]:
    """The module that defines a setting of the engine, or one of ``module.CONSTANT``, and the name there."""
    module, _, constant = name.rpartition(".")
    try:
        return (importlib.import_module(f"straw.replay.diagnose.{module}") if module else settings), constant
    except ModuleNotFoundError as error:
        sys.exit(f"{name}: {error}")


def _places(value: Any, name: str) -> list[Any]:
    """Every module of the diagnosis that has imported the setting."""
    for module in pkgutil.walk_packages(straw.replay.diagnose.__path__, "straw.replay.diagnose."):
        importlib.import_module(module.name)
    modules = [m for n, m in sys.modules.items() if n.startswith("straw.replay.diagnose")]
    return [m for m in modules if getattr(m, name, None) is value]


def changed(name: str, value: Any, factor: float) -> Any:
    """A setting by a factor: each of several, whole numbers at least one, a probability by its odds."""
    if isinstance(value, dict):
        return {key: changed(name, one, factor) for key, one in value.items()}
    if isinstance(value, tuple):
        return tuple(changed(name, one, factor) for one in value)
    if name in SHARES:
        odds = factor * value / (1 - value)
        return odds / (1 + odds)
    return max(1, round(factor * value)) if isinstance(value, int) else factor * value


def line(name: str, factor: float, pairs: list[tuple[dict[str, Any], dict[str, Any]]]) -> str:
    """One row of the table."""
    moved = [f"{a['case']} {' '.join(a['said'])} -> {' '.join(b['said'])}" for a, b in pairs if a["said"] != b["said"]]
    most = max((b["truth"] - a["truth"] for a, b in pairs), key=abs)
    return f"{name:<22} x {factor:<4g} truth {most:+.2f}  {'; '.join(moved) or 'same verdicts'}"


if __name__ == "__main__":
    main()
