"""The missing law in the contract's words: place, state, formula, curve, and a law file to edit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from straw.replay.diagnose.systems.straw.missing import MissingLaw

#: Place and state of each curve of `straw.replay.diagnose.systems.straw.states`.
PLACES = {
    "height": ("frustum_force", "height"),
    "angle": ("frustum_moment", "angle"),
    "speed": ("frustum_force", "height_rate"),
    "damping over height": ("constant:c_zeta_n_s_per_m", "height"),
    "cycles: stiffness": ("constant:E_pa", "cycle"),
    "time: stiffness": ("constant:E_pa", "time"),
    "pressure: stiffness": ("constant:E_pa", "pressure"),
    "cycles: force": ("frustum_force", "cycle"),
    "tip X, along X": ("tip_force", "tip_x"),
    "tip X, along Z": ("tip_force", "tip_x"),
    "tip Z, along Z": ("tip_force", "tip_z"),
    "tip distance": ("tip_force", "tip_x", "tip_z"),
    "tip angle": ("tip_moment", "angle"),
    "tip speed": ("tip_force", "tip_rate"),
    "flow": ("flow", "flow"),
    "leak": ("flow", "pressure"),
    "cycles: channel": ("flow", "cycle"),
    "gauge over pressure": ("instrument:pressure", "pressure"),
    "gauge over time": ("instrument:pressure", "time"),
    "gauge over direction": ("instrument:pressure", "history"),
    "clock over time": ("instrument:clock", "time"),
    "camera X over X": ("instrument:x", "tip_x"),
    "camera Z over X": ("instrument:z", "tip_x"),
    "camera roll over X": ("instrument:phi", "tip_x"),
    "camera X over time": ("instrument:x", "time"),
    "camera Z over time": ("instrument:z", "time"),
    "camera roll over time": ("instrument:phi", "time"),
    "board over time": ("instrument:board", "time"),
}
#: A frustum's law from its state x and the formula f(x): state, force and moment, whether it stores energy.
FRUSTUM_LAWS = {
    "height": ("f.zeta", "value, 0.0", True),
    "angle": ("f.phi", "0.0, value", True),
    "speed": ("abs(f.d_zeta)", "-math.copysign(value, f.d_zeta), 0.0", False),
    "damping over height": ("f.zeta", "-value * f.d_zeta, 0.0", False),
}


def discovered(law: MissingLaw, cells: Sequence[int]) -> dict[str, Any]:
    """The contract's ``discovered`` of a curve that made the runs held out better; ``cells`` that moved."""
    assert law.formula is not None
    state = law.state
    place, *over = PLACES[state.name]
    return {
        "place": place,
        "cells": list(cells) if place.startswith(("frustum", "constant:c_zeta", "constant:E")) else [],
        "states": over,
        "formula": law.formula.text,
        "unit": state.value_unit,
        "curve": [list(map(float, row)) for row in zip(law.at, law.values, law.sigmas, strict=True)],
        "law": law_file(law),
    }


def law_file(law: MissingLaw) -> str:
    """Text of a law file for `--laws`; empty where the place takes no user's law (the table is in the straw)."""
    state, formula = law.state, law.formula
    if formula is None or state.name not in FRUSTUM_LAWS or not all(atom.code for atom in formula.atoms):
        return ""
    x, acts, stored = FRUSTUM_LAWS[state.name]
    rows = list(zip(formula.atoms, formula.coefficients, formula.sigmas, formula.units, strict=True))
    constants = "".join(
        CONSTANT.format(
            n=n,
            unit=unit,
            low=min(c / 5, 5 * c),
            high=max(c / 5, 5 * c),
            about=f"found {c:.5g} +- {sigma:.2g}; times {atom.text or '1'}",
        )
        for n, (atom, c, sigma, unit) in enumerate(rows, 1)
    )
    total = " + ".join(f"k[{n}] * ({atom.code})" for n, (atom, *_) in enumerate(rows))
    names = ", ".join(f'"a{n}"' for n in range(1, len(rows) + 1))
    energy = ENERGY.format(x=x, total=total) if stored else ""
    return LAW.format(
        says=law.noun[0].upper() + law.noun[1:],
        formula=formula.text,
        x=x,
        total=total,
        acts=acts,
        energy=energy,
        names=names,
        constants=constants,
        stored="\n    energy=energy," if stored else "",
    )


CONSTANT = """        straw.Constant("a{n}", "{unit}", 0.0, {low:.4g}, {high:.4g}, "{about}"),
"""

ENERGY = '''

def energy(f, k):
    """Minus the work of the force from the unloaded middle on, by the midpoint rule, J."""
    if f.zeta0 > 0:
        return 0.0
    width, work = {x} / 400, 0.0
    for n in range(400):
        x = (n + 0.5) * width
        work += {total}
    return -work * width
'''

LAW = '''"""{says}, as `straw diagnose` found it. Edit it, then `straw check` it.

{formula}
"""

import math

import straw


def force(f, k):
    """N on the frustum's height, N m on its angle."""
    if f.zeta0 > 0:  # even frusta only
        return 0.0, 0.0
    x = {x}
    value = {total}
    return {acts}

{energy}
LAW = straw.Law(
    name="discovered",
    law="{formula}",
    source="straw diagnose",
    strengths=({names},),
    constants=(
{constants}    ),
    force=force,{stored}
)
'''
