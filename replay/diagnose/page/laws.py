"""The laws found: formula, constants with intervals, the curve over the state; or the curve of an unknown cause."""

from __future__ import annotations

from typing import Any

import numpy as np

from straw.replay.diagnose.figures import covariance_of
from straw.replay.diagnose.findings import Findings
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.names import words
from straw.replay.diagnose.page.fits import law_curve
from straw.replay.diagnose.page.shown import LawCurve
from straw.replay.diagnose.page.story import INTERVAL, Constant, LawTold
from straw.replay.diagnose.page.words import symbol_of
from straw.replay.diagnose.system import System

#: Points at which a formula is drawn.
POINTS = 400


def laws_of(f: Findings, system: System) -> list[LawTold]:
    """The causes of the best hypothesis, or the curve of the missing force."""
    if f.missing:
        return [_missing(law) for law in f.missing.laws]
    if not f.best or f.verdict in ("complete", "within_tolerance"):
        return []
    covariance, out = covariance_of(f.best.fit), []
    intervals = {
        system.named(k)[:2]: _interval(k, float(u), float(np.sqrt(v)))
        for k, u, v in zip(f.best.fit.unknowns, f.best.fit.u, np.diag(covariance), strict=True)
    }
    shown = system.shown()
    for cause, constants in f.parameters.items():
        law = shown.law(cause, f.best.fit, covariance)
        about = law.about if law else {}
        told = []
        for name, v in constants.items():
            symbol, what = symbol_of(name, about.get(name, ""))
            told.append(Constant(symbol, what, v["value"], *intervals[cause, name], v["unit"]))
        picture = _drawn(law.curve) if law and law.curve else ""
        out.append(LawTold(words(cause), law.formula if law else "", law.source if law else "", told, picture))
    return out


def _interval(k: Unknown, u: float, sigma: float) -> tuple[float, float]:
    """An interval in u, where the posterior is nearest to normal, within the bounds, so that strengths stay
    positive."""
    ends = (k.value(float(np.clip(u + sign * INTERVAL * sigma, k.low, k.high))) for sign in (-1, 1))
    low, high = sorted(ends)
    return low, high


def laws_say(f: Findings) -> str:
    """Introduction of the laws."""
    if f.missing and not f.discovered:
        return (
            "The curve is the best that was found; it does not make the runs held out better, so it explains nothing."
        )
    if f.missing:
        what = "formula" if f.fitted.formulas else "curve"
        which = f"this {what} over one state does" if len(f.missing.laws) == 1 else f"these two {what}s together do"
        return f"No law of the library explains the runs; {which}, on runs not fitted to."
    if f.verdict == "ambiguous" and f.best:
        return f"The best of those that survive, {words(f.best.name)}; it is not proven."
    return ""


def _missing(m: Any) -> LawTold:
    """The curve with its band, and the shortest formula that keeps its gain."""
    s = m.state
    scale, over = (1e3, "mm") if s.state_unit == "m" else (1.0, s.state_unit)
    shows = f"{s.value_symbol} / {s.value_unit}".removesuffix(" / 1")
    curve = LawCurve(scale * m.at, m.values, m.sigmas, f"{s.symbol} / {over}".removesuffix(" / 1"), shows)
    says = f"{m.noun[:1].upper()}{m.noun[1:]}"
    if m.formula is None:
        return LawTold(says, "", "", [], _drawn(curve))
    x = np.linspace(m.at[0], m.at[-1], POINTS)
    parts, told = [], []
    rows = zip(m.formula.atoms, m.formula.coefficients, m.formula.sigmas, m.formula.units, strict=True)
    for k, (atom, c, e, unit) in enumerate(rows, 1):
        parts.append(f"a_{k} {atom.named(f'c_{k}')}".strip())
        told.append(_constant(f"a_{k}", c, e, unit))
        if shape := atom.shape:
            told.append(_constant(f"c_{k}", shape.value * shape.per, shape.sigma * shape.per, shape.unit))
    told += [_constant(f"{name}_P", 1e3 * x, 1e3 * sigma, "mm") for name, x, sigma in m.further]
    keeps = f"The formula keeps {100 * m.formula.keeps:.0f} % of what the curve gains."
    picture = law_curve(curve, (scale * x, m.formula.of(x)))
    return LawTold(says, f"{m.formula.symbol} = {' + '.join(parts)}", keeps, told, f"<figure>{picture}</figure>")


def _constant(name: str, value: float, sigma: float, unit: str) -> Constant:
    return Constant(name, "", float(value), float(value - INTERVAL * sigma), float(value + INTERVAL * sigma), unit)


def _drawn(curve: LawCurve) -> str:
    return f"<figure>{law_curve(curve)}</figure>"
