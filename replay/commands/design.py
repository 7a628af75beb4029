"""straw design: geometries for wanted snap pressures, lengths and states; the best are checked by finite elements."""

from __future__ import annotations

import argparse
import math
from concurrent.futures import Executor
from dataclasses import asdict
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from straw.model.design import Design, in_order, refined, sweep, with_varied
from straw.model.elasticity import EQUATION_7
from straw.model.frustum_table import frustum_of
from straw.model.parameters import StrawParameters
from straw.model.straw_file import load_straw
from straw.model.wish import WANTED, Wish, read_wish
from straw.replay.commands.shell import require_shell
from straw.replay.errors import ReplayError
from straw.replay.output import write_json, write_text
from straw.replay.progress import prepare, progress_bar
from straw.replay.workers import workers


def run(args: argparse.Namespace) -> int:
    """Search, check, print, draw; 1 where no design meets the wishes."""
    wish, straw = read_wish(args.wish), load_straw(args.straw).replace(elasticity=EQUATION_7)
    if args.count < 64:
        raise ReplayError(f"--count {args.count}: expected 64 or more")
    if args.check:
        require_shell()
    try:
        args.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ReplayError(f"{args.out}: cannot make this folder: {error.strerror}; choose another place") from None
    if wish.order:
        prepare()  # snaps of whole straws; the closed form of one frustum needs nothing compiled
        return _ordered(args, wish, straw)
    with workers(args.jobs, args.dask) as executor:
        designs: list[Design] = []
        with progress_bar("sweep", "design") as update:
            for chunk in sweep(wish, straw, args.count, executor):
                designs += chunk
                update(len(designs), args.count)
        best = refined(wish, straw, designs, args.keep)
        if not best:
            raise ReplayError("design: no point of the ranges is a straw; |zeta02| must be below zeta01, r_i below r_o")
        checked = _checked(best[: args.check], straw, executor)
    _print(wish, best, checked)
    from straw.replay.paper.style import save
    from straw.replay.shell.design_map import design_map

    names = save(design_map(wish, designs, best), args.out, "designs")
    for number, design in enumerate(best, 1):
        write_text(args.out / f"design-{number}.toml", with_varied(straw, design.varied).to_toml())
    print(f"{args.out}: design-1.toml to design-{len(best)}.toml, {names[0]}")
    if args.json:
        rows = [{**asdict(d), "shell": c} for d, c in zip(best, [*checked, *[None] * len(best)], strict=False)]
        write_json(args.json, {"designs": rows, "swept": len(designs)})
    return 0 if _said_if_missed(wish, best[0]) else 1


def _said_if_missed(wish: Wish, best: Design) -> bool:
    """Whether the best design gives what is wanted; what it misses is printed."""
    if best.cost < len(wish.wanted):
        return True
    missed = [
        f"{name} = {best.gives[name]:.4g}, not {want:g}"
        for name, want in wish.wanted.items()
        if not abs(best.gives[name] - want) <= WANTED[name]
    ]
    print(f"no design in these ranges gives all that is wanted; the best has {', '.join(missed)}")
    return False


def shell_gives(straw: StrawParameters) -> dict[str, float]:
    """Snap pressures and deployed length of a straw's first cell by finite elements, end sealed; plain data."""
    from straw.model.errors import ModelError
    from straw.model.shell.equilibria import balance, straight_end
    from straw.model.shell.problem import Problem
    from straw.model.shell.profile import profile_of
    from straw.model.shell.threads import one_thread

    with one_thread():
        try:
            problem = Problem(profile_of(straw), float(straw.E_pa[0, 1]))
            odd, even = (float(x) for x in straw.zeta0_m[0])
            top = balance(problem.barely_tilted().model(), -0.9 * even, 0.0)
            up, down = (straight_end(problem, folded).pressure_pa / 1e3 for folded in (True, False))
        except ModelError:
            return {}
    length = 1e3 * (odd + top.point.zeta_m) if top and top.stable else float("nan")
    return {"deploy_kpa": up, "fold_kpa": down, "deployed_length_mm": length}


def shell_snap_pa(straw: StrawParameters, cell: int, *, folds: bool) -> float:
    """Pressure at which a cell's even frustum snaps by finite elements, end sealed; NaN where none is found."""
    from straw.model.errors import ModelError
    from straw.model.shell.equilibria import straight_end
    from straw.model.shell.problem import Problem
    from straw.model.shell.profile import profile_of
    from straw.model.shell.threads import one_thread

    with one_thread():
        try:
            problem = Problem(profile_of(straw, cell), float(straw.E_pa[cell - 1, 1]))
            return float(straight_end(problem, not folds).pressure_pa)
        except ModelError:
            return math.nan


