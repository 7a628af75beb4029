"""Formulas for curves, fitted on tables whose points lie where the formulas bend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.formed import Model, coarsely_first, fitted
from straw.replay.diagnose.formula import Sum
from straw.replay.diagnose.formula_fit import LAST_ROUNDS, Written, as_good, as_written, cost_beside, formula
from straw.replay.diagnose.judge import CALIBRATION
from straw.replay.diagnose.systems.straw.curve import MOVES, Curve, searched
from straw.replay.diagnose.systems.straw.curves import restarted
from straw.replay.diagnose.systems.straw.dictionary import atoms
from straw.replay.diagnose.systems.straw.of import straw_of, with_straw
from straw.replay.diagnose.systems.straw.tables import FOLLOWS, formula_points

Floats = NDArray[np.float64]


def with_formula(curve: Curve, null: Fit) -> tuple[Curve, Written]:
    """A curve with its formula; the curve fitted again from it where the formula fits better, as a curve can follow
    any formula."""
    form, base = written(curve, null), len(curve.fit.unknowns) - len(curve.at)
    if form.model.fit.cost < cost_beside(curve.fit, base, curve.smooth) - CALIBRATION.scale:
        other = restarted(curve, form.model.parameters()[1])
        if other.fit.cost < curve.fit.cost:
            curve, form = other, written(other, null)
    return curve, form


def written(curve: Curve, null: Fit) -> Written:
    """The curve's formula, whatever is beside it."""
    fit, at = curve.fit, curve.at * curve.scale(curve.fit)
    base = len(fit.unknowns) - len(at)
    return formula(curve.campaign, fit, base, curve.smooth, at, atoms(curve.state, at), null.cost)


def tabulated(curves: Sequence[Curve], null: Fit, forms: Sequence[Written]) -> tuple[list[Written], Model]:
    """The curves' formulas fitted together, and what predicts other runs: these formulas or, where they are not as
    good, the curves, the last of which holds the fit of all.

    The system knows tables only. One whose points lie where the curve bends follows a formula's kink to the distance of
    two points, and the fit then moves the kink, and the base's constants, to make up for it. So the tables' points are
    placed by the formulas, again and again until the kinks stay. What fits best is kept, as a law that is not quite the
    formula may be nearer to it between points that lie farther apart.
    """
    last = curves[-1]
    base = len(last.fit.unknowns) - sum(len(one.at) for one in curves)
    none, sums = np.zeros((0, base)), [one.sum for one in forms]
    if len(forms) == 1:
        model = forms[0].model
    else:
        start = fitted(last.campaign, last.fit.unknowns, last.fit.u[:base], none, sums, LAST_ROUNDS)
        model = min(start, coarsely_first(start), key=lambda one: one.fit.cost)
    known = cost_beside(last.fit, base, last.smooth)
    forms = as_written(model, null.cost, known)
    best = forms, model
    tables, scales = [one.points for one in curves], [one.scale(last.fit) for one in curves]
    for _ in range(MOVES):
        sums, si = [one.sum for one in forms], [one.scale(model.fit, base) for one in curves]
        placed = [_points(*one) for one in zip(curves, tables, sums, si, strict=True)]
        same = all(np.array_equal(*pair) for pair in zip(tables, placed, strict=True))
        if last.campaign.stop() or (same and np.allclose(si, scales, rtol=FOLLOWS, atol=0)):
            break
        tables, scales = placed, si
        campaign, unknowns = last.campaign, last.fit.unknowns[:base]
        for k, (curve, at) in enumerate(zip(curves, tables, strict=True)):
            campaign = with_straw(campaign, curve.state.straw_with(straw_of(campaign), at))
            unit, free = curve.fit.unknowns[-1].scale, at[searched(curve.state, at)]
            unknowns = (*unknowns, *(replace(one, scale=unit) for one in curve.state.unknowns(at)))
            sums[k] = replace(sums[k], at=free * si[k], scale=np.full(len(free), unit))
        model = fitted(campaign, unknowns, model.fit.u[:base], none, sums, LAST_ROUNDS)
        forms = as_written(model, null.cost, known)
        best = min(best, (forms, model), key=lambda one: one[1].fit.cost)
    forms, model = best
    points, numbers = len(last.fit.unknowns) - base, sum(one.sum.numbers for one in forms)
    good = as_good(null.cost, known, points, model.fit.cost, numbers)
    return forms, model if good else as_curves(last)


def as_curves(curve: Curve) -> Model:
    """What predicts other runs by the curves themselves."""
    return Model(curve.campaign, curve.fit, curve.smooth)


def _points(curve: Curve, at: Floats, form: Sum, si: float) -> Floats:
    """Points of a table for a formula, in ``si``; ``at`` (n,) where they follow it."""
    edges = [one.shape.value / si for one in form.atoms if one.shape and not one.shape.ratio]

    def values(x: Floats) -> Floats:
        return sum((c * atom.of(x * si) for c, atom in zip(form.start, form.atoms, strict=True)), np.zeros(len(x)))

    return formula_points(curve.state, at, values, edges)
