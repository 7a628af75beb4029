"""The contract of a user's law: its description and the behaviour of its functions; a defect is one line.

Its functions are run as plain Python here, so that errors have Python's own messages.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.plugged import said
from straw.model.term import Constant, Frustum, Law

Floats = NDArray[np.float64]

#: Kinds that a file may define: the walls and the inlet are the model's own equations.
KINDS = ("frustum", "memory", "body")
#: Number of states of a moving frustum at which a law is evaluated.
ASKED = 200
#: Steps of a walk along which a force with memory must not give back more than it took.
WALK = 2000


def check_law(law: object, where: str) -> None:
    """Raise ModelError, one line with place and cure, unless a law is fully described and behaves as described."""
    if not isinstance(law, Law):
        raise ModelError(f"{where}: {law!r} is no straw.Law; make it with straw.Law(name=..., law=..., ...)")
    where = f"{where}: law {law.name}"
    _says(law, where)
    if law.kind == "body":
        return  # bodies exist only in the compiled model; `straw check --run` runs such a law
    k = typical_row(law)
    with np.errstate(all="ignore"):
        _acts(law, k, where)
        if law.kind == "memory":
            _gives_nothing_back(law, k, where)
        elif law.energy is None:
            _only_takes(law, k, where)
        else:
            _is_the_slope(law, k, where)


def typical_row(law: Law) -> Floats:
    """Constants of plausible size: strengths in the middle of their range, all others at their defaults."""
    return np.array([_typical(c) if c.name in law.strengths else c.default for c in law.constants])


def _typical(c: Constant) -> float:
    return math.sqrt(c.low * c.high) if c.low > 0 else (c.high / 4 or c.low / 4)


def plain(function: Any) -> Any:
    """The Python function behind a compiled one."""
    return getattr(function, "py_func", function)


def _says(law: Law, where: str) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9_]*", law.name):
        raise ModelError(f"{where}: its name must be a word of small letters, digits and _, for a straw file")
    if law.kind == "flow":
        raise ModelError(
            f"{where}: kind = 'flow': the inlet is one equation of the model's own, with its derivatives; a loss over "
            "the flow goes into the straw file as a table, [terms.missing_loss]"
        )
    if law.kind not in KINDS:
        raise ModelError(f"{where}: kind = {law.kind!r}, expected one of {', '.join(KINDS)}")
    for name, what in (("law", "its formula"), ("source", "where it comes from")):
        value = getattr(law, name)
        if not isinstance(value, str) or not value.strip():
            raise ModelError(f"{where}: {name} is empty; give {what} in words")
    for c in law.constants:
        if not isinstance(c, Constant):
            raise ModelError(f"{where}: {c!r} is no straw.Constant(name, unit, default, low, high, about)")
        if not isinstance(c.unit, str) or not c.unit.strip():
            raise ModelError(f'{where}: constant {c.name} has no unit; give it, "1" for a number without one')
        if not all(isinstance(x, int | float) and math.isfinite(x) for x in (c.default, c.low, c.high)):
            raise ModelError(f"{where}: constant {c.name}: default, low and high must be finite numbers")
        if not c.low < c.high:
            raise ModelError(f"{where}: constant {c.name}: from {c.low:g} to {c.high:g}; low must be below high")
        if c.name not in law.strengths and not min(c.low, 0.0) <= c.default <= c.high:
            raise ModelError(f"{where}: constant {c.name}: default {c.default:g} is outside {c.low:g} to {c.high:g}")
    if not callable(law.force):
        raise ModelError(f"{where}: force is no function; give force(f, k), see straw.Law")


def some_frusta(count: int = ASKED) -> list[Frustum]:
    """Moving even frusta of the paper's straw, in states that a run may reach."""
    random = np.random.default_rng(7)
    r_i, r_o, e_pa, h, zeta0 = 11.1e-3, 14.65e-3, 0.92e9, 0.508e-3, -2.28e-3
    width, log = r_o - r_i, math.log(r_o / r_i)
    c1 = math.pi * e_pa * h / (8 * width**3) * ((r_o + r_i) / 2 - width / log)
    c2 = math.pi * e_pa * h**3 * log / (12 * width**2)
    states = random.uniform([-2.8e-3, -0.25, -0.5, -5.0], [2.8e-3, 0.25, 0.5, 5.0], (count, 4)).tolist()
    own = zeta0, c1, c2, 620.0, 7e-4, r_i, r_o, 0.0
    pressures = random.uniform(-30e3, 35e3, count).tolist()
    moving = [Frustum(z, phi, dz, dphi, *own) for z, phi, dz, dphi in states]
    return [f._replace(pressure=pa) for f, pa in zip(moving, pressures, strict=True)]


