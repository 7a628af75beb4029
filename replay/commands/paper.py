"""straw paper: the paper's numbers beside the model's, and its figures drawn anew."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from importlib.resources import as_file, files

from model.filling import channel_radius, read_filling_tests
from model.parameters import StrawParameters
from replay.errors import ReplayError
from replay.output import write_json
from replay.paper.numbers import Number, numbers
from replay.paper.runs import DEPLOYMENT, FOLDING
from replay.progress import prepare, progress_bar


def run(args: argparse.Namespace) -> int:
    """Simulate the two validation runs, print the table, draw the figures; 0 whether or not all numbers agree."""
    from replay.paper.flow import flow
    from replay.paper.landscape import bifurcations, energy_surface
    from replay.paper.motion import motion
    from replay.paper.shapes import shapes
    from replay.paper.style import save

    sample = files("model") / "samples" / "filling.csv"
    with as_file(sample) as shipped:
        tests = read_filling_tests(args.filling or shipped)
    table = args.filling.name if args.filling else "synthetic sample of the design"
    rho_kg_per_m3 = StrawParameters().rho_kg_per_m3
    radius = channel_radius(tests, rho_kg_per_m3)
    try:
        args.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ReplayError(f"{args.out}: cannot make this folder: {error.strerror}; choose another place") from None
    prepare()
    with progress_bar("numbers and figures", "step") as update:
        update(0, 9)
        folding = FOLDING.simulate()
        update(1, 9)
        deployment = DEPLOYMENT.simulate()
        update(2, 9)
        table_of = numbers(radius, table, folding, deployment)
        update(3, 9)
        made: list[str] = []
        for name, draw in (
            ("fig3-shapes", shapes),
            ("fig4-energy", energy_surface),
            ("fig5-bifurcations", bifurcations),
            ("fig6-folding", lambda: motion(FOLDING, folding)),
            ("fig7-deployment", lambda: motion(DEPLOYMENT, deployment)),
            ("figS1-flow", lambda: flow(tests, radius, table, rho_kg_per_m3)),
        ):
            made += save(draw(), args.out, name)
            update(3 + len(made) // 2, 9)
    _print(table_of)
    print(f"figures in {args.out}: {', '.join(name for name in made if name.endswith('.png'))} (and .svg)")
    if args.json:
        rows = [{**asdict(n), "difference": n.difference, "agrees": n.agrees} for n in table_of]
        write_json(args.json, {"numbers": rows, "figures": [str(args.out / name) for name in made]})
    return 0


def _print(table: list[Number]) -> None:
    width = max(len(n.name) for n in table)
    notes = list(dict.fromkeys(n.note for n in table if n.note))
    print(f"{'number':<{width}}  {'where':<12} {'paper':>12} {'model':>12} {'difference':>11}")
    for n in table:
        note = f" [{notes.index(n.note) + 1}]" if n.note else ""
        print(
            f"{n.name:<{width}}  {n.source:<12} {n.paper:>12.6g} {n.model:>12.6g} {n.difference:>+11.2g} "
            f"{n.unit:<6}{'' if n.agrees else ' DIFFERS'}{note}".rstrip()
        )
    for i, note in enumerate(notes, 1):
        print(f"[{i}] {note}")
    off = sum(not n.agrees for n in table)
    print(f"{len(table)} numbers, {len(table) - off} within rounding, {off} differ; check: an independent derivation")
