"""straw shell: finite elements of a frustum or a cell beside the reduced energy."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from straw.model.parameters import StrawParameters
from straw.model.straw_file import load_straw
from straw.replay.errors import ReplayError
from straw.replay.output import write_json, write_text
from straw.replay.progress import progress_bar, say
from straw.replay.workers import workers


def require_shell() -> None:
    """Raise ReplayError where the extra is not installed."""
    try:
        import skfem  # noqa: F401
        import threadpoolctl  # noqa: F401
    except ImportError:
        raise ReplayError("finite elements need scikit-fem: pip install 'straw[shell]'") from None


def run(args: argparse.Namespace) -> int:
    """Mesh by tolerance, table, and as asked the landscape, its pictures and the elasticity; 1 if points failed."""
    require_shell()
    from straw.model.shell.threads import one_thread

    straw = load_straw(args.straw)
    if args.points < 60:
        raise ReplayError(f"--points {args.points}: expected 60 or more")
    for path in (args.json, args.elasticity):
        if path and path.parent != args.out and not path.parent.is_dir():
            raise ReplayError(f"{path}: there is no folder {path.parent}; make it or choose another place")
    with one_thread():
        return _run(args, straw)


def _run(args: argparse.Namespace, straw: StrawParameters) -> int:
    from straw.model.shell.converge import Refinement, chosen_mesh
    from straw.model.shell.equilibria import balances, guesses_of
    from straw.replay.shell.table import frustum_table, printed, reduced_frustum

    problem = _problem(args, straw)
    say("choosing the mesh")

    def told(step: Refinement) -> None:
        print(
            f"  {step.mesh.elements} along, {step.mesh.harmonics:>2} around: the next finer moves energy, force and "
            f"moment by {step.change:.1e} (asked: {args.tolerance:g})",
            flush=True,
        )

    mesh, history = chosen_mesh(replace(problem, pressure_pa=0.0), args.tolerance, told)
    problem = replace(problem, mesh=mesh)
    print(f"mesh: {mesh.elements} elements of order {mesh.order} along, harmonics to {mesh.harmonics} around")
    one = len(problem.profile.walls) == 1
    result: dict[str, object] = {"shell": problem.described(), "convergence": [_step(s) for s in history]}
    found: list[Any] = []
    if one and problem.pressure_pa == 0 and problem.profile.crease_n == 0:
        with progress_bar("equilibria and pressures", "step") as update:
            rows, found = frustum_table(problem, update)
        print(printed(rows))
        result["table"] = [{**asdict(row), "difference": row.difference} for row in rows]
    else:
        guesses = _cell_guesses(problem) if not one else [*guesses_of(reduced_frustum(problem)), *_heights(problem)]
        found = balances(problem, guesses)
        print("equilibria (zeta mm, |phi| rad, energy mJ):")
        for b in found:
            p = b.point
            kind = "stable" if b.stable else "unstable"
            print(f"  {1e3 * p.zeta_m:8.3f} {p.phi_rad:7.4f} {1e3 * p.energy_j:8.3f}  {kind}")
    result["equilibria"] = [
        {"zeta_m": b.point.zeta_m, "phi_rad": b.point.phi_rad, "energy_j": b.point.energy_j, "stable": b.stable}
        for b in found
    ]
    failed = 0
    if args.out or args.elasticity:
        failed = _landscape(args, problem, found, reduced_frustum(problem, sealed=problem.pressure_pa != 0), result)
    if args.json:
        write_json(args.json, result)
    return 1 if failed else 0


def _problem(args: argparse.Namespace, straw: StrawParameters):  # type: ignore[no-untyped-def]
    from straw.model.shell.hold import Hold
    from straw.model.shell.problem import Problem
    from straw.model.shell.profile import profile_of, read_profile

    if args.profile:
        profile, E_pa = read_profile(args.profile, args.crease), float(straw.E_pa[0, 1])
    else:
        profile = profile_of(straw, args.cell, whole=args.whole, crease_n=args.crease)
        E_pa = float(straw.E_pa[args.cell - 1, 1])
    hold = Hold(args.phi, _freedom(args.rims), _freedom(args.bases))
    return Problem(profile, E_pa, args.nu, hold=hold, pressure_pa=1e3 * args.pressure_kpa)


def _freedom(text: str) -> str | float:
    try:
        return float(text)
    except ValueError:
        return text


def _heights(problem) -> list[tuple[float, float]]:  # type: ignore[no-untyped-def]
    return [(float(z), 0.0) for z in np.linspace(-1, 1, 9) * abs(problem.profile.height_m)]


def _cell_guesses(problem) -> list[tuple[float, float]]:  # type: ignore[no-untyped-def]
    """Where a cell's equilibria are if its lower frustum is rigid, its upper one as equation 7 says."""
    from straw.model.shell.equilibria import guesses_of
    from straw.replay.shell.table import reduced_frustum

    return guesses_of(reduced_frustum(problem), _lower_m(problem))


