"""Training specimens: nominal straws, deviations of a specimen, and causes of up to ten times the plausible size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.model.parameters import StrawParameters
from straw.model.terms import TERMS
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.systems.straw.constants import MEASUREMENT, REPEATS, REPEATS_MOUNT, base_unknowns
from straw.replay.diagnose.systems.straw.library import causes

Floats = NDArray[np.float64]

#: Least and largest strength of a cause, in units of the library (one is well seen), and over its plausible range.
LEAST_UNITS, MOST_UNITS, BEYOND_PLAUSIBLE = 1 / 3, 10.0, 2.0
#: Faults of a recording can be larger: a marker taken 9 mm beside the tip is one.
MOST_UNITS_OF_FAULTS = 30.0
#: Shares of specimens with one, two, ... physical causes; faults of the recording are added later, see `recorded`.
HOW_MANY = (0.25, 0.47, 0.28)
#: Deviation of a specimen's constants from the nominal: r_ch, c_zeta, c_phi as logarithms, the rest in deviations of
#: the library's prior.
DAMPING, CHANNEL, NEAR = 1.6, 0.25, 1.0
#: Factors by which it is smaller where they have been fitted already, each with its share of the groups.
FITTED = ((1.0, 0.4), (0.3, 0.35), (0.08, 0.25))
#: Constants given with the recordings (../shared/recordings), and the range of the logarithm of others over them.
GIVEN = {"r_ch_m": 0.40e-3, "c_zeta_n_s_per_m": 20.0, "c_phi_n_m_s_per_rad": 2e-3}
#: The paper's lie at -0.24 to 0.07, -5.3 to 3.4 and -1.05 to 0.41; the least axial damping is left out.
VARIES = {"r_ch_m": (-0.3, 0.3), "c_zeta_n_s_per_m": (-1.2, 3.5), "c_phi_n_m_s_per_rad": (-1.2, 1.2)}
#: Deviation of fitted elasticity and geometry from the paper's.
FITTED_DIFFER = 0.02
#: Deviation of cells of one specimen from each other, in E: too small to be called a spread.
CELLS_DIFFER = 3e-3


def nominal(rng: np.random.Generator) -> StrawParameters:
    """A random straw file: damping and channel as given with the recordings in half of all, elasticity and geometry as
    in the paper in half, else some percent off, as of a straw that has been fitted."""
    given = GIVEN
    if rng.random() < 0.5:
        given = {name: value * float(np.exp(rng.uniform(*VARIES[name]))) for name, value in GIVEN.items()}
    straw = StrawParameters().replace(**given)
    if rng.random() < 0.5:
        return straw
    young, thick, odd, even = np.exp(FITTED_DIFFER * np.clip(rng.normal(size=4), -2, 2))
    return straw.replace(E_pa=straw.E_pa * young, h_m=straw.h_m * thick, zeta0_m=straw.zeta0_m * np.array([odd, even]))


def nearness(rng: np.random.Generator) -> tuple[float, float]:
    """Spread of the specimens of a group about the nominal, in damping and channel and in the rest: 1 for straws that
    have not been fitted."""
    factors, shares = zip(*FITTED, strict=True)
    damping, rest = rng.choice(factors, 2, p=shares)
    return float(damping), float(rest)


def base_by_chance(rng: np.random.Generator, straw: StrawParameters, near: tuple[float, float]) -> Floats:
    """u of the base's constants (base unknowns,)."""
    out = []
    for unknown in base_unknowns(straw):
        if np.isfinite(unknown.high):  # elasticity and geometry
            u = rng.normal(0.0, NEAR * near[1] * unknown.sd)
        else:
            u = near[0] * rng.uniform(-1, 1) * (CHANNEL if "r_ch" in unknown.target else DAMPING) / unknown.scale
        out.append(float(np.clip(u, unknown.low, unknown.high)))
    return np.array(out)


def physics(cells: int) -> list[str]:
    """Names of the library's causes that act in the straw or in its line."""
    return [name for name in causes(cells) if name not in MEASUREMENT]


def causes_by_chance(rng: np.random.Generator, cells: int) -> dict[str, Floats]:
    """No, one or two physical causes, each with u of its unknowns."""
    names = rng.choice(physics(cells), rng.choice(len(HOW_MANY), p=HOW_MANY), replace=False)
    return {str(name): sized(rng, causes(cells)[str(name)][0]) for name in names}


