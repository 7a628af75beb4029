"""A term at a plausible strength: for tables and tests of what each does."""

from __future__ import annotations

import math

from straw.model.parameters import StrawParameters
from straw.model.term import Constant, Term


def typical(constant: Constant) -> float:
    """A plausible value of a strength: the middle of its range on a log scale, a quarter of its top with no bottom."""
    return math.sqrt(constant.low * constant.high) if constant.low > 0 else constant.high / 4


def with_typical(straw: StrawParameters, term: Term) -> StrawParameters:
    """The straw with a term's strengths at plausible values; a spread makes the fourth cell weaker."""
    strengths = {c.name: typical(c) for c in term.constants if c.name in term.strengths}
    if term.name == "frustum_spread":
        fourth = [0.0] * straw.cells
        fourth[min(3, straw.cells - 1)] = -0.08
        return straw.with_term(term.name, E_relative=fourth)
    return straw.with_term(term.name, **strengths)
