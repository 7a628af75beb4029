"""The library: every cause of the contract as unknowns with priors and starts."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from straw.model.term import Law
from straw.model.terms import CAUSES
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown, in_order
from straw.replay.diagnose.systems.straw.constants import MEASUREMENT

#: Distance of a cause's starting sizes, in units of u.
NEXT_SIZE = 0.6
#: Smallest starting size of a law without starts of its own, in its units: as for most of those below.
LEAST = 0.3
#: The largest, as u: a step before the bound.
MOST = 7.4
#: A share of the finite elements' walls that is well seen: heights at rest differ by 60 um a cell at a share of one.
WALL_SHARE = 0.1


def _positive(target: str, scale: float) -> Unknown:
    return Unknown(target, scale, low=0.0, high=8.0, sd=10.0)


def _signed(target: str, scale: float, sd: float = 10.0) -> Unknown:
    return Unknown(target, scale, sd=sd, low=-8.0, high=8.0)


def _shape(target: str, start: float, low: float, high: float) -> Unknown:
    return Unknown(target, 1.0, start, "log", low=np.log(low / start), high=np.log(high / start), sd=1.0)


def _walls_at_most() -> float:
    """u of the top of the share's range: far beyond either of the two energies no wall is possible."""
    return float(np.arcsinh(CAUSES["wall_elasticity"].constants[0].high / WALL_SHARE))


def _sizes(least: float, most: float) -> tuple[float, ...]:
    """Sizes of a cause so close that the base's constants can follow from one to the next: each shifts every snap, and
    fits worse than its absence until they have."""
    steps = int(np.ceil((np.arcsinh(most) - np.arcsinh(least)) / NEXT_SIZE))
    return tuple(float(np.sinh(u)) for u in np.linspace(np.arcsinh(least), np.arcsinh(most), steps + 1))


def _one_weak(cells: int, units: float) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(-units if c == n else 0.0 for c in range(cells)) for n in range(cells))


def _weak_beside_strong(cells: int, units: float) -> tuple[tuple[float, ...], ...]:
    """Starts for every pair of cells: no descent changes which of two snaps first, as every path there leads uphill."""
    return tuple(
        tuple(units * ((c == strong) - (c == weak)) for c in range(cells))
        for weak, strong in itertools.permutations(range(cells), 2)
    )


