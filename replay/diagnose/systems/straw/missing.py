"""The missing force where no hypothesis explains the runs: the curve over a state that explains most, and a formula.

A curve that explains nothing is reported as such.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.formed import Model
from straw.replay.diagnose.formula import Formula
from straw.replay.diagnose.formula_fit import Written
from straw.replay.diagnose.inquiry import Told, silent
from straw.replay.diagnose.judge import unexplained
from straw.replay.diagnose.settings import NOISE_LEAVES
from straw.replay.diagnose.sparse import deviations_of, tangent
from straw.replay.diagnose.systems.straw.curve import Curve
from straw.replay.diagnose.systems.straw.curves import beside, curves
from straw.replay.diagnose.systems.straw.discovered import discovered
from straw.replay.diagnose.systems.straw.formulas import as_curves, tabulated, with_formula, written
from straw.replay.diagnose.systems.straw.of import straw_of, with_straw
from straw.replay.diagnose.systems.straw.states import STATES, State

Floats = NDArray[np.float64]

#: A curve that explains less than this share of the base's misfit counts as explaining nothing; a second one has to
#: explain this share of what the first leaves.
TELLS = 0.5


@dataclass(frozen=True, eq=False)
class MissingLaw:
    """One curve over a state; the formula is None where hardly anything is explained."""

    state: State
    at: Floats  # (n,) SI
    values: Floats  # (n,) SI
    sigmas: Floats  # (n,) one deviation, the base's constants free
    matters: Floats  # (n,) sigmas by which the runs would miss each point's value
    formula: Formula | None
    further: tuple[tuple[str, float, float], ...] = ()  # symbol, value, deviation of the state's further constants

    @property
    def noun(self) -> str:
        """What it is, without numbers; one whose formula is a number alone depends on nothing."""
        if self.formula is None or any(atom.text for atom in self.formula.atoms):
            return self.state.says
        return "a constant " + self.state.says.partition(" that ")[0].partition(" ")[2]

    @property
    def says(self) -> str:
        """As a noun, with its value where it matters most."""
        s, k = self.state, int(np.argmax(self.matters))
        if self.formula and self.noun != s.says:
            return f"{self.noun}: {self.formula.text}"
        where = ", ".join(f"{name} = ({1e3 * x:.3g} ± {1e3 * sigma:.1g}) mm" for name, x, sigma in self.further)
        says = f"{s.says} ({where})" if where else s.says
        return (
            f"{says}: {s.value_symbol} = {self.values[k]:.2g} ± {self.sigmas[k]:.1g} "
            f"{s.value_unit.replace('1', '')} at {s.symbol} = {self.at[k]:.3g} {s.state_unit.replace('1', '')}".rstrip()
        )

    @property
    def place(self) -> str:
        """What it acts on, by the name of the term or the instrument's curve."""
        return self.state.values.split(".")[1]

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        s = self.state
        return {
            "depends_on": s.name,
            "state": {"symbol": s.symbol, "unit": s.state_unit},
            "value": {"symbol": s.value_symbol, "unit": s.value_unit},
            "curve": [
                {"at": float(x), "value": float(v), "sigma": float(e)}
                for x, v, e in zip(self.at, self.values, self.sigmas, strict=True)
            ],
            "point": {name: {"value": x, "sigma": sigma} for name, x, sigma in self.further} or None,
            "formula": self.formula.as_json() if self.formula else None,
        }


@dataclass(frozen=True, eq=False)
class Missing:
    """What is missing: one law, or two that were fitted together, the one found first before the other."""

    curve: Curve  # the last one, with the fit
    model: Model  # by formulas where they are as good as the curves, which have more constants
    laws: tuple[MissingLaw, ...]
    explains: float  # share of the base's misfit
    others: tuple[tuple[str, float], ...]  # shares that curves over other states explain

    @property
    def tells(self) -> bool:
        """Whether it explains enough to be tried on runs held out."""
        return self.laws[0].formula is not None

    @property
    def noun(self) -> str:
        """What it is, without numbers."""
        return " and ".join(law.noun for law in self.laws)

    @property
    def says(self) -> str:
        """In one sentence."""
        takes = f"{100 * self.explains:.0f} % of what the base model leaves unexplained"
        if not self.tells:
            best = self.laws[0].noun
            return f"No force over any one state explains the runs: the best, {best}, accounts for {takes}"
        if len(self.laws) > 1:
            both = " and ".join(law.says for law in self.laws)
            return f"What is missing looks like {both}; together they account for {takes}"
        return f"What is missing looks like {self.laws[0].says}; it accounts for {takes}"

    def discovered(self, cells: Sequence[int]) -> dict[str, Any]:
        """The contract's ``discovered`` of the first law; a second one is ``beside`` it in the same words."""
        first, *second = (discovered(law, cells) for law in self.laws)
        return {**first, "beside": second}

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        first, *second = (law.as_json() for law in self.laws)
        others = [{"depends_on": name, "explains": share} for name, share in self.others]
        return {"says": self.says, **first, "explains": self.explains, "beside": second, "others": others}


