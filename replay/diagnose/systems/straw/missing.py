"""The missing force where no hypothesis explains the runs: the curve over a state that explains most, and a formula.

A curve that explains nothing is reported as such.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.formula import Formula, formula, tangent
from straw.replay.diagnose.inquiry import Told, silent
from straw.replay.diagnose.judge import unexplained
from straw.replay.diagnose.settings import NOISE_LEAVES
from straw.replay.diagnose.systems.straw.curves import Curve, curves
from straw.replay.diagnose.systems.straw.dictionary import atoms
from straw.replay.diagnose.systems.straw.discovered import discovered
from straw.replay.diagnose.systems.straw.of import straw_of
from straw.replay.diagnose.systems.straw.states import STATES, State

Floats = NDArray[np.float64]

#: A curve that explains less than this share of the base's misfit counts as explaining nothing.
TELLS = 0.5


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
    left = unexplained(campaign, null) - NOISE_LEAVES
    rest = [max(0.0, unexplained(campaign, c.fit) - NOISE_LEAVES) for c in found]
    shares = [max(0.0, 1 - r / left) if left > 0 else 0.0 for r in rest]  # of nothing, nothing is explained
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
