"""Laws in words and formulas, their constants with deviations, and their curves with bands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.discover.trial import Trial, covariance_of
from straw.replay.diagnose.systems.function.codes import (
    ALONG,
    CHANNEL,
    CLOCK,
    DELAY,
    FACTOR,
    INPUT,
    OF_NOTHING,
    OF_SHOWN,
    OF_STATE,
    OF_TIME,
    RATE,
    SHIFT,
    STRENGTH,
)
from straw.replay.diagnose.systems.function.laws import Law
from straw.replay.diagnose.systems.function.shapes import CONSTANT, SHAPES, TABLE

Floats = NDArray[np.float64]

#: Points of a reported curve; standard deviations by which an effect must precede its cause to indicate a clock.
POINTS, AHEAD = 41, 3.0
#: Each kind of place in a formula: {name} its name, {f} the law's value.
READS = {
    RATE: "d {name}/dt = ... + {f}",
    ALONG: "d v/dt = ... + {f} v/|v|, where v = ({name})",
    FACTOR: "{name} -> {name} (1 + {f})",
    CHANNEL: "{name} shown = {name} + {f}",
    CLOCK: "{name} shown at t is of t - ({f})",
    DELAY: "{name} acts later by {f}",
    STRENGTH: "times (1 + {f})",
    INPUT: "{name} -> {name} + {f}",
    SHIFT: "{name}, with {f}",
}


@dataclass(frozen=True, eq=False)
class ReportedLaw:
    """A law as it is reported: formula, constants (value, deviation, unit), and its curve (state, value, deviation)."""

    law: Law
    formula: str
    constants: dict[str, tuple[float, float, str]]
    curve: Floats  # (3, n)


def is_fault(one: ReportedLaw) -> bool | None:
    """Whether a law is a fault of the recording, whatever the system; None where that is undetermined.

    A delay may be the system's, too, but only a clock can put an effect before its cause. A drift may be the
    instrument's or the system's.
    """
    kind, state = one.law.place.kind, one.law.state
    if kind in (CLOCK, DELAY):
        _, late, sigma = one.curve
        return True if np.any(late < -AHEAD * sigma) else None
    if kind == INPUT:
        return not state.remembers
    if kind != CHANNEL or state.remembers or not _of_itself(one.law):
        return False
    return None if state.kind == OF_TIME else True


def _of_itself(law: Law) -> bool:
    """Whether a law in a reading depends on nothing but this or time."""
    itself = law.state.kind == OF_STATE and law.state.symbol == law.place.name.partition(":")[2]
    return itself or law.state.kind in (OF_SHOWN, OF_TIME, OF_NOTHING)


def acts_in_recording(law: Law) -> bool:
    """Whether a law is not in the system's equations: a fault, or what may be one."""
    if law.state.remembers:
        return False
    return (law.place.kind == CHANNEL and _of_itself(law)) or law.place.kind in (CLOCK, DELAY, INPUT)


def told(trial: Trial, number: int) -> ReportedLaw:
    """A trial's law by its number, with its uncertainty, the other constants free."""
    law, fit = trial.laws[number], trial.fit
    own = [k for k, one in enumerate(fit.unknowns) if one.target.startswith(f"law.{number}.")]
    covariance = covariance_of(trial)[np.ix_(own, own)]
    constants = {}
    for k, j in enumerate(own):
        one = fit.unknowns[j]
        name = one.target.split(".")[-1]
        sigma = abs(one.per_u(float(fit.u[j]))) * float(np.sqrt(max(covariance[k, k], 0.0)))
        constants[name] = (one.value(float(fit.u[j])), sigma, unit_of(law, name))
    low, high = law.state.low, law.state.high
    if law.own:  # over how far it is behind
        high = trial.values.get(f"law.{number}.play", law.state.span / 2)
        low = -high
    at = np.linspace(low, high, POINTS)
    if law.shape == TABLE:
        at = np.unique(np.concatenate([at, law.at]))

    def values(u: Floats) -> Floats:
        full = fit.u.copy()
        full[own] = u
        return law.curve(number, trial.system.values(fit.unknowns, full), at)

    here = fit.u[own]
    steps = 1e-4 * np.eye(len(own))
    slopes = np.array([(values(here + s) - values(here - s)) / 2e-4 for s in steps])
    band = np.sqrt(np.maximum(np.einsum("kn,kj,jn->n", slopes, covariance, slopes), 0.0))
    text = formula(law, trial.values, number)
    if law.beyond:
        text, constants = _beyond(trial, number)
    return ReportedLaw(law, text, constants, np.stack([at, values(here), band]))


