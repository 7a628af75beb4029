"""The formula for a table: every shape is fitted to the table, and the nearest ones to the recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from straw.replay.diagnose.discover.trial import Trial, tried
from straw.replay.diagnose.systems.function.codes import CLOCK
from straw.replay.diagnose.systems.function.laws import Law
from straw.replay.diagnose.systems.function.passed import ANGLES, Passed
from straw.replay.diagnose.systems.function.places import values_over
from straw.replay.diagnose.systems.function.shapes import (
    BUMP,
    CONSTANT,
    CUBE,
    FOLLOWS,
    LINEAR,
    OUTSIDE,
    PLAY,
    POWER,
    SHAPES,
    SIGN,
    STEP,
    TABLE,
    UNEQUAL,
    WAVE,
    YIELDS,
)

Floats = NDArray[np.float64]

#: Number of shapes, nearest to the table, that are fitted to the runs.
FITTED = 6
#: Starts of each of a shape's constants on the table, in units of its range.
SCATTER = (0.15, 0.5, 0.85)


def formulas(trial: Trial, before: Trial, seen: Sequence[Passed], *, fine: bool = False) -> list[Trial]:
    """Fits with the last law, a table, as each of the formulas nearest to it; the best first.

    ``before`` is the trial without the law: a formula fitted to a table has more misfit than the table, so sigma starts
    from its value there. A bump is sought over a ``fine`` table only: over few points it follows anything.
    """
    *known, table = trial.laws
    number = len(known)
    n = len(table.unknowns(number))
    base_unknowns, base_u = trial.fit.unknowns[:-n], trial.fit.u[:-n]
    if table.shape == TABLE:
        at = np.array(table.at)
        root, room = (part / table.unit for part in _seen_by_recordings(trial, len(table.at)))
    else:
        at, weight = _where(table, seen)
        root, room = np.diag(weight), np.zeros((len(base_u), len(at)))
    curve = table.curve(number, trial.values, at)
    laid = sorted((_laid(shape, table, at, curve, root) for shape in _shapes(table, fine)), key=lambda one: one[0])
    out = []
    for _, law, u in laid[:FITTED]:
        system = replace(trial.system.with_laws(*known, law), sigma=before.system.sigma)
        campaign = trial.campaign.with_system(system)
        values = {k.target: k.value(float(x)) for k, x in zip(law.unknowns(0), u, strict=True)}
        start = np.concatenate([base_u - room @ (law.curve(0, values, at) - curve), u])
        out.append(tried(campaign, (*base_unknowns, *law.unknowns(number)), start, trial.unit))
    return sorted(out, key=lambda one: one.predicts)


def gradual(trial: Trial) -> Trial:
    """The trial with its last law, a play, as one that yields little by little."""
    *known, law = trial.laws
    system = trial.system.with_laws(*known, replace(law, shape=YIELDS))
    return tried(trial.campaign.with_system(system), trial.fit.unknowns, trial.fit.u, trial.unit)


def _seen_by_recordings(trial: Trial, values: int) -> tuple[Floats, Floats]:
    """A root (values, values) of the information on the last unknowns, a table's values by u, all others free; and
    minus the change of the others with each of these (others, values).

    Parts that the base's constants can compensate, as a straight line beside a stiffness, cost nothing there.
    """
    J = trial.fit.slopes
    sd = np.array([k.sd for k in trial.fit.unknowns])
    H = J.T @ J + np.diag(1 / sd**2)
    own = np.arange(len(sd)) >= len(sd) - values
    inner = np.linalg.lstsq(H[np.ix_(~own, ~own)], H[np.ix_(~own, own)], rcond=1e-10)[0]
    size, ways = np.linalg.eigh(H[np.ix_(own, own)] - H[np.ix_(own, ~own)] @ inner)
    return np.asarray(np.sqrt(np.maximum(size, 0.0))[:, None] * ways.T), np.asarray(inner)


def _where(table: Law, seen: Sequence[Passed]) -> tuple[Floats, Floats]:
    """States to compare at (n,), and their frequency in the recordings."""
    s = table.state
    at = np.linspace(s.low, s.high, 101)
    if table.shape == CONSTANT or s.name == "nothing":
        return at, np.ones_like(at)
    count, _ = np.histogram(np.clip(values_over(s, seen), s.low, s.high), bins=101, range=(s.low, s.high))
    return at, np.sqrt(count / count.max() + 0.02)


def _shapes(table: Law, fine: bool) -> list[int]:
    """Shapes that apply over its state: signed ones need both signs."""
    if table.state.name == "nothing":
        return [CONSTANT]
    if table.place.kind == CLOCK:
        return [CONSTANT, LINEAR, STEP]
    if table.state.lag_s is not None:
        return [LINEAR, CUBE, POWER, SIGN]
    one_sided = table.state.low >= -0.02 * table.state.span
    turns = table.state.unit in ANGLES  # as gravity on an arm, or a motor's cogging
    other = {SIGN: not one_sided, OUTSIDE: not one_sided, UNEQUAL: not one_sided}
    other |= {WAVE: turns, BUMP: fine, FOLLOWS: False, PLAY: False, YIELDS: False}
    return [k for k in SHAPES if other.get(k, True)]


def _laid(shape: int, table: Law, at: Floats, curve: Floats, root: Floats) -> tuple[float, Law, Floats]:
    """A shape fitted to a curve (n,) in a metric root' root: its misfit, the law, and u of its unknowns."""
    law = replace(table, shape=shape, at=())
    unknowns = law.unknowns(0)
    low, high = (np.array([getattr(k, end) for k in unknowns]) for end in ("low", "high"))
    size = float(np.linalg.norm(root @ curve)) or 1.0

    def differs(u: Floats) -> Floats:
        values = {k.target: k.value(float(x)) for k, x in zip(unknowns, u, strict=True)}
        return np.asarray(root @ (law.curve(0, values, at) - curve) / size)

    shapes = [k for k, one in enumerate(unknowns) if not one.target.endswith("strength")]
    best: tuple[float, Floats] | None = None
    for shares in product(SCATTER, repeat=len(shapes)):
        start = law.start(0, 1.0)
        start[shapes] = low[shapes] + np.array(shares) * (high - low)[shapes]
        ones = differs(start) + root @ curve / size
        power = float(ones @ ones)
        start[0] = float(ones @ (root @ curve / size)) / power if power > 0 else 0.0
        end = least_squares(differs, np.clip(start, low + 1e-9, high - 1e-9), bounds=(low, high), max_nfev=60)
        if best is None or end.cost < best[0]:
            best = float(end.cost), end.x
    assert best is not None
    # each constant of a shape must gain a percent of the curve
    return best[0] + 0.005 * len(unknowns), law, best[1]
