"""straw paper: the paper's numbers beside the model's, and its figures redrawn."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from importlib.resources import as_file, files
from typing import Any

from straw.model.filling import channel_radius, read_filling_tests
from straw.model.parameters import StrawParameters
from straw.replay.errors import ReplayError
from straw.replay.output import write_json
from straw.replay.paper.numbers import Number, numbers
from straw.replay.paper.runs import DEPLOYMENT, FOLDING
from straw.replay.progress import prepare, progress_bar


def run(args: argparse.Namespace) -> int:
    """Simulate the two validation runs, print the table, draw the figures; 0 whether or not all numbers agree."""
    from straw.replay.paper.flow import flow
    from straw.replay.paper.landscape import bifurcations, energy_surface
    from straw.replay.paper.motion import motion
    from straw.replay.paper.shapes import shapes
    from straw.replay.paper.style import save

    sample = files("straw.model") / "samples" / "filling.csv"
    with as_file(sample) as shipped:
        tests = read_filling_tests(args.filling or shipped)
    table = args.filling.name if args.filling else "synthetic sample, made with 0.52 mm"
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
    shell = _shell(args) if args.shell else None
    _print(table_of)
    print(f"figures in {args.out}: {', '.join(name for name in made if name.endswith('.png'))} (and .svg)")
    if shell:
        made += shell.pop("figures")
        _print_shell(shell)
    if args.json:
        rows = [{**asdict(n), "difference": n.difference, "agrees": n.agrees} for n in table_of]
        result = {"numbers": rows, "figures": [str(args.out / name) for name in made]}
        write_json(args.json, result | ({"shell": shell} if shell else {}))
    return 0


def _shell(args: argparse.Namespace) -> dict[str, Any]:
    """The paper's finite elements: table, cuts, rigidity of the odd frusta, and both runs by their energy."""
    from straw.replay.commands.shell import require_shell

    require_shell()
    from straw.model.shell.threads import one_thread
    from straw.replay.paper import shell, shell_runs
    from straw.replay.paper.style import save
    from straw.replay.shell.table import frustum_table

    problem = shell.specimen()
    with one_thread(), progress_bar("finite elements", "step") as update:
        rows, _ = frustum_table(problem, lambda done, of: update(done, of + 5))
        update(8, 12)
        cuts = shell.cuts(problem)
        update(9, 12)
        rigid = shell.rigidity()
        update(10, 12)
        geometry = shell_runs.refitted()
        update(11, 12)
        runs = shell_runs.elastic_runs(geometry)
        figures = [
            *save(shell.draw_cuts(cuts), args.out, "fig4-shell"),
            *save(shell.draw_rigidity(rigid), args.out, "figS2-shell"),
            *save(shell_runs.draw_runs(runs), args.out, "fig67-shell"),
        ]
        update(12, 12)
    rows += [*shell.rigidity_rows(rigid), *shell_runs.snap_rows(geometry)]
    return {
        "table": [{**asdict(row), "difference": row.difference} for row in rows],
        "agreement": shell.agreement(cuts),
        "inferred": list(shell.INFERRED),
        "verdict": shell_runs.verdict(runs),
        "figures": figures,
    }


def _print_shell(found: dict[str, Any]) -> None:
    from straw.replay.shell.table import Row, printed

    print("\nby finite elements (director shell, nu = 0.33) beside equation 7")
    print(printed([Row(r["name"], r["unit"], r["reduced"], r["shell"]) for r in found["table"]]))
    for title, key in (
        ("'very good agreement at moderate values', in figures:", "agreement"),
        ("not stated in the paper, and inferred:", "inferred"),
        ("does it explain the paper better?", "verdict"),
    ):
        print(title)
        for line in found[key]:
            print(f"  {line}")


def _print(table: list[Number]) -> None:
    width = max(len(n.name) for n in table)
    ways = list(dict.fromkeys(n.how for n in table))
    print(f"{'number':<{width}}  {'where':<12} {'paper':>8} {'model':>9} {'difference':>11}")
    for n in table:
        print(
            f"{n.name:<{width}}  {n.source:<12} {n.paper:>8.5g} {n.model:>9.6g} {n.difference:>+11.2g} "
            f"{n.unit:<4}{'' if n.agrees else ' DIFFERS'} [{ways.index(n.how) + 1}]"
        )
    print("how the model's number was obtained:")
    for i, how in enumerate(ways, 1):
        print(f"[{i}] {how}")
    off = sum(not n.agrees for n in table)
    print(f"{len(table)} numbers of the paper, {len(table) - off} within its rounding, {off} differ")