def _beyond(trial: Trial, number: int) -> tuple[str, dict[str, tuple[float, float, str]]]:
    """A constant beyond its range: itself with its deviation, in place of a factor that trades with it."""
    fit, constant = trial.fit, trial.system.model.constants[trial.laws[number].place.which]
    value, more = trial.values.get(f"constant.{constant.name}", constant.value), trial.values[f"law.{number}.strength"]
    slope = np.zeros(len(fit.u))
    for k, (one, u) in enumerate(zip(fit.unknowns, fit.u.tolist(), strict=True)):
        if one.target == f"constant.{constant.name}":
            slope[k] = one.per_u(u) * (1 + more)
        elif one.target == f"law.{number}.strength":
            slope[k] = one.per_u(u) * value
    sigma = float(np.sqrt(max(float(slope @ covariance_of(trial) @ slope), 0.0)))
    now, unit = value * (1 + more), constant.unit
    ends = f"{constant.low:.4g}" if constant.fixed else f"{constant.low:.4g} to {constant.high:.4g}"
    return f"{constant.name} = {now:.4g} {unit}, where the file says {ends}", {constant.name: (now, sigma, unit)}


def unit_of(law: Law, constant: str) -> str:
    """Unit of a law's constant."""
    if constant.startswith("value"):
        return law.place.unit
    if constant == "strength":
        power = SHAPES[law.shape].unit
        if power == 0 or law.state.unit == "1" or law.state.kind == OF_NOTHING:
            return law.place.unit
        if power == 1 and law.place.unit == law.state.unit:
            return "1"
        per = f"({law.state.unit})" if "/" in law.state.unit else law.state.unit
        return f"{law.place.unit}/{per}" + (f"^{power:g}" if power != 1 else "")
    return {"lag_s": "s", "exponent": "1", "offset": "1", "phase": "1"}.get(constant, law.state.unit)


def symbol(law: Law) -> str:
    """The state in a formula."""
    name = law.state.symbol or law.state.name
    if law.state.play is not None:
        return f"played({name})"
    return f"late({name})" if law.state.lag_s is not None else name


def formula(law: Law, values: dict[str, float], number: int) -> str:
    """In one line, constants in the file's units."""
    name = law.place.name.partition(":")[2]
    prefix = f"law.{number}."
    if law.shape == TABLE:
        f = f"f({symbol(law)}), a curve"
    else:
        shape = SHAPES[law.shape]
        inner = [f"{values[prefix + c]:.4g} {law.state.unit if of else ''}".strip() for c, *_, of in shape.constants]
        inner.append(f"{law.state.span:.4g} {law.state.unit}")
        inner = [one.removesuffix(" 1") for one in inner]
        text = (law.state.positive and shape.positive) or shape.text
        text = text.replace("span", f"{{{len(inner) - 1}}}")
        for k, one in enumerate(inner):  # a number with its unit is one denominator
            text = text.replace(f"/ {{{k}}}", f"/ ({one})" if " " in one else f"/ {one}")
        ends = (f"{x:.4g} {law.state.unit}".removesuffix(" 1") for x in (law.state.low, law.state.high))
        text = text.format(*inner, s=symbol(law), now=law.state.symbol, **dict(zip(("low", "high"), ends, strict=True)))
        f = f"({values[prefix + 'strength']:.4g} {unit_of(law, 'strength')}) {text}".replace(" 1)", ")").strip()
    lag, own = "", law.state.symbol or law.state.name
    if law.state.lag_s:
        lag = f", where {symbol(law)} follows {own} with lag {values[prefix + 'lag_s']:.3g} s"
    if law.state.play:
        play = f"±{values[prefix + 'play']:.3g} {law.state.unit}"
        lag = f", where {symbol(law)} follows {own} with a {SHAPES[law.shape].name} of {play}"
    if law.place.kind == STRENGTH:
        return f"law {law.place.which + 1} {READS[STRENGTH].format(f=f)}{lag}"
    written = READS[law.place.kind].format(name=name, f=f) + lag
    return written.replace("|v|^2 v/|v|", "|v| v").replace(" |v| v/|v|", " v")


