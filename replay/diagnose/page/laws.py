"""What was found, as laws: formula, constants with intervals, the curve over the state; or the curve of the unknown."""

from __future__ import annotations

from typing import Any

import numpy as np

from straw.replay.diagnose.figures import covariance_of
from straw.replay.diagnose.findings import Findings
from straw.replay.diagnose.page.fits import law_curve
from straw.replay.diagnose.page.shown import LawCurve, Shown
from straw.replay.diagnose.page.story import Constant, LawTold
from straw.replay.diagnose.page.words import words

#: Points at which a formula is drawn.
POINTS = 400


def laws_of(f: Findings, shown: Shown) -> list[LawTold]:
    """The causes of the best hypothesis, or the curve of what is missing."""
    if f.missing:
        return [_missing(f.missing)]
    if not f.best or f.verdict in ("complete", "within_tolerance"):
        return []
    covariance, out = covariance_of(f.best.fit), []
    for cause, constants in f.parameters.items():
        law = shown.law(cause, f.best.fit, covariance)
        about = law.about if law else {}
        told = []
        for name, v in constants.items():
            symbol, _, what = about.get(name, name).partition(", ")
            told.append(Constant(symbol, what, v["value"], v["sigma"], v["unit"]))
        picture = _drawn(law.curve) if law and law.curve else ""
        out.append(LawTold(words(cause), law.formula if law else "", law.source if law else "", told, picture))
    return out


def laws_say(f: Findings) -> str:
    """What is to be said before them."""
    if f.missing and not f.discovered:
        return "The curve is the best that was found; it does not make the runs held out better, so it explains nothing."
    if f.missing:
        return "No law of the library explains the runs; this curve over one state does, on runs it was not fitted to."
    if f.verdict == "ambiguous" and f.best:
        return f"The best of those that survive, {words(f.best.name)}; it is not proven."
    return ""


def _missing(m: Any) -> LawTold:
    """The curve with its band, and the shortest formula that keeps what it gains."""
    s = m.curve.state
    curve = LawCurve(m.at, m.values, m.sigmas, f"{s.symbol} / {s.state_unit}", f"{s.value_symbol} / {s.value_unit}")
    says = f"{s.says[:1].upper()}{s.says[1:]}"
    if m.formula is None:
        return LawTold(says, "", "", [], _drawn(curve))
    x = np.linspace(m.at[0], m.at[-1], POINTS)
    names = [f"a_{k}" for k in range(1, len(m.formula.atoms) + 1)]
    parts = (f"{name} {atom.text}".strip() for name, atom in zip(names, m.formula.atoms, strict=True))
    told = [
        Constant(name, "", float(c), float(e), unit)
        for name, c, e, unit in zip(names, m.formula.coefficients, m.formula.sigmas, m.formula.units, strict=True)
    ]
    keeps = f"The formula keeps {100 * m.formula.keeps:.0f} % of what the curve gains."
    picture = law_curve(curve, (x, m.formula.of(x)))
    return LawTold(says, f"{m.formula.symbol} = {' + '.join(parts)}", keeps, told, f"<figure>{picture}</figure>")


def _drawn(curve: LawCurve) -> str:
    return f"<figure>{law_curve(curve)}</figure>"