def missing_force(
    campaign: Campaign, null: Fit, told: Told = silent, states: Sequence[State] = STATES
) -> list[Missing]:
    """What is missing as one curve, with band and formula, and before it as two together where the second explains most
    of what the first leaves; empty where the search was stopped.

    For six runs 65 to 366 s of CPU, up to 717 s where a second curve is sought (`tests.benchmarks.missing_force`).
    """
    campaign = _dated(campaign)
    found = curves(campaign, null, told, states)
    if campaign.stop() or not found:
        return []
    told("formula", 1, 1)
    best, form = with_formula(found[0], null)
    share = _explained(campaign, null, best.fit)
    others = tuple((c.state.name, _explained(campaign, null, c.fit)) for c in found[1:])
    if share < TELLS:
        return [Missing(best, as_curves(best), (_law(best, None),), share, others)]
    (form,), model = tabulated([best], null, [form])
    alone = Missing(best, model, (_law(best, form),), share, others)
    if share == 1:
        return [alone]
    both = beside(best, campaign, null, told, states)
    together = _explained(campaign, null, both.fit) if both else 0.0
    if not both or campaign.stop() or together < share + TELLS * (1 - share):
        return [alone]
    told("formulas", 1, 1)
    pair = _first_last(best, both), both
    forms, model = tabulated(pair, null, [written(one, null) for one in pair])
    laws = tuple(_law(*one) for one in zip(pair, forms, strict=True))
    return [Missing(both, model, laws, together, others), alone]


def _dated(campaign: Campaign) -> Campaign:
    """The campaign of a straw whose laws' time counts from the first recording, where it counts from nowhere yet."""
    straw = straw_of(campaign)
    if straw.zero_time_s:
        return campaign
    first_ns = min(cast(Any, o).run.zero_time_ns for o in campaign.observations)
    return with_straw(campaign, straw.replace(zero_time_s=1e-9 * first_ns))


def _explained(campaign: Campaign, null: Fit, fit: Fit) -> float:
    """Share of what the base leaves beyond noise that a fit explains; zero where the base leaves nothing."""
    left = unexplained(campaign, null) - NOISE_LEAVES
    rest = max(0.0, unexplained(campaign, fit) - NOISE_LEAVES)
    return max(0.0, 1 - rest / left) if left > 0 else 0.0


def _first_last(first: Curve, both: Curve) -> Curve:
    """The first of two curves in the fit of both, its unknowns moved to the end."""
    own = np.arange(len(both.fit.unknowns))
    low, high = len(own) - len(both.at) - len(first.at), len(own) - len(both.at)
    order = np.concatenate([own[:low], own[high:], own[low:high]])
    fit = both.fit
    fit = replace(fit, unknowns=tuple(fit.unknowns[k] for k in order), u=fit.u[order], slopes=fit.slopes[:, order])
    return replace(first, campaign=both.campaign, fit=fit, smooth=both.smooth[:, order])


def _law(curve: Curve, written: Written | None) -> MissingLaw:
    """A curve's values with their deviations, and its formula."""
    state, base = curve.state, len(curve.fit.unknowns) - len(curve.at)
    seen = tangent(curve.fit, base, curve.smooth)
    law = None
    if written:
        units = tuple(_unit(state, atom.power) for atom in written.atoms)
        symbol = f"{state.value_symbol}({state.symbol})"
        law = Formula(symbol, written.atoms, written.coefficients, written.deviations, units, written.keeps)
    matters = np.abs(seen.values) * np.sqrt(np.maximum(np.diag(seen.H), 0.0))
    further = _further(curve, written.model if written else as_curves(curve)) if state.further else ()
    return MissingLaw(state, curve.at * curve.scale(curve.fit), seen.values, seen.sigmas, matters, law, further)


def _further(curve: Curve, model: Model) -> tuple[tuple[str, float, float], ...]:
    """Symbol, value and deviation, SI, of the constants besides a curve's values; all others free."""
    fit, si, out = model.fit, curve.scale(curve.fit), []
    sd, targets = deviations_of(fit, model.smooth), [k.target for k in fit.unknowns]
    for symbol, one in zip(curve.state.symbols, curve.state.further, strict=True):
        k = targets.index(one.target)
        out.append((symbol, si * one.value(float(fit.u[k])), si * one.scale * float(sd[k])))
    return tuple(out)


def _unit(state: State, power: float) -> str:
    """Unit of a coefficient of the state to a power."""
    if power == 0 or state.state_unit == "1":
        return state.value_unit
    per = f"({state.state_unit})" if "/" in state.state_unit else state.state_unit
    return f"{state.value_unit}/{per}" + (f"^{power:g}" if power != 1 else "")