def state_names(law: Law) -> list[str]:
    """The state's name in findings."""
    if law.shape == CONSTANT:
        return []
    words = [law.state.name]
    return [*words, "history"] if law.state.remembers else words


def law_text(trial: Trial, number: int) -> str:
    """A law as Python to be pasted into a system's file."""
    one = told(trial, number)
    law = one.law
    values = trial.values
    prefix = f"law.{number}."
    head = f"# {law.says}: {one.formula}\n"
    if law.shape == TABLE:
        at = ", ".join(f"{x:.6g}" for x in law.at)
        ys = ", ".join(f"{values[f'{prefix}value{k}']:.6g}" for k in range(len(law.at)))
        return f"{head}def law(s):\n    return np.interp(s, [{at}], [{ys}])\n"
    shape = SHAPES[law.shape]
    inner = [f"{values[prefix + c]:.6g}" for c, *_ in shape.constants]
    text = {
        "": "1.0",
        "{s}": "s",
        "|{s}| {s}": "abs(s) * s",
        "{s}^2": "s**2",
        "{s}^3": "s**3",
        "sign({s}) sqrt|{s}|": "np.sign(s) * np.sqrt(abs(s))",
        "tanh({s} / {0})": "np.tanh(s / {0})",
        "(tanh({s} / {0}) + {1})": "(np.tanh(s / {0}) + {1})",
        "sign({s}) |{s} / span|^{0}": f"np.sign(s) * abs(s / {law.state.span:.6g}) ** {{0}}",
        "{s} / (1 + |{s}| / {0})": "s / (1 + abs(s) / {0})",
        "max(0, {s} - {0})": "max(0.0, s - {0})",
        "max(0, {0} - {s})": "max(0.0, {0} - s)",
        "({s} - {now})": "(s - now)",
        "sin(2 pi {s} / {0} + {1})": "np.sin(2 * np.pi * s / {0} + {1})",
        "sign({s}) max(0, |{s}| - {0})": "np.sign(s) * max(0.0, abs(s) - {0})",
        "exp(-({s} - {low}) / {0})": f"np.exp(-(s - {law.state.low:.6g}) / {{0}})",
        "exp(({s} - {high}) / {0})": f"np.exp((s - {law.state.high:.6g}) / {{0}})",
        "exp(-(({s} - {0}) / {1})^2)": "np.exp(-(((s - {0}) / {1}) ** 2))",
        "(1 + tanh(({s} - {0}) / {1})) / 2": "(1 + np.tanh((s - {0}) / {1})) / 2",
    }[shape.text].format(*inner)
    given = "s, now" if law.own else "s"
    return f"{head}def law({given}):\n    return {values[prefix + 'strength']:.6g} * {text}\n"


def as_json(one: ReportedLaw) -> dict[str, Any]:
    """Plain data."""
    return {
        "place": one.law.place.name,
        "over": "nothing" if one.law.shape == CONSTANT else one.law.over,
        "states": state_names(one.law),
        "formula": one.formula,
        "unit": one.law.place.unit,
        "constants": {k: {"value": v, "sigma": s, "unit": u} for k, (v, s, u) in one.constants.items()},
        "curve": [[float(x), float(y), float(e)] for x, y, e in one.curve.T],
    }
