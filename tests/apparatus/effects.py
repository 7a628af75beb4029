"""What can be concealed in a specimen or its instruments: each cause with its form, unit and range of sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .instrument import Instrument
from .layout import CELLS
from .straw import RIGID, Straw

Rig = tuple[Straw, Instrument]
MOVING = (1, 4, 6)  # cells that snap in the campaign's deployments


@dataclass(frozen=True)
class Cause:
    """One concealed cause: its name in the contract (or ``unknown``), its size, and which of its forms."""

    name: str
    size: float
    form: str = ""
    draw: int = 0  # seed of what else is random: which cell, which side


@dataclass(frozen=True)
class Range:
    """Sizes from barely detectable to strong, and how a size is applied to straw and instruments."""

    weak: float
    strong: float
    unit: str
    forms: dict[str, Callable[[Rig, float, np.random.Generator], Rig]]


def _laws(**terms: float | Callable[[float], float]) -> Callable[[Rig, float, np.random.Generator], Rig]:
    """A law whose numbers are constants or functions of the size."""

    def apply(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
        return rig[0].with_laws(**{k: v(size) if callable(v) else v for k, v in terms.items()}), rig[1]

    return apply


def _fault(field: str, signed: bool = True) -> Callable[[Rig, float, np.random.Generator], Rig]:
    def apply(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
        return rig[0], replace(rig[1], **{field: size * (rng.choice([-1.0, 1.0]) if signed else 1.0)})

    return apply


def _weak_cell(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
    weaker = np.array(rig[0].weaker)
    weaker[rng.choice(MOVING) - 1] *= 1.0 - size
    return replace(rig[0], weaker=tuple(weaker)), rig[1]


def _all_differ(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
    spread = np.clip(rng.normal(size=CELLS), -2.0, 2.0)
    return replace(rig[0], weaker=tuple(np.array(rig[0].weaker) * (1.0 + 0.5 * size * spread))), rig[1]


def _lean(shape: Callable[[np.ndarray], np.ndarray]) -> Callable[[Rig, float, np.random.Generator], Rig]:
    def apply(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
        lean = rng.choice([-1.0, 1.0]) * size * shape(np.arange(CELLS) / (CELLS - 1.0))
        return replace(rig[0], lean_rad=tuple(lean)), rig[1]

    return apply


def _compliant(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
    return replace(rig[0], odd_stiffness=min(RIGID, 1.0 / size)), rig[1]


def _glued(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
    stop = np.array(rig[0].stop_m)
    stop[rng.choice(MOVING) - 1] = 2.0e-3 - size
    return replace(rig[0], stop_m=tuple(stop)).with_laws(STOP_STIFFNESS=2e4), rig[1]


def _stopped(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
    stop = np.full(CELLS, 2.0e-3 - size)
    return replace(rig[0], stop_m=tuple(stop)).with_laws(STOP_STIFFNESS=4e3), rig[1]


def _saturates(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
    return rig[0], replace(rig[1], gauge_ceiling_pa=35e3 - size, gauge_floor_pa=-25e3 + size)


def _hiccup(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
    return rig[0], replace(rig[1], hiccup_s=size, hiccup_at_s=float(rng.uniform(0.35, 0.6)))


def _side(name: str) -> Callable[[Rig, float, np.random.Generator], Rig]:
    def apply(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
        return rig[0].with_laws(**{name: size * rng.choice([-1.0, 1.0])}), rig[1]

    return apply


PHYSICS: dict[str, Range] = {
    "cohesion": Range(1.0, 10.0, "N", {
        "binding curve": _laws(COHESION_N=lambda s: s, COHESION_REACH=2.5e-4),
        "linear traction that tears": _laws(COHESION_N=lambda s: s, COHESION_REACH=6e-4, COHESION_FORM=1.0),
    }),
    "crease_stiffness": Range(40.0, 600.0, "N/m", {
        "hardening hinge": _laws(
            CREASE=lambda s: s, CREASE_CUBIC=lambda s: s / (5e-3) ** 2, CREASE_PHI=lambda s: s * 3e-5,
            CREASE_PHI_CUBIC=lambda s: s * 3e-5 / 0.3**2),
    }),
    "squeeze_film": Range(30.0, 2000.0, "N s/m", {
        "disk with gap floor, h^-3": _laws(FILM=lambda s: s, FILM_GAP=2e-4, FILM_POWER=3.0),
        "strip of rough walls, h^-2": _laws(FILM=lambda s: s, FILM_GAP=1.5e-4, FILM_POWER=2.0),
    }),
    "fluid_inertia": Range(3e6, 3e8, "Pa s^2/m^3", {
        "channel and filled straw": _laws(INERTANCE=lambda s: s, INERTANCE_VOLUME=1.5e4),
    }),
    "poiseuille_loss": Range(1e8, 6e9, "Pa s/m^3", {
        "Carreau, thinning": _laws(VISCOUS=lambda s: s, VISCOUS_FLOW=4e-6, VISCOUS_POWER=0.85),
    }),
    "trapped_gas": Range(0.2e-6, 6e-6, "m^3", {"adiabatic": _laws(GAS_VOLUME=lambda s: s)}),
    "frustum_spread": Range(0.02, 0.20, "1", {"one weak cell": _weak_cell, "all cells differ": _all_differ}),
    "intrinsic_curvature": Range(0.5e-3, 15e-3, "rad", {
        "grows towards the tip": _lean(lambda u: 2.0 * u),
        "curled near the base": _lean(lambda u: 3.0 * (1.0 - u) ** 2),
    }),
    "asymmetry": Range(1e-3, 4e-2, "N m", {
        "compact bump": lambda rig, s, rng: _side("BUMP")((rig[0].with_laws(BUMP_WIDTH=2e-3), rig[1]), s, rng),
        "skewed bump": lambda rig, s, rng: _side("BUMP")(
            (rig[0].with_laws(BUMP_WIDTH=2.2e-3, BUMP_SKEW=0.6), rig[1]), s, rng),
    }),
    "odd_frusta_compliance": Range(0.1, 1.0, "1", {"the paper's full form": _compliant}),
    "viscoelasticity": Range(60.0, 1500.0, "N/m", {
        "two branches": _laws(BRANCH_1=lambda s: 0.6 * s, BRANCH_2=lambda s: 0.4 * s, TAU_1=0.15, TAU_2=1.5),
        "power law": _laws(
            BRANCH_1=lambda s: 0.5 * s, BRANCH_2=lambda s: 0.3 * s, BRANCH_3=lambda s: 0.2 * s,
            TAU_1=0.06, TAU_2=0.6, TAU_3=6.0),
    }),
    "dry_friction": Range(0.05, 1.2, "N", {
        "LuGre": _laws(FRICTION=lambda s: s, FRICTION_STATIC=1.3),
        "LuGre, sticky": _laws(FRICTION=lambda s: s, FRICTION_STATIC=1.8, FRICTION_STIFFNESS=1e5),
    }),
    "ambient_drag": Range(0.05, 3.0, "N s^2/m^2", {"Schiller-Naumann": _laws(DRAG=lambda s: s)}),
    "line_lag": Range(5e-3, 80e-3, "s", {
        "two stages": _laws(LAG_1=lambda s: 0.5 * s, LAG_2=lambda s: 0.5 * s),
        "tube and volume": _laws(LAG_2=lambda s: s, LAG_CAPACITY=8e-10),
    }),
}  # fmt: skip

INSTRUMENT: dict[str, Range] = {
    "clock_offset": Range(0.02, 0.10, "s", {"": _fault("clock_offset_s")}),
    "clock_drift": Range(1e-3, 10e-3, "s/s", {"": _fault("clock_drift")}),
    "length_scale": Range(0.005, 0.03, "1", {"": _fault("length_scale")}),
    "camera_roll": Range(5e-3, 30e-3, "rad", {"": _fault("camera_roll_rad")}),
    "tip_offset": Range(0.5e-3, 3e-3, "m", {"": _fault("tip_offset_m")}),
    "gauge_offset": Range(300.0, 2000.0, "Pa", {"": _fault("gauge_offset_pa")}),
    "gauge_gain": Range(0.02, 0.10, "1", {"": _fault("gauge_gain")}),
}

UNKNOWN: dict[str, Range] = {
    "wall softens with time": Range(0.5e-3, 3e-3, "1/s", {"": _laws(SOFTENING=lambda s: s)}),
    "leak through the wall": Range(1e-11, 5e-11, "m^3/(s Pa)", {"": _laws(LEAK=lambda s: s)}),
    "side wind": Range(0.01, 0.06, "N", {"": _side("WIND_Z")}),
    "board against a stop": Range(0.5e-3, 2e-3, "m", {
        "": _laws(BOARD_STOP=lambda s: 52e-3 - s, BOARD_STIFFNESS=800.0)}),
    "mass added at the tip": Range(2e-3, 10e-3, "kg", {"": _laws(M_TIP=lambda s: 0.01345 + s)}),
    "wall stiffer under pressure": Range(1.5e-6, 6e-6, "1/Pa", {"": _side("STIFFENING")}),
    "cell glued half way": Range(0.3e-3, 1.5e-3, "m", {"": _glued}),
    "damping with the square of speed": Range(100.0, 3000.0, "N s^2/m^2", {"": _laws(SQUARE_DAMPING=lambda s: s)}),
    "magnet near the tip": Range(0.1, 0.6, "N", {
        "": _laws(MAGNET=lambda s: s, MAGNET_X=0.055, MAGNET_Z=-0.012)}),
    "self-excited tip": Range(0.05, 0.3, "N s/m", {"": _laws(PUSH=lambda s: s)}),
    "gauge saturates": Range(2e3, 6e3, "Pa", {"": _saturates}),
    "gauge with backlash": Range(500.0, 2500.0, "Pa", {"": _fault("gauge_play_pa", signed=False)}),
    "camera skips a moment": Range(0.03, 0.10, "s", {"": _hiccup}),
    "channel clogs from run to run": Range(0.005, 0.03, "1", {"": _laws()}),
}  # fmt: skip
CLOGS = "channel clogs from run to run"

#: Beside any cause, without a name of its own: the residual of a model that is mostly right, in sigmas of a frame.
REST = "rest"


def _rest(rig: Rig, size: float, rng: np.random.Generator) -> Rig:
    return rig[0], replace(rig[1], rest_sigmas=size, rest_draw=int(rng.integers(2**31)))


#: Causes that no deck draws: labels are drawn by seed, and an additional cause would change those of all kept rows.
BESIDE: dict[str, Range] = {
    "wall_elasticity": Range(0.2, 1.0, "1", {"finite elements": _laws(SHELL=lambda s: s)}),
}
BESIDE_UNKNOWN: dict[str, Range] = {
    "stop inside every cell": Range(0.2e-3, 1e-3, "m", {"": _stopped}),
    "wall beside the board": Range(1e-3, 6e-3, "m", {
        "": _laws(WALL_Z=lambda s: -14e-3 + s, WALL_STIFFNESS=100.0)}),
    "tether that turns the board back": Range(1e-3, 20e-3, "N m/rad", {
        "": _laws(TETHER=lambda s: s, TETHER_RAD=1.65)}),
    "gauge warms up": Range(300.0, 3e3, "Pa", {"": _fault("gauge_warms_pa")}),
    "camera sinks": Range(0.2e-3, 2e-3, "m", {"": _fault("camera_sinks_m")}),
    "camera slips": Range(4e-3, 20e-3, "rad", {"": _fault("camera_slips_rad")}),
    "board slips": Range(0.3e-3, 2e-3, "m", {"": _fault("board_slips_m")}),
    "frame bends": Range(4e-3, 20e-3, "rad", {"": _fault("frame_bends_rad")}),
}  # fmt: skip

EVERY = {**PHYSICS, **INSTRUMENT, **BESIDE}
EVERY_UNKNOWN = {**UNKNOWN, **BESIDE_UNKNOWN}
RESTS = Range(1.0, 5.0, "sigma", {"": _rest})


def range_of(cause: Cause) -> Range:
    """The range that has a cause's forms; an unknown cause is found by its form, a rest by its name."""
    if cause.name == REST:
        return RESTS
    return EVERY_UNKNOWN[cause.form] if cause.name == "unknown" else EVERY[cause.name]


def conceal(rig: Rig, cause: Cause) -> Rig:
    """Straw and instruments with the cause applied."""
    forms = range_of(cause).forms
    apply = forms[""] if "" in forms else forms[cause.form]
    return apply(rig, cause.size, np.random.default_rng(cause.draw))
