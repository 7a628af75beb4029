"""Follows a stable rest state while its load grows, by pseudo-arclength continuation, to where stability is lost.

The straw obeys rest_force(q, s p) - (1 - s) leftover = 0 as s goes from 0 to 1. With ``leftover`` the force at a start
that is not at rest, s releases the straw from there, whatever terms cause that force; with none, s raises
the pressure on a straw at rest. Arclength rather than s is the parameter, so that a step cannot jump over the fold in
which a state ends (Keller 1977; Seydel, Practical Bifurcation and Stability Analysis, chapter 4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.stiffness import length_scale, pressure_force, rest_force, stiffness_matrix

Floats = NDArray[np.float64]

#: Longest step, in units of (zeta / r_i, phi, load); states of a cell lie 0.1 to 0.3 apart.
LONGEST_STEP, FIRST_STEP, SHORTEST_STEP = 0.05, 0.02, 1e-7
#: A snap takes 20 steps; a branch that takes more than this is given up.
MOST_STEPS = 5000
#: Arclength of a load of 1; of a pressure, the multiple of 100 kPa.
LOAD_LENGTH, PRESSURE_LENGTH_PA = 0.2, 100e3
#: Newton squares its error: a step of 1e-6 leaves 1e-12.
NEWTON_LIMIT, CLOSE = 8, 1e-6


@dataclass(frozen=True)
class Followed:
    """Where following ended: coordinates, the load s there, and each cell's share in the unstable mode, (cells,).

    ``share`` is None where the whole load is carried by a stable state.
    """

    q: Floats
    load: float
    share: Floats | None


class Branch:
    """A branch of rest states of a straw; points are y = ((q - start) / scale of the free coordinates, load)."""

    def __init__(
        self,
        straw: StrawParameters,
        start: Floats,
        pressure_pa: float,
        *,
        held_start: bool = False,
        free: NDArray[np.intp] | None = None,
    ) -> None:
        self.c, self.cells, self.pressure_pa = straw.constants(), straw.cells, pressure_pa
        self.start = start.copy()
        self.free = np.arange(len(start)) if free is None else free
        self.scale = length_scale(straw)[self.free]
        self.leftover = rest_force(self.c, self.start, 0.0) if held_start else np.zeros_like(start)
        self.load_length = max(LOAD_LENGTH if held_start else 0.0, abs(pressure_pa) / PRESSURE_LENGTH_PA, 1e-6)

    def place(self, y: Floats) -> tuple[Floats, float, float]:
        """Coordinates, load s and pressure at a point."""
        q, s = self.start.copy(), float(y[-1]) / self.load_length
        q[self.free] += y[:-1] * self.scale
        return q, s, s * self.pressure_pa

    def force(self, y: Floats) -> Floats:
        """Residual force at a point, N m."""
        q, s, p = self.place(y)
        return (rest_force(self.c, q, p) - (1 - s) * self.leftover)[self.free] * self.scale

    def jacobian(self, y: Floats) -> Floats:
        """Derivative of ``force``, shape (free, free + 1); the first part is minus the scaled stiffness."""
        q, _, p = self.place(y)
        K = stiffness_matrix(self.c, q, p)[np.ix_(self.free, self.free)] * self.scale * self.scale[:, None]
        by_load = pressure_force(self.c, q, p) * self.pressure_pa + self.leftover
        return np.column_stack([-K, by_load[self.free] * self.scale / self.load_length])

    def correct(self, guess: Floats, direction: Floats, reach: float) -> Floats | None:
        """The branch's point in the plane across ``direction`` through the guess, by steps no longer than ``reach``."""
        y = guess.copy()
        for _ in range(NEWTON_LIMIT):
            out = np.append(self.force(y), direction @ (y - guess))
            try:
                step = np.linalg.solve(np.vstack([self.jacobian(y), direction]), -out)
            except np.linalg.LinAlgError:
                return None
            size = float(np.abs(step).max())
            if not size <= max(reach, CLOSE):  # also where it is not a number
                return None
            y += step
            if size < CLOSE:
                return y
        return None

    def settled(self, reach: float) -> Floats | None:
        """Coordinates of the stable state under the whole load within ``reach`` of the start; None where none is."""
        y = np.append(np.zeros(len(self.free)), self.load_length)
        found = self.correct(y, np.eye(len(y))[-1], reach)
        if found is None or np.abs(found[:-1]).max() > reach or _softest(self.jacobian(found)) <= 0:
            return None
        return self.place(found)[0]


def _tangent(J: Floats, along: Floats) -> Floats:
    """Unit tangent of the branch where its jacobian is J, in the sense of ``along``."""
    t = np.linalg.solve(np.vstack([J, along]), np.append(np.zeros(len(J)), 1.0))
    return np.asarray(t / np.linalg.norm(t))


def _softest(J: Floats) -> float:
    """Smallest real part of the stiffness' eigenvalues where the branch's jacobian is J, N m."""
    if not np.isfinite(J).all():
        raise ModelError("no rest state: the straw's stiffness is not finite; check its constants and the pressure")
    return float(np.linalg.eigvals(-J[:, :-1]).real.min())


def follow(branch: Branch) -> Followed:
    """Follow a branch from load 0 to load 1, or to the point where its state loses stability."""
    y = np.zeros(len(branch.free) + 1)
    up = np.eye(len(y))[-1]
    J = branch.jacobian(y)
    if _softest(J) <= 0:
        return _ended(branch, y)
    direction, step = _tangent(J, up), FIRST_STEP
    for _ in range(MOST_STEPS):
        guess = y + step * direction
        arrives = guess[-1] >= branch.load_length
        if arrives:  # land on the whole load: the plane across the load's axis
            guess = y + (branch.load_length - y[-1]) / direction[-1] * direction
        new = branch.correct(guess, up if arrives else direction, step)
        if new is None:
            step /= 4
            if step < SHORTEST_STEP:
                return _ended(branch, y)
            continue
        J = branch.jacobian(new)
        if _softest(J) <= 0:
            return _ended(branch, _lost(branch, y, direction, float((new - y) @ direction)))
        if arrives:
            return Followed(branch.place(new)[0], 1.0, None)
        bend = float(np.linalg.norm(new - guess)) / step
        y, direction = new, _tangent(J, direction)
        # where every step bends, however short, halves alone would end at a step of zero
        step = min(LONGEST_STEP, max(SHORTEST_STEP, step * (2 if bend < 0.02 else 1 if bend < 0.1 else 0.5)))
    return _ended(branch, y)


def _lost(branch: Branch, y: Floats, direction: Floats, far: float) -> Floats:
    """The point up to ``far`` beyond y at which the smallest eigenvalue passes zero."""

    def point(step: float) -> Floats:
        found = branch.correct(y + step * direction, direction, LONGEST_STEP)
        return y if found is None else found

    def softest(step: float) -> float:
        return _softest(branch.jacobian(point(step)))

    near, end = softest(0.0), softest(far)
    if near <= 0 or end >= 0:  # correction across this plane ends elsewhere than the step that lost its stability
        return point(0.0 if near <= 0 else far)
    return point(brentq(softest, 0.0, far, xtol=1e-7, rtol=1e-7))


def _ended(branch: Branch, y: Floats) -> Followed:
    """The end of a branch at a point, with each cell's share in the softest mode."""
    values, modes = np.linalg.eig(-branch.jacobian(y)[:, :-1])
    weight = np.zeros(branch.cells)
    np.add.at(weight, branch.free % branch.cells, np.abs(modes[:, values.real.argmin()]) ** 2)
    return Followed(*branch.place(y)[:2], weight / weight.sum())