def _lower_m(problem) -> float:  # type: ignore[no-untyped-def]
    """Height of a cell's lower frustum."""
    lower = problem.profile.walls[0].points_m
    return float(lower[-1, 1] - lower[0, 1])


def _step(step) -> dict[str, object]:  # type: ignore[no-untyped-def]
    return {"mesh": vars(step.mesh), "change": step.change, "energies_j": step.energies_j}


def _landscape(args, problem, found, flat, result) -> int:  # type: ignore[no-untyped-def]
    """Solve the grid, say what failed, draw, fit; returns how many points failed."""
    from straw.model.shell.fit import fitted, quality
    from straw.model.shell.landscape import grid_for, landscape

    folder: Path | None = args.out
    if folder:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ReplayError(f"{folder}: cannot make this folder: {error.strerror}; choose another place") from None
    kept = folder / f"landscape-{problem.key}.jsonl" if folder else None
    with workers(args.jobs, args.dask) as executor, progress_bar("landscape", "row") as update:
        land = landscape(problem, grid_for(problem, args.points), kept, executor, update)
    for text in land.failed:
        print(text)
    weak = int((land.column("stable") == 0).sum())
    print(
        f"landscape: {len(land.points)} points, {len(land.failed)} rows cut short"
        + (f", kept in {kept}" if kept else "")
    )
    if weak:
        print(f"at {weak} points the wall between its bases gives way by itself: it buckles there")
    result["points"] = len(land.points)
    result["failed"] = list(land.failed)
    if folder:
        _draw(folder, problem, land, flat, found)
    if args.elasticity:
        _fit(args.elasticity, problem, land, fitted, quality, result)
    return len(land.failed)


def _draw(folder, problem, land, flat, found) -> None:  # type: ignore[no-untyped-def]
    from straw.replay.paper.style import save
    from straw.replay.shell.pictures import deformed_figure, energy_map, straight_figure

    say("pictures")
    one = len(problem.profile.walls) == 1
    names = save(energy_map(land, flat, found, 0.0 if one else _lower_m(problem)), folder, "energy")
    if one and problem.pressure_pa == 0:
        names += save(straight_figure(problem, flat), folder, "straight")
    model = problem.model()
    shapes = []
    for b in [b for b in found if b.stable][:4]:
        point = model.at(b.point.zeta_m, b.point.phi_rad)
        title = f"zeta {1e3 * point.zeta_m:.2f} mm, phi {point.phi_rad:.3f}, {1e3 * point.energy_j:.1f} mJ"
        shapes.append((title, model, point))
    if shapes:
        names += save(deformed_figure(shapes), folder, "deformed")
    print(f"pictures in {folder}: {', '.join(name for name in names if name.endswith('.png'))} (and .svg)")


def _fit(path, problem, land, fitted, quality, result) -> None:  # type: ignore[no-untyped-def]
    mesh = problem.mesh
    made = (
        f"straw shell: {mesh.elements} elements of order {mesh.order}, {mesh.harmonics} harmonics, {len(land.points)} "
        f"points, phi as {problem.hold.reading}, bases {problem.hold.bases}"
    )
    found = fitted(land, made)
    write_text(path, json.dumps(found.described(), indent=0) + "\n")
    barrier = float(np.max([row[0, 2] for row in land.rows() if abs(row[0, 0]) < abs(problem.profile.height_m)]))
    for share in (0.7, 1.2, 2.0):
        q = quality(land, found, share * barrier)
        print(
            f"elasticity: off by {1e3 * q.energy_j:.3f} mJ, {q.force_n:.3f} N, {1e3 * q.moment_n_m:.2f} mN m (RMS) "
            f"where energy < {1e3 * q.below_j:.0f} mJ ({q.points} points)"
        )
    print(f'{path}: for elasticity = "{path.name}" in a straw file')
    result["elasticity"] = str(path)
