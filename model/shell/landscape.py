"""Landscape: energy, forces and stiffness over (zeta, phi), row by row, on many cores, kept as it grows.

The file is JSON lines: the problem and grid first, then one line a row of equal zeta. An interrupted run continues
from the rows that are there. A point without an equilibrium is noted in its row and the others are kept.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from straw.model.errors import ModelError
from straw.model.shell.mesh import Shell
from straw.model.shell.problem import Problem
from straw.model.shell.profile import Meridian, Profile
from straw.model.shell.solve import NotFoundError, Point
from straw.model.shell.strain import Floats
from straw.model.shell.threads import one_thread

#: What is known at a point, SI; ``by_zeta0`` is the energy's change with the unloaded height, J/m.
COLUMNS = (
    "phi_rad",
    "energy_j",
    "force_n",
    "moment_n_m",
    "k_zeta_n_per_m",
    "k_mixed_n",
    "k_phi_n_m",
    "stretching_j",
    "bending_j",
    "by_zeta0_n",
    "stable",
)
#: Share of the slant up to which |zeta| + r_i |phi| goes: beyond it the wall stretches and the energy rises steeply.
REACH = 0.95
#: Rows a worker takes at a time: from one to the next it need not start at the unloaded shape.
CHUNK = 4
#: Change of the unloaded height for the derivative by it.
ZETA0_SHARE = 1e-3


@dataclass(frozen=True)
class Grid:
    """Rows of equal zeta, each with angles from 0 to where the slant or ``phi_most_rad`` ends it."""

    zeta_m: tuple[float, ...]
    angles: int = 15
    phi_most_rad: float = 0.36

    def phi_rad(self, problem: Problem, zeta_m: float) -> Floats:
        """Angles of a row."""
        own = zeta_m
        if len(problem.profile.walls) > 1:
            lower = problem.profile.walls[0].points_m
            own = zeta_m - float(lower[-1, 1] - lower[0, 1])
        most = (REACH * problem.slant_m - abs(own)) / problem.profile.r_i_m
        return np.linspace(0.0, max(0.0, min(most, self.phi_most_rad)), self.angles)


def grid_for(problem: Problem, points: int = 900, angles: int = 15) -> Grid:
    """A grid of about so many points over all heights that the slant allows."""
    if points < 4 * angles:
        raise ModelError(f"shell: {points} points, expected {4 * angles} or more: {angles} angles at four heights")
    reach = 0.9 * problem.slant_m
    middle = 0.0
    if len(problem.profile.walls) > 1:
        lower = problem.profile.walls[0].points_m
        middle = float(lower[-1, 1] - lower[0, 1])
    return Grid(tuple(np.linspace(middle - reach, middle + reach, points // angles).tolist()), angles)


@dataclass(frozen=True)
class Landscape:
    """What was found: points (n, 12), zeta in front of `COLUMNS`, and what failed, in words."""

    problem: Problem
    points: Floats
    failed: tuple[str, ...]

    def column(self, name: str) -> Floats:
        """One column, (n,)."""
        return np.asarray(self.points[:, 0 if name == "zeta_m" else 1 + COLUMNS.index(name)])

    def rows(self) -> Iterator[Floats]:
        """Points of equal zeta, (angles, 12), by rising zeta and angle."""
        for zeta in np.unique(self.points[:, 0]):
            row = self.points[self.points[:, 0] == zeta]
            yield row[np.argsort(row[:, 1])]


Row = dict[str, Any]


def solve_rows(problem: Problem, grid: Grid, zetas_m: Sequence[float]) -> list[Row]:
    """Rows of neighbouring heights; plain data in and out, so that it can run anywhere."""
    with one_thread():
        model = problem.model()
        other = _other_heights(problem)
        near: Point | None = None
        made = []
        for zeta in zetas_m:
            points, failed = [], []
            point = near
            for phi in grid.phi_rad(problem, zeta):
                try:
                    point = model.at(zeta, float(phi), point)
                except NotFoundError as error:
                    failed.append(str(error))
                    break  # further out the wall is only stretched more
                if phi == 0:
                    near = point
                q = model.held.place(point.y, zeta, float(phi))
                slope = 0.0
                if other:
                    up, down = (sum(shell.energy(q)) for shell in other[0])
                    slope = (up - down) / other[1]
                points.append([float(phi), *point.numbers, slope, float(point.stable)])
            made.append({"zeta_m": zeta, "points": points, "failed": failed})
        return made


def _other_heights(problem: Problem) -> tuple[tuple[Shell, Shell], float] | None:
    """Shells unloaded a little higher and lower, and how far they are apart; None for a cell."""
    if len(problem.profile.walls) > 1:
        return None
    wall, crease = problem.profile.walls[0], problem.profile.crease_n
    shells = []
    for share in (1 + ZETA0_SHARE, 1 - ZETA0_SHARE):
        points = wall.points_m * [1.0, share]
        profile = Profile((Meridian(points, wall.thickness_m),), crease)
        shells.append(Shell(profile, problem.E_pa, problem.nu, problem.mesh))
    return (shells[0], shells[1]), 2 * ZETA0_SHARE * problem.profile.height_m


def landscape(
    problem: Problem,
    grid: Grid,
    path: Path | None = None,
    executor: Executor | None = None,
    tell: Callable[[int, int], None] | None = None,
) -> Landscape:
    """All rows of a grid, kept in a file where one is given; rows that the file holds already are not solved again.

    Raises ModelError where the file holds another problem or cannot be written.
    """
    header = {"shell": problem.described(), "key": problem.key, "grid": vars(grid)}
    rows = _kept(path, header) if path else {}
    missing = [z for z in grid.zeta_m if z not in rows]
    # from the unloaded height outwards, so that no chunk starts with a long way
    chunks = [missing[i : i + CHUNK] for i in range(0, len(missing), CHUNK)]
    if tell:
        tell(len(rows), len(grid.zeta_m))
    for made in _solved(problem, grid, chunks, executor):
        if path:
            _append(path, made)
        rows |= {row["zeta_m"]: row for row in made}
        if tell:
            tell(len(rows), len(grid.zeta_m))
    return _gathered(problem, [rows[z] for z in grid.zeta_m])


def _solved(problem: Problem, grid: Grid, chunks: list[list[float]], executor: Executor | None) -> Iterator[list[Row]]:
    if executor is None:
        yield from (solve_rows(problem, grid, chunk) for chunk in chunks)
        return
    futures = [executor.submit(solve_rows, problem, grid, chunk) for chunk in chunks]
    try:
        for future in as_completed(futures):
            yield future.result()
    finally:
        for future in futures:
            future.cancel()


def processes(jobs: int) -> Executor | None:
    """Workers on this machine; None for one."""
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) if jobs > 1 else None


def _kept(path: Path, header: Row) -> dict[float, Row]:
    """Rows of a file of the same problem; a new file with its header where there is none."""
    try:
        if not path.exists():
            path.write_text(json.dumps(header) + "\n", encoding="utf-8")
            return {}
        lines = path.read_text(encoding="utf-8").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{path}: cannot be read or made: {error}; choose another place") from None
    try:
        found = json.loads(lines[0])
    except ValueError:
        found = None
    if found != json.loads(json.dumps(header)):
        raise ModelError(f"{path}: holds another landscape than the one asked for; move it away or name another file")
    rows = {}
    whole = [lines[0]]
    for line in lines[1:]:
        try:
            row = json.loads(line)
        except ValueError:
            continue  # cut where a run was interrupted
        rows[row["zeta_m"]] = row
        whole.append(line)
    if len(whole) < len([line for line in lines if line]):
        path.write_text("\n".join(whole) + "\n", encoding="utf-8")
    return rows


def _append(path: Path, rows: list[Row]) -> None:
    try:
        with path.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(row) + "\n" for row in rows)
    except OSError as error:
        raise ModelError(f"{path}: cannot be written: {error.strerror}; choose another place") from None


def load_landscape(path: Path) -> Landscape:
    """A landscape that was kept; ModelError where the file is not one."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        header = json.loads(lines[0])
        problem = Problem.from_described(header["shell"])
        rows = [json.loads(line) for line in lines[1:]]
    except (OSError, UnicodeDecodeError, ValueError, IndexError, KeyError, TypeError) as error:
        raise ModelError(f"{path}: not a landscape of straw shell: {error}") from None
    return _gathered(problem, sorted(rows, key=lambda row: row["zeta_m"]))


def _gathered(problem: Problem, rows: list[Row]) -> Landscape:
    points = [[row["zeta_m"], *point] for row in rows for point in row["points"]]
    failed = tuple(text for row in rows for text in row["failed"])
    return Landscape(problem, np.array(points).reshape(-1, 1 + len(COLUMNS)), failed)