def _order_checked(args: argparse.Namespace, straw: StrawParameters, seen: list[tuple[int, float]]) -> list[float]:
    """Snaps as seen with finite elements' walls: moved by what these change of each cell's frustum by itself, Pa."""
    folds = seen[0][1] < 0
    cells = [cell for cell, _ in seen]
    made = []
    with workers(args.jobs, args.dask) as executor, progress_bar("finite elements", "cell") as update:
        one = partial(shell_snap_pa, straw, folds=folds)
        for done, own in enumerate(executor.map(one, cells) if executor else map(one, cells), 1):
            low, _, _, high = frustum_of(straw, cells[done - 1], sealed=True).bifurcation_pressures()
            made.append(seen[done - 1][1] + own - (low if folds else high))
            update(done, len(cells))
    return made


def _order_told(pressures_pa: list[float]) -> str:
    """Whether finite elements' walls keep the order, and how far apart the snaps then are."""
    if not all(map(math.isfinite, pressures_pa)):
        return "finite elements: not found for every cell"
    apart = [abs(b) - abs(a) for a, b in pairwise(pressures_pa)]
    if not apart:
        return "finite elements: one cell, no order"
    kept = "in the same order" if min(apart) > 0 else "in another order"
    return f"finite elements: {kept}, {min(apart) / 1e3:.2f} to {max(apart) / 1e3:.2f} kPa apart"


def _checked(best: list[Design], straw: StrawParameters, executor: Executor | None) -> list[dict[str, float]]:
    """The best by finite elements."""
    if not best:
        return []
    straws = [with_varied(straw, d.varied) for d in best]
    made = []
    with progress_bar("finite elements", "design") as update:
        results = executor.map(shell_gives, straws) if executor else map(shell_gives, straws)
        for done, result in enumerate(results, 1):
            made.append(result)
            update(done, len(straws))
    return made


def _print(wish: Wish, best: list[Design], checked: list[dict[str, float]]) -> None:
    columns = [*wish.vary, *wish.wanted]
    print("      " + " ".join(f"{name:>18}" for name in columns))
    print("wanted" + " ".join(f"{wish.wanted.get(name, np.nan):>18.4g}" for name in columns).replace("nan", "   "))
    for number, design in enumerate(best, 1):
        values = {**design.varied, **design.gives}
        print(f"{number:>6}" + " ".join(f"{values[name]:>18.5g}" for name in columns))
        if number <= len(checked):
            found = checked[number - 1]
            shown = (f"{found[name]:>18.5g}" if name in found else f"{'':>18}" for name in columns)
            print(" shell" + " ".join(shown) + ("" if found else "  did not converge"))


def _ordered(args: argparse.Namespace, wish: Wish, straw: StrawParameters) -> int:
    """Cells that snap one after another."""
    if args.straw is None and len(wish.order) != straw.cells:
        straw = straw.replace(cells=len(wish.order))
    made, seen = in_order(wish, straw)
    by_shell = _order_checked(args, made, seen) if args.check else [math.nan] * len(seen)
    print(" snap  cell  wanted kPa  in the whole straw kPa  with finite elements kPa  thickness mm")
    for k, ((cell, pressure), shell) in enumerate(zip(seen, by_shell, strict=True)):
        wanted = wish.first_kpa + k * wish.apart_kpa
        checked = f"{shell / 1e3:>25.3f}" if math.isfinite(shell) else f"{'-':>25}"
        thick = 1e3 * made.h_m[cell - 1, 1]
        print(f"{k + 1:>5} {cell:>5} {wanted:>11.3f} {pressure / 1e3:>23.3f} {checked} {thick:>13.4f}")
    if args.check:
        print(_order_told(by_shell))
    from straw.replay.paper.style import save
    from straw.replay.shell.design_map import order_figure

    path: Path = args.out / "ordered.toml"
    write_text(path, made.to_toml())
    names = save(order_figure(wish, made, seen, by_shell), args.out, "ordered")
    print(f"{path}, {args.out / names[0]}")
    if args.json:
        rows = [
            {"cell": cell, "pressure_pa": p, "shell_pa": shell, "h_m": float(made.h_m[cell - 1, 1])}
            for (cell, p), shell in zip(seen, by_shell, strict=True)
        ]
        write_json(args.json, {"order": rows})
    return 0
