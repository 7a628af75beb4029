"""The missing force where no hypothesis explains the runs: a curve over the state that explains most, and a formula.

The curve is a table of values, fitted beside the base's constants and charged for being rough. Over which state it
explains the runs best is tried out; what explains nothing is said to.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.contest import seen_again
from straw.replay.diagnose.dictionary import atoms
from straw.replay.diagnose.formula import Formula, formula, tangent
from straw.replay.diagnose.hypothesis import Unknown, applied
from straw.replay.diagnose.judge import NOISE_LEAVES, run_by_run, unexplained
from straw.replay.diagnose.misfit import play
from straw.replay.diagnose.observation import Observation
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.search import Fit, cost_at, descend, measured_slopes
from straw.replay.diagnose.start import few_of
from straw.replay.diagnose.states import STATES, State, points

Floats = NDArray[np.float64]

#: How far a point of a curve may be off the line between its neighbours, in units of the state, one sigma.
ROUGH = 1.5
#: States that are fitted, that are carried to the end; rounds of the first fit and of the last.
FITTED, FINISHED, FIRST_ROUNDS, ROUNDS = 4, 2, 8, 10


#: Steps of the search to a force as large as the first slopes want it, and how many units that may be.
STEPS, LARGEST = 3.0, 1000.0
#: Another state is a rival while its first fit costs less than this many times the best's.
RIVAL = 1.5
#: A curve that takes away less of the base's unexplained misfit explains nothing.
TELLS = 0.5
#: Constants of the base that are taken from its fit; elasticity and geometry start as given.
TAKEN_ALONG = ("straw.r_ch_m", "straw.c_zeta_n_s_per_m", "straw.c_phi_n_m_s_per_rad")
#: How targets of a curve's unknowns begin.
CURVES = ("term.missing_", "instrument.")


#: Said with (what is being done, steps done, steps in all).
Told = Callable[[str, int, int], None]


def silent(_what: str, _done: int, _total: int) -> None:
    """Say nothing."""


class Smooth(Campaign):
    """A campaign that charges a curve for being rough: rows beside the runs' differences."""

    rows: Floats  # (k, unknowns of the curve) by their values in units

    @classmethod
    def of(cls, campaign: Campaign, straw: StrawParameters, rows: Floats) -> Smooth:
        """The campaign with another straw and such rows; counts and what repeats differ by are shared."""
        out = cls(campaign.observations, straw, campaign.pool, campaign.stop).shares_with(campaign)
        out.rows = rows
        return out

    def only(self, names: Sequence[str]) -> Smooth:
        """The campaign with some of its runs."""
        return Smooth.of(super().only(names), self.straw, self.rows)

    def residuals(self, unknowns: Sequence[Unknown], points: Sequence[Floats]) -> list[Floats]:
        """Differences of all runs in sigmas, and how rough the curve is."""
        out = super().residuals(unknowns, points)
        n = self.rows.shape[1]
        if not unknowns[-1].target.startswith(CURVES):  # the base alone
            return [np.append(row, np.zeros(len(self.rows))) for row in out]
        curve = unknowns[-n:]
        values = [np.array([k.value(float(u)) / k.scale for k, u in zip(curve, p[-n:], strict=True)]) for p in points]
        return [np.append(row, self.rows @ v) for row, v in zip(out, values, strict=True)]


@dataclass(frozen=True, eq=False)
class Curve:
    """A state's curve fitted beside the base's constants; ``campaign`` holds the straw with the curve's points."""

    state: State
    campaign: Smooth
    fit: Fit
    at: Floats  # (n,) points that were searched, as the table counts them


def rows_for(state: State, at: Floats, free: NDArray[np.bool_]) -> Floats:
    """Each point's distance from the line between its neighbours, in ROUGH: (k, free points)."""
    where = np.concatenate([[0.0], at]) if state.odd else at
    keep = np.concatenate([[False], free]) if state.odd else free
    rows = []
    for k in range(1, len(where) - 1):
        row = np.zeros(len(where))
        share = (where[k] - where[k - 1]) / (where[k + 1] - where[k - 1])
        row[k - 1 : k + 2] = share - 1, 1.0, -share
        rows.append(row[keep] / ROUGH)
    return np.array(rows).reshape(len(rows), int(keep.sum()))


@dataclass(frozen=True, eq=False)
class _Start:
    """A state's curve at zero, beside the base's fit: the cost its slopes promise."""

    curve: Curve
    promise: float


