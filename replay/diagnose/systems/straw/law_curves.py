"""A straw's laws as curves over the state they act on, with a band from the fit's covariance."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.channel import AMBIENT_PA
from straw.model.parameters import StrawParameters
from straw.model.term import Frustum, Term
from straw.model.terms import TERMS
from straw.replay.diagnose.fit import Fit
from straw.replay.diagnose.page.shown import Law, LawCurve
from straw.replay.diagnose.systems.straw.constants import applied
from straw.replay.diagnose.systems.straw.instrument import Instrument

Floats = NDArray[np.float64]

#: Points of a curve; heights are drawn to so many times the unloaded height, angles to this (rad).
POINTS, REACH, ANGLE_RAD = 81, 1.15, 0.3
#: A law that acts on motion only is shown as a damping at this speed, m/s; one with memory in a swing of this period,
#: s.
SPEED_M_PER_S, PERIOD_S = 0.01, 1.0
#: Pressure (Pa), time (s) over which an instrument's fault is shown.
PRESSURES_PA, TIMES_S = (-30e3, 40e3), (0.0, 4.0)
#: Step of a central difference in u: truncation of some 1e-8 and rounding of 1e-12 are both too small to be seen.
STEP = 1e-4
ODD = "e, modulus of the odd frusta over the even"
#: Labels of both axes, points (n,), and values (n,) for a straw and an instrument.
Curve = tuple[str, str, Floats, Callable[[StrawParameters, Instrument], Floats]]

INSTRUMENT_LAWS = {
    "gauge_offset": ("p_shown = p + p_0", "p_0, what the gauge shows too much"),
    "gauge_gain": ("p_shown = (1 + g) p", "g, gain of the gauge too much"),
    "clock_offset": ("t_stamped = t + t_0", "t_0, how late the camera's clock is"),
    "clock_drift": ("t_stamped = (1 + d) t", "d, drift of the camera's clock"),
    "length_scale": ("X_shown = (1 + l) X", "l, scale of length too large"),
    "camera_roll": ("Z_shown = Z - r X, Phi_shown = Phi + r", "r, roll of the camera"),
    "tip_offset": ("X_shown = X + a sin Phi, Z_shown = Z + a cos Phi", "a, offset of the tip along its axis"),
}


def law_curve(straw: StrawParameters, term: Term, fit: Fit, covariance: Floats) -> LawCurve | None:
    """The curve of a fitted term; None where it has no state of its own to be drawn over."""
    now = applied(straw, fit.unknowns, fit.u)[0]
    given = now.terms.get(term.name, {})
    per_cell = [c for c in term.constants if np.ndim(given.get(c.name, 0.0))]
    if per_cell:
        name, unit = per_cell[0].name, per_cell[0].unit
        shows = f"{name.replace('_', ' ')}{'' if unit == '1' else f' / {unit}'}"
        cells = np.arange(1.0, straw.cells + 1)
        curve = ("cell", shows, cells, lambda s, _: _even(s.terms[term.name][name], s.cells))
        return _banded(straw, curve, fit, covariance, parts=True)
    if term.kind == "memory":
        return _banded(straw, _loop(now, term), fit, covariance)
    if term.kind == "frustum":
        for one in _frustum(now, term):
            if np.any(one[3](now, Instrument())):
                return _banded(straw, one, fit, covariance)
    return _banded(straw, FLOWS[term.name](now), fit, covariance) if term.name in FLOWS else None


def instrument_law(cause: str, straw: StrawParameters, fit: Fit, covariance: Floats) -> Law | None:
    """An instrument's excess, over its reading or the run's time."""
    if cause == "odd_frusta_compliance":
        return Law("E_odd = e E", "the odd frusta give way, too", {"odd_E": ODD})
    if cause not in INSTRUMENT_LAWS:
        return None
    formula, about = INSTRUMENT_LAWS[cause]
    names = {k.target.partition(".")[2] for k in fit.unknowns if k.target.startswith(f"instrument.{cause}")}
    if cause.startswith("gauge"):
        at = np.linspace(*PRESSURES_PA, POINTS)
        curve: Curve = (
            "pressure / kPa", "shown too much / Pa", at / 1e3,
            lambda _, i: np.array([i.shown_pressure(float(p)) - p for p in at]),
        )  # fmt: skip
    elif cause.startswith("clock"):
        at = np.linspace(*TIMES_S, POINTS)
        curve = ("time / s", "stamped late / ms", at, lambda _, i: 1e3 * (i.stamped(at) - at))
    else:
        long_m = float(np.sum(straw.zeta0_m[:, 0] - straw.zeta0_m[:, 1]))
        at, row = np.linspace(0.0, long_m, POINTS), int(cause == "camera_roll")
        pose = np.stack([at, np.zeros(POINTS), np.full(POINTS, straw.phi_0_rad)])
        shows = f"{'XZ'[row]} shown too much / mm"
        curve = ("X of the tip / mm", shows, 1e3 * at, lambda _, i: 1e3 * (i.seen(pose, np.zeros(POINTS)) - pose)[row])
    return Law(formula, "", dict.fromkeys(names, about), _banded(straw, curve, fit, covariance))


def about_instrument(cause: str) -> str:
    """Description of the constant of such a cause."""
    return INSTRUMENT_LAWS[cause][1] if cause in INSTRUMENT_LAWS else ODD


def _banded(straw: StrawParameters, curve: Curve, fit: Fit, covariance: Floats, parts: bool = False) -> LawCurve:
    """Values with one standard deviation, to first order in all of the fit's unknowns."""
    over, shows, at, of = curve
    values = of(*applied(straw, fit.unknowns, fit.u))
    slopes = []
    for k in range(len(fit.u)):
        if fit.unknowns[k].target.split(".")[0] not in ("term", "instrument"):
            slopes.append(np.zeros_like(values))
            continue
        step = np.zeros_like(fit.u)
        step[k] = STEP
        high, low = (of(*applied(straw, fit.unknowns, fit.u + sign * step)) for sign in (1, -1))
        slopes.append((high - low) / (2 * STEP))
    J = np.array(slopes)
    return LawCurve(
        at, values, np.sqrt(np.maximum(np.einsum("kn,kj,jn->n", J, covariance, J), 0.0)), over, shows, parts
    )


