"""The missing force where no hypothesis explains the runs: a curve over the state that explains most, and a formula.

The curve is a table of values, fitted beside the base's constants with a roughness penalty. All states are tried; a
curve that explains nothing is reported as such.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, evaluated, fitted
from straw.replay.diagnose.formula import Formula, formula, tangent
from straw.replay.diagnose.inquiry import Told, silent
from straw.replay.diagnose.judge import unexplained
from straw.replay.diagnose.refine import refined
from straw.replay.diagnose.robust import weights
from straw.replay.diagnose.settings import COARSE_ROUNDS, NOISE_LEAVES, ROUNDS
from straw.replay.diagnose.systems.straw.base import telling_runs
from straw.replay.diagnose.systems.straw.constants import applied
from straw.replay.diagnose.systems.straw.dictionary import atoms
from straw.replay.diagnose.systems.straw.discovered import discovered
from straw.replay.diagnose.systems.straw.of import straw_of, with_straw
from straw.replay.diagnose.systems.straw.simulated import simulated
from straw.replay.diagnose.systems.straw.states import STATES, State, bent_points, points

Floats = NDArray[np.float64]

#: Prior deviation of a curve's point from the line between its neighbours, in units of the state.
ROUGH = 1.5
#: States that are fitted, that are carried to the end; rounds of the first fit.
FITTED, FINISHED, FIRST_ROUNDS = 4, 2, 8


#: How often the points of a curve are moved to where it bends.
MOVES = 2
#: Steps of the search to the size of force that the first slopes predict, and its limit in units.
STEPS, LARGEST = 3.0, 1000.0
#: Another state is a rival while its first fit costs less than this many times the best's.
RIVAL = 1.5
#: A curve that explains less than this share of the base's misfit counts as explaining nothing.
TELLS = 0.5
#: Constants of the base that are taken from its fit; elasticity and geometry start as given.
TAKEN_ALONG = ("straw.r_ch_m", "straw.c_zeta_n_s_per_m", "straw.c_phi_n_m_s_per_rad")


@dataclass(frozen=True, eq=False)
class Curve:
    """A state's curve fitted beside the base's constants; ``campaign`` holds the straw with the curve's points.

    ``smooth`` (k, unknowns) are the rows of the roughness penalty, by u.
    """

    state: State
    campaign: Campaign
    smooth: Floats
    fit: Fit
    placed: Floats  # (n,) points of the table as first placed, as it counts them
    points: Floats  # (n,) and as moved to where the curve bends

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which of the points are searched, not held at zero, (n,)."""
        return ~((self.points == 0) & self.state.zero)

    @property
    def at(self) -> Floats:
        """The points that are searched."""
        return self.points[self.free]


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
    """A state's curve at zero, beside the base's fit: the cost predicted by its slopes."""

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
    explains: float  # share of the base's misfit that the curve explains
    others: tuple[tuple[str, float], ...]  # shares that curves over other states explain

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

    @property
    def place(self) -> str:
        """What it acts on, by the name of the term or the instrument's curve."""
        return self.curve.state.values.split(".")[1]

    def discovered(self, cells: Sequence[int]) -> dict[str, Any]:
        """The same in the contract's words, with a law file."""
        return discovered(self, cells)

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
    fit, rough = best.fit, best.smooth[:, base:]
    seen, at = tangent(fit, base, rough), best.at * state.scale(straw_of(campaign))
    sigmas = np.sqrt(np.diag(np.linalg.inv(seen.H + seen.smooth)))
    law = None
    if shares[0] >= TELLS:
        told("formula", 1, 1)
        chosen, coefficients, errors, keeps = formula(best.campaign, fit, base, rough, at, atoms(state, at), null.cost)
        units = tuple(_unit(state, atom.power) for atom in chosen)
        law = Formula(f"{state.value_symbol}({state.symbol})", chosen, coefficients, errors, units, keeps)
    return Missing(
        best,
        at,
        seen.values,
        sigmas,
        np.abs(seen.values) * np.sqrt(np.maximum(np.diag(seen.H), 0.0)),
        law,
        shares[0],
        tuple((c.state.name, share) for c, share in zip(found[1:], shares[1:], strict=True)),
    )


def _unit(state: State, power: float) -> str:
    """Unit of a coefficient of the state to a power."""
    if power == 0:
        return state.value_unit
    per = f"({state.state_unit})" if "/" in state.state_unit else state.state_unit
    return f"{state.value_unit}/{per}" + (f"^{power:g}" if power != 1 else "")


def curves(campaign: Campaign, null: Fit, told: Told = silent, states: Sequence[State] = STATES) -> list[Curve]:
    """Curves over the states that promise most, the best first; the best few are carried to their end."""
    wide = campaign.only(telling_runs(campaign, null)).coarse()
    # the missing force has biased the base's constants: only damping and channel are kept
    calm = np.where([k.target in TAKEN_ALONG for k in null.unknowns], null.u, 0.0)
    known = evaluated(wide, null.unknowns, calm)
    starts: list[_Start] = []
    for start in _starts(wide, known, campaign.observations, told, states):
        starts.append(start)
        if campaign.stop():
            return []
    starts.sort(key=lambda start: start.promise)
    first = []
    for k, start in enumerate(starts[:FITTED]):
        told(start.curve.state.name, len(states) + k, len(states) + 2 * FITTED)
        first.append(_carried_on(start.curve, start.curve.campaign, FIRST_ROUNDS, 0.01))
    first.sort(key=lambda c: c.fit.cost)
    found: list[Curve] = []
    for k, curve in enumerate(first):
        told(curve.state.name, len(states) + FITTED + k, len(states) + 2 * FITTED)
        here = campaign.with_system(curve.campaign.system)
        rival = len(found) < FINISHED and curve.fit.cost < RIVAL * first[0].fit.cost
        found.append(_finished(curve, campaign, wide) if rival else _carried_on(curve, here, 0))
    return sorted(found, key=lambda c: c.fit.cost)