@dataclass(frozen=True, eq=False)
class Missing:
    """What is missing, as a curve over a state; the formula is None where hardly anything is explained."""

    curve: Curve
    at: Floats  # (n,) SI
    values: Floats  # (n,) SI
    sigmas: Floats  # (n,) one deviation, the base's constants free
    matters: Floats  # (n,) sigmas by which the runs would miss each point's value
    formula: Formula | None
    explains: float  # share of the base's unexplained misfit that the curve takes away
    others: tuple[tuple[str, float], ...]  # what curves over other states take away

    @property
    def says(self) -> str:
        """In one sentence."""
        s, k = self.curve.state, int(np.argmax(self.matters))
        if self.formula is None:
            return (
                f"No force over any one state explains the runs: the best, {s.says}, takes away "
                f"{100 * self.explains:.0f} % of what the base model leaves"
            )
        return (
            f"What is missing looks like {s.says}: {s.value_symbol} = {self.values[k]:.2g} ± {self.sigmas[k]:.1g} "
            f"{s.value_unit.replace('1', '')} at {s.symbol} = {self.at[k]:.3g} {s.state_unit}; it takes away "
            f"{100 * self.explains:.0f} % of what the base model leaves"
        )

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        s = self.curve.state
        return {
            "says": self.says,
            "depends_on": s.name,
            "state": {"symbol": s.symbol, "unit": s.state_unit},
            "value": {"symbol": s.value_symbol, "unit": s.value_unit},
            "curve": [
                {"at": float(x), "value": float(v), "sigma": float(e)}
                for x, v, e in zip(self.at, self.values, self.sigmas, strict=True)
            ],
            "formula": self.formula.as_json() if self.formula else None,
            "explains": self.explains,
            "others": [{"depends_on": name, "explains": share} for name, share in self.others],
        }


def missing_force(
    campaign: Campaign, null: Fit, told: Told = silent, states: Sequence[State] = STATES
) -> Missing | None:
    """The curve that explains most beside the base's fit, with band and formula; None where the search was stopped.

    About a minute for eight runs.
    """
    found = curves(campaign, null, told, states)
    if campaign.stop() or not found:
        return None
    left = max(unexplained(campaign, null) - NOISE_LEAVES, 1.0)
    shares = [max(0.0, 1 - max(0.0, unexplained(campaign, c.fit) - NOISE_LEAVES) / left) for c in found]
    best, state, base = found[0], found[0].state, len(null.u)
    fit = best.fit
    if not fit.fresh:
        slopes = measured_slopes(best.campaign, fit.unknowns, fit.u, fit.residual, range(len(fit.u)))
        fit = replace(fit, slopes=slopes, fresh=True)
    seen, at = tangent(fit, base, best.campaign.rows), best.at * state.scale(campaign.straw)
    sigmas = np.sqrt(np.diag(np.linalg.inv(seen.H + seen.smooth)))
    law = None
    if shares[0] >= TELLS:
        told("formula", 1, 1)
        chosen, coefficients, errors, keeps = formula(
            _plain(best.campaign), fit, base, best.campaign.rows, at, atoms(state, at), null.cost
        )
        units = tuple(_unit(state, atom.power) for atom in chosen)
        law = Formula(f"{state.value_symbol}({state.symbol})", chosen, coefficients, errors, units, keeps)
    return Missing(
        replace(best, fit=fit),
        at,
        seen.values,
        sigmas,
        np.abs(seen.values) * np.sqrt(np.maximum(np.diag(seen.H), 0.0)),
        law,
        shares[0],
        tuple((c.state.name, share) for c, share in zip(found[1:], shares[1:], strict=True)),
    )


def _plain(campaign: Smooth) -> Campaign:
    """The campaign without a price on roughness."""
    return Campaign(campaign.observations, campaign.straw, campaign.pool, campaign.stop).shares_with(campaign)


def _unit(state: State, power: float) -> str:
    """Unit of a coefficient of the state to a power."""
    if power == 0:
        return state.value_unit
    per = f"({state.state_unit})" if "/" in state.state_unit else state.state_unit
    return f"{state.value_unit}/{per}" + (f"^{power:g}" if power != 1 else "")


