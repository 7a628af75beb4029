"""Hypotheses: what may be missing, as unknowns with priors that are set into a straw and an instrument."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.parameters import StrawParameters
from replay.diagnose.instrument import Instrument

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Unknown:
    """One number to find: ``target`` is ``straw.NAME``, ``term.TERM.NAME[.WHERE]`` (several terms joined by &; a
    cell, or a profile `along` the straw), ``instrument.NAME`` or ``form``.

    Searched as u: value = start exp(scale u) of a ``log`` one, scale sinh(u) of a strength, which is linear while
    small and logarithmic when large, and scale u of a ``linear`` one; zero strength is not there. Its prior is a normal
    distribution about u = ``mean`` with deviation ``sd``; low and high bound u.
    """

    target: str
    scale: float
    start: float = 0.0
    kind: str = "strength"
    mean: float = 0.0
    sd: float = 1.0
    low: float = -np.inf
    high: float = np.inf

    def value(self, u: float) -> float:
        """The number, SI, at u."""
        if self.kind == "log":
            return float(self.start * np.exp(self.scale * u))
        return float(self.scale * (np.sinh(u) if self.kind == "strength" else u))

    def per_u(self, u: float) -> float:
        """d value / d u."""
        if self.kind == "log":
            return self.value(u) * self.scale
        return float(self.scale * (np.cosh(u) if self.kind == "strength" else 1.0))

    def at(self, units: float) -> float:
        """u of a start given in units of ``scale``, or as u itself where the search is not of a strength."""
        return float(np.arcsinh(units)) if self.kind == "strength" else units


@dataclass(frozen=True)
class Hypothesis:
    """Causes that act together, their unknowns, and from where to look for each (u without the base's)."""

    causes: tuple[str, ...]
    unknowns: tuple[Unknown, ...]
    starts: tuple[tuple[float, ...], ...]

    @property
    def name(self) -> str:
        """Causes joined by +; ``complete`` without any."""
        return "+".join(self.causes) or "complete"

    def beside(self, first: Hypothesis) -> Hypothesis:
        """Both hypotheses' causes at work at once, physics named before instruments; no starts."""
        both = sorted((*first.causes, *self.causes), key=lambda name: (name in MEASUREMENT, name))
        return Hypothesis(tuple(both), (*first.unknowns, *self.unknowns), ())


#: A specimen's elasticity and geometry are not further than this from what is given, in deviations of their prior: with
#: only a prior against it, a tenth less of E with a tenth more of h stands in for whatever is missing.
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


#: What runs of one straw differ by, one standard deviation as a step in u: wear and warmth in E and damping, mounting.
#: Wider would swallow effects, narrower would take the difference of two repeats for physics.
REPEATS = {"straw.E_pa": 1.5e-3, "straw.c_zeta_n_s_per_m": 0.03, "straw.c_phi_n_m_s_per_rad": 0.03}
REPEATS_MOUNT = Unknown("straw.mount_rad", 2e-4, kind="linear")


def _positive(target: str, scale: float) -> Unknown:
    return Unknown(target, scale, low=0.0, high=8.0, sd=10.0)


def _signed(target: str, scale: float, sd: float = 10.0) -> Unknown:
    return Unknown(target, scale, sd=sd, low=-8.0, high=8.0)


def _shape(target: str, start: float, low: float, high: float) -> Unknown:
    return Unknown(target, 1.0, start, "log", low=np.log(low / start), high=np.log(high / start), sd=1.0)


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
            ),
            tuple(
                (*start, 0.0, 0.0) for start in ((0.3, 0.0, 1.0), (3.0, 0.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, 1.0))
            ),
        ),
        "crease_stiffness": (
            (
                _signed(t + "crease_stiffness.zeta_n_per_m", 20.0),
                _signed(t + "crease_stiffness.phi_n_m_per_rad", 2e-3),
                Unknown(t + "crease_stiffness.hardens_per_m2", 2e4, kind="linear", low=0.0, high=10.0, sd=3.0),
                Unknown(
                    t + "crease_stiffness.bending_hardens_per_rad2", 5.0, kind="linear", low=0.0, high=10.0, sd=3.0
                ),
            ),
            ((1.0, 1.0, 0.0, 0.0), (5.0, 5.0, 0.0, 0.0)),
        ),
        "squeeze_film": (
            (
                _positive(t + "squeeze_film.folded_n_s_per_m", 50.0),
                _shape(t + "squeeze_film.gap_m", 0.2e-3, 0.03e-3, 1e-3),
            ),
            ((0.3, 0.0), (4.0, 0.0), (1.0, 1.0), (10.0, -1.2)),
        ),
        "fluid_inertia": (
            (_positive(t + "fluid_inertia.inertance_kg_per_m4", 1e7),),
            ((0.3,), (3.0,), (10.0,)),
        ),
        "poiseuille_loss": (
            (_positive(t + "poiseuille_loss.resistance_pa_s_per_m3", 3e8),),
            ((0.3,), (5.0,)),
        ),
        "trapped_gas": ((_positive(t + "trapped_gas.volume_m3", 1e-7),), ((0.1,), (2.0,), (10.0,))),
        "frustum_spread": (
            tuple(
                Unknown(f"{t}frustum_spread.E_relative.{cell}", 0.03, sd=2.0, low=-3.2, high=3.2)  # within 37 %
                for cell in range(1, cells + 1)
            ),
            tuple(tuple(-1.0 if c == n else 0.0 for c in range(cells)) for n in range(min(cells, 6))),
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
            tuple((size, 0.0, 0.0, 0.0) for size in (0.5, -0.5, 4.0, -4.0, 20.0, -20.0)),
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
            tuple((*start, 0.5) for start in ((0.3, 0, 0, 0), (3.0, 0, 0, 0), (1.0, -2.0, 0, 0), (1.0, -0.7, 1.0, 0))),
        ),
        "dry_friction": ((_positive(t + "dry_friction.force_n", 0.2),), ((0.3,), (3.0,))),
        "ambient_drag": ((_positive(t + "ambient_drag.c_d", 3.0),), ((0.5,), (5.0,))),
        "line_lag": (
            (
                _positive(t + "line_lag.tau_s", 10e-3),
                _shape(t + "line_lag.air_m3", 1e-3, 1e-6, 1.0),
            ),
            ((0.3, 0.0), (3.0, 0.0), (1.0, -4.0)),
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
    return out


MEASUREMENT = (
    "clock_offset",
    "clock_drift",
    "length_scale",
    "camera_roll",
    "tip_offset",
    "gauge_offset",
    "gauge_gain",
)


def hypothesis(names: Sequence[str], cells: int) -> Hypothesis:
    """One or more causes together."""
    known = causes(cells)
    unknowns = tuple(u for name in names for u in known[name][0])
    starts = tuple(
        tuple(unknown.at(s) for unknown, s in zip(unknowns, sum(parts, ()), strict=True))
        for parts in itertools.product(*(known[name][1] for name in names))
    )
    return Hypothesis(tuple(names), unknowns, starts if names else ((),))


def along(where: str, cells: int) -> Floats:
    """How a constant differs from cell to cell, (cells,): in one cell by its number, or smoothly from -1 at the base to
    1 at the tip (``tilt``), or bent (``bow``); neither of these two changes the mean of a long straw.
    """
    u = np.linspace(-1.0, 1.0, cells)
    if where == "tilt":
        return u
    return 1.5 * u**2 - 0.5 if where == "bow" else np.eye(cells)[int(where) - 1]


def applied(straw: StrawParameters, unknowns: Sequence[Unknown], at: Floats) -> tuple[StrawParameters, Instrument]:
    """The straw and instrument with the unknowns set to u (unknowns,)."""
    changes: dict[str, object] = {}
    terms: dict[str, dict[str, Any]] = {}
    instrument: dict[str, float] = {}
    for unknown, u in zip(unknowns, at, strict=True):
        kind, _, name = unknown.target.partition(".")
        value = unknown.value(float(u))
        if kind == "instrument":
            instrument[name] = value
        elif kind == "form":
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
    changed = straw.replace(**changes) if changes else straw
    for term, constants in terms.items():
        changed = changed.with_term(term, **constants)
    return changed, Instrument.of(instrument)