def _bent(curve: Curve, campaign: Campaign) -> Curve:
    """The curve on points that lie closer where it bends (`bent_points`), to be fitted again."""
    state, fit, base = curve.state, curve.fit, curve.smooth.shape[1] - len(curve.at)
    values = np.zeros(len(curve.points))
    values[curve.free] = fit.u[base:]
    at = bent_points(state, curve.placed, curve.points, values)
    free = ~((at == 0) & state.zero)
    here = with_straw(campaign, state.straw_with(straw_of(campaign), at))
    rows = rows_for(state, at, free)
    smooth = np.hstack([np.zeros((len(rows), base)), rows])
    scale = fit.unknowns[-1].scale
    unknowns = (*fit.unknowns[:base], *(replace(k, scale=scale) for k in state.unknowns(at)))
    where, known = (np.append(0.0, x) if state.odd else x for x in (curve.points, values))
    u = np.concatenate([fit.u[:base], np.interp(at, where, known)[free]])
    return replace(curve, campaign=here, smooth=smooth, points=at, fit=replace(fit, unknowns=unknowns, u=u))


def _carried_on(curve: Curve, campaign: Campaign, rounds: int, share: float = 1e-4) -> Curve:
    """The curve's fit continued, perhaps on other runs; with no rounds only evaluated there."""
    fit, smooth = curve.fit, curve.smooth
    fit = fitted(campaign, fit.unknowns, fit.u, rounds=rounds, share=share, smooth=smooth)
    return replace(curve, campaign=campaign, fit=fit)


def _finished(curve: Curve, campaign: Campaign, wide: Campaign) -> Curve:
    """The curve with its points moved to where it bends, fitted coarsely to all runs, then to all samples from several
    starts, as a cause of the library is."""
    for _ in range(MOVES):
        other = _bent(curve, wide)
        other = _carried_on(other, other.campaign, FIRST_ROUNDS, 0.01)
        if other.fit.cost > curve.fit.cost:
            break
        curve = other
    here = campaign.with_system(curve.campaign.system)
    coarse = _carried_on(curve, here.coarse(), COARSE_ROUNDS[-1]).fit
    return replace(curve, campaign=here, fit=refined(here, coarse, ROUNDS, curve.smooth))


def _starts(
    campaign: Campaign, null: Fit, observations: Sequence[Any], told: Told, states: Sequence[State]
) -> Iterator[_Start]:
    """Every state's curve at zero with its slopes; its points lie where all observations pass."""
    base = null.unknowns
    straw, _ = applied(straw_of(campaign), base, null.u)
    seen = [(o, simulated(o, straw_of(campaign), base, null.u).prediction) for o in observations]
    for k, state in enumerate(states):
        told(state.name, k, len(states) + 2 * FITTED)
        at = points(state, [state.visited(straw, o, p) for o, p in seen])
        if at is None:
            continue
        free = ~((at == 0) & state.zero)
        here = with_straw(campaign, state.straw_with(straw_of(campaign), at))
        rows = rows_for(state, at, free)
        smooth = np.hstack([np.zeros((len(rows), len(base))), rows])
        unknowns = (*base, *state.unknowns(at))
        u = np.concatenate([null.u, np.zeros(len(unknowns) - len(base))])
        fit = evaluated(here, unknowns, u, smooth)
        unit, wanted = unknowns[-1].scale, -_downhill(fit, smooth)[0][len(base) :]
        # in units of the predicted size a large force is as near as a small one
        larger = float(np.clip(np.max(np.abs(wanted)) / STEPS, 1.0, LARGEST))
        slopes = fit.slopes.copy()
        slopes[:, len(base) :] *= larger
        unknowns = (*base, *(replace(k, scale=unit * larger) for k in unknowns[len(base) :]))
        fit = replace(fit, unknowns=unknowns, slopes=slopes)
        yield _Start(Curve(state, here, smooth, fit, at, at), fit.cost - _downhill(fit, smooth)[1])


def _downhill(fit: Fit, smooth: Floats) -> tuple[Floats, float]:
    """Minus the step to the optimum of the linearised problem, and its gain."""
    w = weights(fit.residual)
    sd, mean = np.array([k.sd for k in fit.unknowns]), np.array([k.mean for k in fit.unknowns])
    curvature = (fit.slopes * w[:, None]).T @ fit.slopes + np.diag(1 / sd**2) + smooth.T @ smooth
    gradient = fit.slopes.T @ (w * fit.residual) + (fit.u - mean) / sd**2 + smooth.T @ (smooth @ fit.u)
    step = np.linalg.solve(curvature, gradient)
    return step, float(gradient @ step)
