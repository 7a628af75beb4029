"""The straw's constants as unknowns, and how unknowns are set into a straw and an instrument.

A target is ``straw.NAME``, ``term.TERM.NAME[.WHERE]`` (several terms joined by &; a cell, or a profile `along` the
straw), ``instrument.NAME`` or ``form``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.systems.straw.instrument import Instrument

Floats = NDArray[np.float64]

#: Causes that are faults of a recording.
MEASUREMENT = (
    "clock_offset",
    "clock_drift",
    "length_scale",
    "camera_roll",
    "tip_offset",
    "gauge_offset",
    "gauge_gain",
)

#: Bound of a specimen's elasticity and geometry about the given ones, in deviations of their prior: with the prior
#: alone, a tenth less of E with a tenth more of h would compensate for missing laws.
NEAR_SD = 2.5


def base_unknowns(straw: StrawParameters) -> tuple[Unknown, ...]:
    """The base model's own constants: damping and channel wide, elasticity and geometry within a few percent."""

    def even(name: str) -> float:
        value = np.asarray(getattr(straw, name), dtype=np.float64)
        return float(value[..., -1].mean()) if value.ndim else float(value)

    def near(name: str, scale: float, sd: float) -> Unknown:
        """Elasticity or geometry as a factor, within a few percent."""
        most = NEAR_SD * sd
        return Unknown(f"straw.{name}", scale, 1.0, "log", sd=sd, low=-most, high=most)

    return (
        Unknown("straw.r_ch_m", 0.1, even("r_ch_m"), "log", sd=2.0),
        Unknown("straw.c_zeta_n_s_per_m", 1.0, even("c_zeta_n_s_per_m"), "log", sd=2.0),
        Unknown("straw.c_phi_n_m_s_per_rad", 1.0, even("c_phi_n_m_s_per_rad"), "log", sd=2.0),
        near("E_pa", 0.02, 1.5),
        near("h_m", 0.02, 1.0),
        near("zeta01", 0.01, 1.5),
        near("zeta02", 0.01, 1.5),
    )


#: Differences between runs of one straw, one standard deviation as a step in u: wear and temperature in E and
#: damping. A larger one would absorb effects, a smaller one would take the difference of two repeats for physics.
REPEATS = {"straw.E_pa": 1.5e-3, "straw.c_zeta_n_s_per_m": 0.03, "straw.c_phi_n_m_s_per_rad": 0.03}
#: The same of the mounting's angle, rad.
REPEATS_MOUNT = Unknown("straw.mount_rad", 2e-4, kind="linear")

#: Terms of differences between cells: what all cells have in common is the base's elasticity, which has a prior.
SPREADS = ("frustum_spread",)


def repeat_steps(unknowns: Sequence[Unknown]) -> dict[int, float]:
    """One standard deviation between repeats as a step in u, by the index of each unknown that varies."""
    return {k: REPEATS[one.target] / one.scale for k, one in enumerate(unknowns) if one.target in REPEATS}


def along(where: str, cells: int) -> Floats:
    """Profile of a constant over the cells, (cells,): one cell by its number, or linear from -1 at the base to 1 at the
    tip (``tilt``), or quadratic (``bow``); neither of these two changes the mean of a long straw.
    """
    u = np.linspace(-1.0, 1.0, cells)
    if where == "tilt":
        return u
    return 1.5 * u**2 - 0.5 if where == "bow" else np.eye(cells)[int(where) - 1]


def applied(straw: StrawParameters, unknowns: Sequence[Unknown], at: Floats) -> tuple[StrawParameters, Instrument]:
    """The straw and instrument with the unknowns set to u (unknowns,)."""
    changes: dict[str, object] = {}
    terms: dict[str, dict[str, Any]] = {}
    for unknown, u in zip(unknowns, at, strict=True):
        kind, _, name = unknown.target.partition(".")
        value = unknown.value(float(u))
        if kind == "instrument":
            continue
        if kind == "form":
            changes["form"] = "full"
        elif kind == "term":
            term, constant, *where = name.split(".")
            for one in term.split("&"):
                constants = terms.setdefault(one, {})
                known = constants.get(constant, 0.0)
                constants[constant] = known + value * along(where[0], straw.cells) if where else value
        elif name in ("zeta01", "zeta02"):
            zeta = np.array(changes.get("zeta0_m", straw.zeta0_m))
            zeta[:, int(name == "zeta02")] *= value
            changes["zeta0_m"] = zeta
        elif name == "mount_rad":
            changes["phi_0_rad"] = straw.phi_0_rad + value
        elif name in ("E_pa", "odd_E", "h_m"):
            name, which = ("E_pa", [value, 1.0]) if name == "odd_E" else (name, [value, value])
            changes[name] = np.asarray(changes.get(name, getattr(straw, name))) * np.array(which)
        else:
            changes[name] = value
    for constants in (terms[one] for one in SPREADS if one in terms):
        for constant, values in constants.items():
            constants[constant] = values - np.mean(values)
    if terms:
        changes["terms"] = {**straw.terms, **{t: {**straw.terms.get(t, {}), **more} for t, more in terms.items()}}
    return straw.replace(**changes) if changes else straw, instrument_at(unknowns, at)


def instrument_at(unknowns: Sequence[Unknown], at: Floats) -> Instrument:
    """The instrument with the unknowns set to u (unknowns,)."""
    parts = ((unknown.target.partition("."), unknown.value(float(u))) for unknown, u in zip(unknowns, at, strict=True))
    return Instrument.of({name: value for (kind, _, name), value in parts if kind == "instrument"})


def walls_known(straw: StrawParameters) -> bool:
    """Whether there is a finite-element table near the straw's geometry, within the bounds of the base's constants."""
    near = [one for one in base_unknowns(straw) if np.isfinite(one.low)]
    try:
        for ends in ([one.low for one in near], [one.high for one in near]):
            applied(straw.with_term("wall_elasticity", share=1.0), near, np.array(ends))
    except ModelError:
        return False
    return True