def curves(campaign: Campaign, null: Fit, told: Told = silent, states: Sequence[State] = STATES) -> list[Curve]:
    """Curves over the states that promise most, the best first; the best few are carried to their end."""
    wide = campaign.only(few_of(campaign.observations, run_by_run(campaign, null))).roughly()
    # what is missing has dragged the base's constants away: damping and channel are taken at their word, no others
    calm = np.where([k.target in TAKEN_ALONG for k in null.unknowns], null.u, 0.0)
    known = seen_again(wide, replace(null, u=calm))
    starts: list[_Start] = []
    for start in _starts(wide, known, campaign.observations, told, states):
        starts.append(start)
        if campaign.stop():
            return []
    starts.sort(key=lambda start: start.promise)
    first = []
    for k, start in enumerate(starts[:FITTED]):
        told(start.curve.state.name, len(states) + k, len(states) + 2 * FITTED)
        here, fit = start.curve.campaign, start.curve.fit
        fit = descend(
            here, fit.unknowns, fit.u, slopes=fit.slopes, residual=fit.residual, rounds=FIRST_ROUNDS, share=0.01
        )
        first.append(replace(start.curve, fit=fit))
    first.sort(key=lambda c: c.fit.cost)
    found: list[Curve] = []
    for k, curve in enumerate(first):
        told(curve.state.name, len(states) + FITTED + k, len(states) + 2 * FITTED)
        here = Smooth.of(campaign, curve.campaign.straw, curve.campaign.rows)
        u = curve.fit.u
        rival = len(found) < FINISHED and curve.fit.cost < RIVAL * first[0].fit.cost
        if rival and not (found and campaign.leaves_out()):
            fit = descend(here, curve.fit.unknowns, u, rounds=ROUNDS, share=2e-3)
        else:
            fit = seen_again(here, curve.fit)
        found.append(replace(curve, campaign=here, fit=fit))
    return sorted(found, key=lambda c: c.fit.cost)


def _starts(
    campaign: Campaign, null: Fit, observations: Sequence[Observation], told: Told, states: Sequence[State]
) -> Iterator[_Start]:
    """Every state's curve at zero with its slopes; its points lie where all of the observations pass."""
    base = null.unknowns
    residual = campaign.residuals(base, [null.u])[0]
    slopes = measured_slopes(campaign, base, null.u, residual, range(len(base)))
    straw, instrument = applied(campaign.straw, base, null.u)
    seen = [(o, play(o, straw, instrument)[0]) for o in observations]
    for k, state in enumerate(states):
        told(state.name, k, len(states) + 2 * FITTED)
        at = points(state, [state.visited(straw, o, p) for o, p in seen])
        if at is None:
            continue
        free = ~((at == 0) & state.zero)
        here = Smooth.of(campaign, state.straw_with(campaign.straw, at), rows_for(state, at, free))
        unknowns = (*base, *state.unknowns(at))
        u = np.concatenate([null.u, np.zeros(len(unknowns) - len(base))])
        first = np.append(residual, np.zeros(len(here.rows)))
        own = measured_slopes(here, unknowns, u, first, range(len(base), len(u)))
        every = np.hstack([np.concatenate([slopes, np.zeros((len(here.rows), len(base)))]), own])
        cost = cost_at(unknowns, u, first)
        unit, wanted = unknowns[-1].scale, -_downhill(Fit(unknowns, u, first, every, cost, True))[0][len(base) :]
        # in units of what is wanted a large force is no further away than a small one
        larger = float(np.clip(np.max(np.abs(wanted)) / STEPS, 1.0, LARGEST))
        unknowns = (*base, *(replace(k, scale=unit * larger) for k in unknowns[len(base) :]))
        every[: len(residual), len(base) :] *= larger
        fit = Fit(unknowns, u, first, every, cost, True)
        yield _Start(Curve(state, here, fit, at[free]), cost - _downhill(fit)[1])


def _downhill(fit: Fit) -> tuple[Floats, float]:
    """Minus the step that would end the search were everything linear, and what it would gain."""
    w = weights(fit.residual)
    sd, mean = np.array([k.sd for k in fit.unknowns]), np.array([k.mean for k in fit.unknowns])
    curvature = (fit.slopes * w[:, None]).T @ fit.slopes + np.diag(1 / sd**2)
    gradient = fit.slopes.T @ (w * fit.residual) + (fit.u - mean) / sd**2
    step = np.linalg.solve(curvature, gradient)
    return step, float(gradient @ step)