def _even(values: Any, cells: int) -> Floats:
    """A constant's values at the even frusta, (cells,)."""
    rows = np.asarray(values, dtype=np.float64)
    rows = rows[:, -1] if rows.ndim == 2 else rows
    return np.asarray(np.broadcast_to(rows, cells), dtype=np.float64)


def _constants(straw: StrawParameters, term: Term) -> Floats:
    given = straw.terms.get(term.name, {})
    return np.array([float(given.get(c.name, c.default)) for c in term.constants])


def _at(straw: StrawParameters, zeta: float, phi: float, d_zeta: float) -> Frustum:
    zeta0 = float(np.mean(straw.zeta0_m[:, 1]))
    return Frustum(zeta, phi, d_zeta, 0.0, zeta0, 0.0, 0.0, 0.0, 0.0, straw.r_i_m, straw.r_o_m, straw.cycle)


def _frustum(straw: StrawParameters, term: Term) -> list[Curve]:
    """Force over height, moment over height, moment over angle, damping over height: the first that is not zero."""
    zeta0 = float(np.mean(straw.zeta0_m[:, 1]))
    zeta, phi = np.linspace(zeta0 * REACH, -zeta0 * REACH, POINTS), np.linspace(-ANGLE_RAD, ANGLE_RAD, POINTS)
    force = getattr(term.force, "py_func", term.force)

    def of(heights: Floats, angles: Floats, speed: float, which: int, scale: float) -> Callable[..., Floats]:
        def values(s: StrawParameters, _: Instrument) -> Floats:
            k = _constants(s, term)
            rows = [force(_at(s, float(z), float(p), speed), k)[which] for z, p in zip(heights, angles, strict=True)]
            return scale * np.array(rows)

        return values

    none, folded, height = np.zeros(POINTS), np.full(POINTS, zeta0), "height ζ of a frustum / mm"
    return [
        (height, "force / N", 1e3 * zeta, of(zeta, none, 0.0, 0, 1.0)),
        (height, "moment / (mN m)", 1e3 * zeta, of(zeta, none, 0.0, 1, 1e3)),
        ("angle φ of a frustum / rad", "moment / (mN m)", phi, of(folded, phi, 0.0, 1, 1e3)),
        (height, "damping -F/ζ' / (N s/m)", 1e3 * zeta, of(zeta, none, SPEED_M_PER_S, 0, -1 / SPEED_M_PER_S)),
    ]


