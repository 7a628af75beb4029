"""Mesh by tolerance: refine along and around, one at a time, until the probes move by less than asked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from straw.model.errors import ModelError
from straw.model.shell.mesh import Mesh
from straw.model.shell.problem import Problem
from straw.model.shell.solve import Point

#: Order of the elements; around the wall the harmonics are refined, along it the number of elements.
ORDER = 5
ALONG, AROUND = (1, 2, 3, 4, 6, 8), (5, 7, 9, 12, 16)
#: Where the mesh is judged: height as a share of the unloaded one, and of what the slant leaves, the bending at the
#: rim. The first lies beyond the bent equilibrium, the second between folded and bent.
PROBES = ((0.12, 0.62), (0.55, 0.45))


@dataclass(frozen=True)
class Refinement:
    """One mesh and how far the probes' numbers moved from the mesh before, relative to the largest."""

    mesh: Mesh
    energies_j: tuple[float, ...]
    change: float


def probes(problem: Problem) -> list[tuple[float, float]]:
    """(zeta, phi) at which the mesh is judged."""
    height, slant, r = problem.profile.height_m, problem.slant_m, problem.profile.r_i_m
    if len(problem.profile.walls) > 1:  # a cell: the upper wall moves as if the lower were rigid
        lower = float(problem.profile.walls[0].points_m[-1, 1] - problem.profile.walls[0].points_m[0, 1])
        own = height - lower
        return [(lower + a * own, b * (slant - a * abs(own)) / r) for a, b in PROBES]
    return [(a * height, b * (slant - a * abs(height)) / r) for a, b in PROBES]


def chosen_mesh(
    problem: Problem, tolerance: float, tell: Callable[[Refinement], None] | None = None
) -> tuple[Mesh, list[Refinement]]:
    """The coarsest mesh whose next refinements, along and around, move energy, force and moment at the probes by less.

    Changes are relative to the largest of a kind over the probes; forces count over energy by the height, moments by
    the angle. Raises ModelError where the finest mesh still moves by more.
    """
    if not tolerance > 0:
        raise ModelError(f"shell: tolerance {tolerance}, expected above zero")
    history: list[Refinement] = []
    at = probes(problem)
    known: dict[Mesh, list[Point]] = {}

    def points(mesh: Mesh) -> list[Point]:
        if mesh not in known:
            model = replace(problem, mesh=mesh).model()
            known[mesh] = [model.at(*place) for place in at]
        return known[mesh]

    along = around = 0
    while True:
        mesh = Mesh(ALONG[along], ORDER, AROUND[around])
        here = points(mesh)
        finer = [
            Mesh(ALONG[min(along + 1, len(ALONG) - 1)], ORDER, AROUND[around]),
            Mesh(ALONG[along], ORDER, AROUND[min(around + 1, len(AROUND) - 1)]),
        ]
        changes = [change(here, points(other)) for other in finer]
        history.append(Refinement(mesh, tuple(p.energy_j for p in here), max(changes)))
        if tell:
            tell(history[-1])
        if max(changes) < tolerance:
            return mesh, history
        if changes[0] >= tolerance:
            along += 1
        if changes[1] >= tolerance:
            around += 1
        if along == len(ALONG) - 1 or around == len(AROUND) - 1:
            raise ModelError(
                f"shell: {mesh} still moves by {max(changes):.1e}, more than the tolerance {tolerance:g}; ask for less"
            )


def change(one: list[Point], other: list[Point]) -> float:
    """Largest relative difference of energy, force and moment."""

    def numbers(points: list[Point]) -> np.ndarray:
        return np.array([[p.energy_j, p.force_n * p.zeta_m, p.moment_n_m * p.phi_rad] for p in points])

    a, b = numbers(one), numbers(other)
    return float((np.abs(a - b).max(axis=0) / np.abs(b[:, 0]).max()).max())
