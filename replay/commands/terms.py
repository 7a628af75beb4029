"""straw terms: every law that can be added to the straw, its constants, and its effect on the paper's two runs."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from straw.model.simulate import Prediction
from straw.model.term import Term
from straw.model.terms import CAUSES
from straw.model.typical import typical, with_typical
from straw.replay.output import write_json
from straw.replay.paper.runs import DEPLOYMENT, FOLDING, ValidationRun, crossing_s
from straw.replay.progress import prepare, progress_bar


def run(args: argparse.Namespace) -> int:
    """Print the terms; simulate both validation runs with each at a plausible strength, and print what changed."""
    prepare()
    bases = {run.name: run.simulate() for run in (FOLDING, DEPLOYMENT)}
    effects: dict[str, dict[str, dict[str, float]]] = {}
    with progress_bar("terms", "term") as update:
        for done, (name, term) in enumerate(CAUSES.items()):
            update(done, len(CAUSES))
            effects[name] = {run.name: _effect(run, term, bases[run.name]) for run in (FOLDING, DEPLOYMENT)}
        update(len(CAUSES), len(CAUSES))
    for term in CAUSES.values():
        print(f"{term.name}: {term.law}\n    {term.source}")
        for c in term.constants:
            kind = "strength" if c.name in term.strengths else f"default {c.default:g}"
            print(f"    {c.name} ({c.unit}), {c.low:g} to {c.high:g}, {kind}: {c.about}")
    print("\nits effect on the paper's two validation runs, at a plausible strength: RMS change of the tip, and how")
    print("much later cells 1 and 4 snap (-: does not)")
    print(
        f"{'term':<20} {'strength':<34} {'run':<11} {'X/um':>7} {'Z/um':>7} {'Phi/mrad':>9} {'cell 1/ms':>10}"
        f" {'4/ms':>8}"
    )
    for name, runs in effects.items():
        strength = _strength(CAUSES[name])
        for title, e in runs.items():
            print(
                f"{name:<20} {strength:<34} {title:<11} {e['x_m'] * 1e6:>7.0f} {e['z_m'] * 1e6:>7.0f} "
                f"{e['phi_rad'] * 1e3:>9.1f} {_ms(e['cell_1_later_s']):>10} {_ms(e['cell_4_later_s']):>8}"
            )
            name = strength = ""
    if args.json:
        write_json(args.json, {"terms": [_described(t) for t in CAUSES.values()], "effects": effects})
    return 0


def _effect(run: ValidationRun, term: Term, base: Prediction) -> dict[str, float]:
    with_term = replace(run, straw=with_typical(run.straw, term)).simulate()
    changes = {
        c: float(np.sqrt(np.mean((getattr(with_term, c) - getattr(base, c)) ** 2))) for c in ("x_m", "z_m", "phi_rad")
    }
    later = {f"cell_{cell}_later_s": crossing_s(with_term, cell) - crossing_s(base, cell) for cell in run.snapping}
    return {**changes, **later}


def _ms(time_s: float) -> str:
    return "-" if np.isnan(time_s) else f"{time_s * 1e3:+.1f}"


def _strength(term: Term) -> str:
    if term.name == "frustum_spread":
        return "E of cell 4 8 % less"
    return ", ".join(f"{typical(c):.3g} {c.unit}" for c in term.constants if c.name in term.strengths)


def _described(term: Term) -> dict[str, Any]:
    return {
        "name": term.name,
        "law": term.law,
        "source": term.source,
        "strengths": term.strengths,
        "constants": [asdict(c) for c in term.constants],
    }