def _loop(straw: StrawParameters, term: Term) -> Curve:
    """Force over height in the second of two swings between the unloaded heights."""
    n, most = 2 * POINTS, abs(float(np.mean(straw.zeta0_m[:, 1])))
    t = np.linspace(0.0, 2 * PERIOD_S, 2 * n)
    zeta = most * np.sin(2 * np.pi * t / PERIOD_S)
    rate = most * 2 * np.pi / PERIOD_S * np.cos(2 * np.pi * t / PERIOD_S)
    step, memory = float(t[1] - t[0]), getattr(term.force, "py_func", term.force)

    def values(s: StrawParameters, _: Instrument) -> Floats:
        k, force, out = _constants(s, term), 0.0, []
        for z, v in zip(zeta, rate, strict=True):
            force = memory(_at(s, float(z), 0.0, float(v)), k, force, 0.0, step)[0]
            out.append(-force)
        return np.array(out[n - 1 :])

    return f"height ζ of a frustum, swung in {PERIOD_S:g} s / mm", "force / N", 1e3 * zeta[n - 1 :], values


def _of(straw: StrawParameters, term: str, name: str) -> float:
    """A constant of a term, given or by default."""
    default = next(c.default for c in TERMS[term].constants if c.name == name)
    return float(straw.terms.get(term, {}).get(name, default))


def _flow_m3_per_s(straw: StrawParameters) -> Floats:
    """Flows up to what the suction of `PRESSURES_PA` drives through the channel."""
    return np.linspace(0.0, np.pi * straw.r_ch_m**2 * np.sqrt(-2 * PRESSURES_PA[0] / straw.rho_kg_per_m3), POINTS)


def _line(straw: StrawParameters, term: str, name: str, over: str, at: Floats, shown: float) -> Curve:
    """A pressure proportional to the state at (n,); shown per SI."""
    return over, "pressure / kPa", shown * at, lambda s, _: float(s.terms[term][name]) * at / 1e3


FLOWS: dict[str, Callable[[StrawParameters], Curve]] = {
    "poiseuille_loss": lambda s: _line(
        s, "poiseuille_loss", "resistance_pa_s_per_m3", "flow Q / (mL/s)", _flow_m3_per_s(s), 1e6
    ),
    "fluid_inertia": lambda s: _line(
        s, "fluid_inertia", "inertance_kg_per_m4", "dQ/dt / (mL/s²)", 10 * _flow_m3_per_s(s), 1e6
    ),
    "trapped_gas": lambda s: (
        "volume of the gas, of that at rest", "pressure / kPa", np.linspace(0.7, 1.3, POINTS),
        lambda one, _: AMBIENT_PA / 1e3 * (np.linspace(0.7, 1.3, POINTS) ** -_of(one, "trapped_gas", "exponent") - 1),
    ),
    "ambient_drag": lambda s: (
        "speed of the tip / (m/s)", "drag of the board / mN", np.linspace(0, 1, POINTS),
        lambda one, _: 500 * np.linspace(0, 1, POINTS) ** 2 * np.prod(
            [_of(one, "ambient_drag", name) for name in ("c_d", "fluid_kg_per_m3", "board_m2")]
        ),
    ),
    "line_lag": lambda s: (
        "time after a step / ms", "share of the step",
        1e3 * np.linspace(0, 0.1, POINTS),
        lambda one, _: 1 - np.exp(-np.linspace(0, 0.1, POINTS) / max(1e-9, float(one.terms["line_lag"]["tau_s"]))),
    ),
}  # fmt: skip