def fault_by_chance(rng: np.random.Generator, cells: int, name: str) -> Floats:
    """u of one fault of the recording."""
    return sized(rng, causes(cells)[name][0])


def sized(rng: np.random.Generator, unknowns: Sequence[Unknown]) -> Floats:
    """Random u (unknowns,) of a cause: strengths over orders of magnitude, shapes by their priors."""
    strengths = [k for k, one in enumerate(unknowns) if one.kind == "strength"]
    if len({unknowns[k].target.rsplit(".", 1)[0] for k in strengths}) == 1 and len(strengths) > 3:
        return _by_cell(rng, unknowns)  # one strength in every cell
    there = set(strengths) if len(strengths) < 2 else {k for k in strengths if rng.random() < 0.65}
    if strengths and not there:
        there = {int(rng.choice(strengths))}
    return np.array([_strength(rng, one) if k in there else _shape(rng, one) for k, one in enumerate(unknowns)])


def _by_cell(rng: np.random.Generator, unknowns: Sequence[Unknown]) -> Floats:
    """One cell weaker or stronger, two, or all."""
    units = np.zeros(len(unknowns))
    how = rng.choice(3, p=[0.5, 0.2, 0.3])
    size = np.exp(rng.uniform(np.log(LEAST_UNITS), np.log(MOST_UNITS)))
    if how < 2:
        units[rng.choice(len(units), how + 1, replace=False)] = size * rng.choice([-1, 1], how + 1, p=[0.7, 0.3])
    else:
        units = 0.5 * size * rng.normal(size=len(units))
    return np.array([np.clip(one.at(x), one.low, one.high) for one, x in zip(unknowns, units, strict=True)])


def _strength(rng: np.random.Generator, unknown: Unknown) -> float:
    units = np.exp(rng.uniform(np.log(LEAST_UNITS), np.log(most_units(unknown))))
    sign = float(rng.choice([-1.0, 1.0])) if unknown.low < 0 else 1.0
    return float(np.clip(unknown.at(sign * units), unknown.low, unknown.high))


def most_units(unknown: Unknown) -> float:
    """Largest strength in training, in the library's units."""
    kind, _, name = unknown.target.partition(".")
    if kind != "term":
        return MOST_UNITS_OF_FAULTS
    term, constant = name.split("&")[0].split(".")[:2]
    high = next((c.high for c in TERMS[term].constants if c.name == constant), 0.0)
    return max(MOST_UNITS, BEYOND_PLAUSIBLE * high / unknown.scale)


def _shape(rng: np.random.Generator, unknown: Unknown) -> float:
    """A constant of a law's form by its prior; zero for a strength."""
    if unknown.kind == "strength":
        return 0.0
    usual = unknown.kind == "linear" and rng.random() < 0.3
    return float(np.clip(unknown.mean if usual else rng.normal(unknown.mean, unknown.sd), unknown.low, unknown.high))


def cells_differ(rng: np.random.Generator, straw: StrawParameters) -> StrawParameters:
    """The straw with unlike cells, as of one specimen, in a quarter of all."""
    if rng.random() < 0.75:
        return straw
    differs = CELLS_DIFFER * np.clip(rng.normal(size=straw.cells), -2, 2)
    known = np.asarray(straw.terms.get("frustum_spread", {}).get("E_relative", np.zeros(straw.cells)))
    return straw.with_term("frustum_spread", E_relative=(known + differs).tolist())


def another_time(rng: np.random.Generator, straw: StrawParameters) -> StrawParameters:
    """The straw in one of its runs: repeats differ by wear, temperature and mounting."""
    young, axial, bending, angle = rng.normal(size=4)
    return straw.replace(
        E_pa=straw.E_pa * (1 + REPEATS["straw.E_pa"] * young),
        c_zeta_n_s_per_m=straw.c_zeta_n_s_per_m * (1 + REPEATS["straw.c_zeta_n_s_per_m"] * axial),
        c_phi_n_m_s_per_rad=straw.c_phi_n_m_s_per_rad * (1 + REPEATS["straw.c_phi_n_m_s_per_rad"] * bending),
        phi_0_rad=straw.phi_0_rad + REPEATS_MOUNT.scale * angle,
    )