def causes(cells: int) -> dict[str, tuple[tuple[Unknown, ...], tuple[tuple[float, ...], ...]]]:
    """Unknowns and starts, small effects first, of every single cause of the contract; one unit is well seen."""
    t = "term."
    out: dict[str, tuple[tuple[Unknown, ...], tuple[tuple[float, ...], ...]]] = {
        "cohesion": (
            (
                _positive(t + "cohesion.force_n", 1.0),
                _shape(t + "cohesion.range_m", 0.3e-3, 0.03e-3, 2e-3),
                Unknown(t + "cohesion.weakening", 0.2, kind="linear", low=-1.0, high=10.0, mean=1.0, sd=2.0),
                Unknown(t + "cohesion.peak_m", 0.1e-3, kind="linear", low=0.0, high=10.0, sd=2.0),
                Unknown(t + "cohesion.slows", 1.0, kind="linear", low=0.0, high=4.0),
                _shape(t + "cohesion.rises", 1.0, 0.05, 1.5),
            ),
            (
                *((size, 0.0, 1.0, 0.0, 0.0, 0.0) for size in _sizes(0.3, 6.0)),
                (1.0, -1.0, 1.0, 0.0, 0.0, 0.0),
                (1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
                (2.0, 0.0, 1.0, 0.5, 0.0, -1.5),
            ),
        ),
        "crease_stiffness": (
            (
                _positive(t + "crease_stiffness.zeta_n_per_m", 20.0),
                _positive(t + "crease_stiffness.phi_n_m_per_rad", 2e-3),
                Unknown(t + "crease_stiffness.hardens_per_m2", 2e4, kind="linear", low=0.0, high=10.0, sd=3.0),
                Unknown(
                    t + "crease_stiffness.bending_hardens_per_rad2", 5.0, kind="linear", low=0.0, high=10.0, sd=3.0
                ),
            ),
            # a law that does not harden is nearly compensated by the base's elasticity
            tuple((size, size, hard, hard) for hard in (2.0, 0.0) for size in _sizes(1.0, 5.0)),
        ),
        "squeeze_film": (
            (
                _positive(t + "squeeze_film.folded_n_s_per_m", 50.0),
                _shape(t + "squeeze_film.gap_m", 0.2e-3, 0.03e-3, 1e-3),
                Unknown(t + "squeeze_film.bending", 1.0, kind="linear", low=0.0, high=2.0, mean=1.0),
            ),
            (
                *((size, 0.0, 1.0) for size in _sizes(0.3, 6.0)),
                (1.0, 1.0, 1.0),
                (10.0, -1.2, 1.0),
                *((size, 0.0, 0.0) for size in _sizes(0.3, 6.0)),
            ),
        ),
        "fluid_inertia": (
            (_positive(t + "fluid_inertia.inertance_kg_per_m4", 1e7),),
            tuple((size,) for size in _sizes(0.3, 10.0)),
        ),
        "poiseuille_loss": (
            (_positive(t + "poiseuille_loss.resistance_pa_s_per_m3", 3e8),),
            tuple((size,) for size in _sizes(0.3, 10.0)),
        ),
        "trapped_gas": (
            (_positive(t + "trapped_gas.volume_m3", 1e-7), _shape(t + "trapped_gas.exponent", 1.0, 1.0, 1.4)),
            tuple((size, 0.0) for size in _sizes(0.1, 10.0)),
        ),
        "frustum_spread": (
            tuple(
                Unknown(f"{t}frustum_spread.E_relative.{cell}", 0.03, sd=2.0, low=-3.2, high=3.2)  # within 37 %
                for cell in range(1, cells + 1)
            ),
            _one_weak(cells, 1.0) + _weak_beside_strong(cells, 3.6),
        ),
        "intrinsic_curvature": (
            (
                _signed(t + "intrinsic_curvature.phi_0_rad", 3e-3),
                _signed(t + "intrinsic_curvature.phi_0_rad.tilt", 3e-3, sd=2.0),
                _signed(t + "intrinsic_curvature.phi_0_rad.bow", 3e-3, sd=2.0),
            ),
            ((0.5, 0.0, 0.0), (-0.5, 0.0, 0.0)),
        ),
        "asymmetry": (
            (
                _signed(t + "asymmetry.moment_n_m", 1e-3),
                _shape(t + "asymmetry.width", 0.9, 0.3, 2.5),
                Unknown(t + "asymmetry.centre", 0.3, kind="linear", low=-3.0, high=3.0),
                _shape(t + "asymmetry.sharpness", 2.0, 1.2, 8.0),
            ),
            tuple((sign * size, 0.0, 0.0, 0.0) for sign in (1, -1) for size in _sizes(0.5, 20.0)),
        ),
        "odd_frusta_compliance": (
            (
                Unknown("form", 1.0, kind="linear", sd=1e-6, mean=1.0),
                Unknown("straw.odd_E", 1.0, 1.0, "log", low=-0.5, high=5.0),
            ),
            ((1.0, 0.0), (1.0, 1.5)),
        ),
        "viscoelasticity": (
            (
                _positive(t + "viscoelasticity.k1_n_per_m", 100.0),
                _shape(t + "viscoelasticity.tau_s", 0.3, 0.01, 10.0),
                _positive(t + "viscoelasticity_slow.slow_k1_n_per_m", 100.0),
                _shape(t + "viscoelasticity_slow.slow_tau_s", 3.0, 0.3, 100.0),
                Unknown(
                    t + "viscoelasticity&viscoelasticity_slow.bending", 1.0, kind="linear", low=0.0, high=3.0, mean=0.5
                ),
            ),
            (
                *((size, 0.0, 0.0, 0.0, 0.5) for size in _sizes(0.3, 3.0)),
                (1.0, -2.0, 0.0, 0.0, 0.5),
                (1.0, -0.7, 1.0, 0.0, 0.5),
            ),
        ),
        "dry_friction": (
            (
                _positive(t + "dry_friction.force_n", 0.2),
                _shape(t + "dry_friction.slip_m", 20e-6, 2e-6, 200e-6),
            ),
            tuple((size, 0.0) for size in _sizes(0.3, 3.0)),
        ),
        "wall_elasticity": (
            (Unknown(t + "wall_elasticity.share", WALL_SHARE, low=0.0, high=_walls_at_most(), sd=10.0),),
            tuple((size,) for size in _sizes(2.0, 10.0)),
        ),
        "ambient_drag": ((_positive(t + "ambient_drag.c_d", 3.0),), tuple((size,) for size in _sizes(0.5, 5.0))),
        "line_lag": (
            (
                _positive(t + "line_lag.tau_s", 10e-3),
                _shape(t + "line_lag.air_m3", 1e-3, 1e-6, 1.0),
            ),
            (*((size, 0.0) for size in _sizes(0.3, 3.0)), (1.0, -4.0)),
        ),
    }
    for name, scale in (
        ("clock_offset", 10e-3),
        ("clock_drift", 3e-3),
        ("length_scale", 3e-3),
        ("camera_roll", 3e-3),
        ("tip_offset", 0.3e-3),
        ("gauge_offset", 100.0),
        ("gauge_gain", 0.01),
    ):
        field = {"clock_offset": "clock_offset_s", "camera_roll": "camera_roll_rad", "tip_offset": "tip_offset_m"}
        field["gauge_offset"] = "gauge_offset_pa"
        out[name] = ((_signed(f"instrument.{field.get(name, name)}", scale),), ((0.5,), (-0.5,)))
    return out | {name: library_of(law) for name, law in CAUSES.items() if name not in out}


def library_of(law: Law) -> tuple[tuple[Unknown, ...], tuple[tuple[float, ...], ...]]:
    """Unknowns and starts of a law that has none above, from its constants' plausible ranges.

    A strength is in units of the lower end of its range, which is well visible, or of a tenth of the upper end where
    the range has no lower one; its starts go from small to the upper end, to both sides where the range does. All
    others start from their default: on a log scale over the range where it has a lower end, else linear.
    """
    unknowns: list[Unknown] = []
    alike: list[bool] = []
    sizes: tuple[float, ...] = (1.0,)
    for c in law.constants:
        target = f"term.{law.name}.{c.name}"
        if c.name in law.strengths:
            top = max(abs(c.low), abs(c.high))
            unit = c.low if c.low > 0 else top / 10
            unknowns.append(_signed(target, unit) if c.low < 0 else _positive(target, unit))
            if not alike:
                sizes = _sizes(min(LEAST, top / unit), min(top / unit, float(np.sinh(MOST))))
                sizes = (*sizes, *(-size for size in sizes)) if c.low < 0 else sizes
            alike.append(True)
        elif c.low > 0 and c.default > 0:
            unknowns.append(_shape(target, c.default, c.low, c.high))
            alike.append(False)
        else:
            span = (c.high - c.low) / 4
            unknowns.append(
                Unknown(target, span, kind="linear", low=c.low / span, high=c.high / span, mean=c.default / span)
            )
            alike.append(False)
    starts = [
        tuple(size if like else unknown.mean for like, unknown in zip(alike, unknowns, strict=True)) for size in sizes
    ]
    return tuple(unknowns), tuple(starts)


def hypothesis(names: Sequence[str], cells: int) -> Hypothesis:
    """One or more causes together."""
    known = causes(cells)
    unknowns = tuple(u for name in names for u in known[name][0])
    starts = tuple(
        tuple(unknown.at(s) for unknown, s in zip(unknowns, sum(parts, ()), strict=True))
        for parts in itertools.product(*(known[name][1] for name in names))
    )
    faults = frozenset(MEASUREMENT)
    return Hypothesis(in_order(names, faults), unknowns, starts if names else ((),), faults)