def _asked(law: Law, k: Floats, f: Frustum, where: str, *more: float) -> tuple[float, float]:
    """The law's force; ModelError where it raises, or is not two finite numbers."""
    at = f"at zeta = {f.zeta * 1e3:.2f} mm, phi = {f.phi:.3f} rad"
    try:
        given = plain(law.force)(f, k, *more)
    except Exception as error:
        raise ModelError(f"{where}: force raises {said(error)} {at}") from None
    if not isinstance(given, tuple | list) or len(given) != 2 or any(np.ndim(x) for x in given):
        raise ModelError(f"{where}: force gives {_short(given)}; expected (force on zeta in N, moment on phi in N m)")
    try:
        pair = float(given[0]), float(given[1])
    except (TypeError, ValueError):
        raise ModelError(f"{where}: force gives {_short(given)}; expected two numbers") from None
    if not all(map(math.isfinite, pair)):
        raise ModelError(f"{where}: force is {pair[0]:g} N, {pair[1]:g} N m {at}; it must be finite on any run")
    return pair


def _acts(law: Law, k: Floats, where: str) -> None:
    none = k.copy()
    none[[i for i, c in enumerate(law.constants) if c.name in law.strengths]] = 0.0
    more = (0.0, 0.0, 1e-3) if law.kind == "memory" else ()
    acts = 0.0
    for f in some_frusta():
        if _asked(law, none, f, where, *more) != (0.0, 0.0):
            raise ModelError(
                f"{where}: acts with {' and '.join(law.strengths)} = 0; a strength of zero must change nothing"
            )
        acts = max(acts, *map(abs, _asked(law, k, f, where, *more)))
    if acts == 0.0:
        raise ModelError(f"{where}: does nothing with plausible constants; check the ranges of its constants")


def _only_takes(law: Law, k: Floats, where: str) -> None:
    for f in some_frusta():
        force, moment = _asked(law, k, f, where)
        if force * f.d_zeta + moment * f.d_phi > 0:
            raise ModelError(
                f"{where}: gives energy ({force:.3g} N with zeta moving at {f.d_zeta:.2g} m/s); a force that stores "
                "some needs energy(f, k) in J, of which it is minus the slope; else it must brake"
            )


def _is_the_slope(law: Law, k: Floats, where: str) -> None:
    dz, df = 1e-7, 1e-5

    def energy(f: Frustum) -> float:
        try:
            return float(plain(law.energy)(f, k))
        except Exception as error:
            raise ModelError(f"{where}: energy raises {said(error)}") from None

    for f in some_frusta(50):
        pair = _asked(law, k, f, where)
        for name, given, step, unit, near in (("zeta", pair[0], dz, "N", 1e-5), ("phi", pair[1], df, "N m", 1e-7)):
            at = getattr(f, name)
            slope = -(energy(f._replace(**{name: at + step})) - energy(f._replace(**{name: at - step}))) / (2 * step)
            # rounding of the energy, and where a law has a kink between both points
            if not abs(given - slope) <= near * (1 + 100 * abs(slope)):
                raise ModelError(
                    f"{where}: at zeta = {f.zeta * 1e3:.2f} mm the force on {name} is {given:.4g} {unit}, minus the "
                    f"slope of its energy {slope:.4g}; make them agree"
                )


def _gives_nothing_back(law: Law, k: Floats, where: str) -> None:
    random, step_s = np.random.default_rng(3), 1e-3
    base = some_frusta(1)[0]
    held = (0.0, 0.0)
    taken_j = 0.0
    for d_zeta, d_phi in np.cumsum(random.normal(0, (0.05, 0.5), (WALK, 2)), axis=0).tolist():
        held = _asked(law, k, base._replace(d_zeta=d_zeta, d_phi=d_phi), where, *held, step_s)
        taken_j += (held[0] * d_zeta + held[1] * d_phi) * step_s
        if taken_j < 0:
            raise ModelError(f"{where}: gives back more energy than it took; what it remembers must fade")


def _short(value: object) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) < 60 else text[:57] + "..."
