"""A discovery as the page of a diagnosis, for a user's own system."""

from __future__ import annotations

import html

import numpy as np

from straw.replay.diagnose.discover.findings import SystemFindings
from straw.replay.diagnose.discover.words import ReportedLaw, law_text
from straw.replay.diagnose.formed import Model
from straw.replay.diagnose.page.fits import law_curve, left_over
from straw.replay.diagnose.page.player import played
from straw.replay.diagnose.page.shown import LawCurve
from straw.replay.diagnose.page.story import INTERVAL, Constant, Error, LawTold, Rival, Story
from straw.replay.diagnose.page.words import and_, sig
from straw.replay.diagnose.page.write import table, written
from straw.replay.diagnose.systems.function.shapes import TABLE

#: Recordings whose fit is drawn.
DRAWN = 2


def page(f: SystemFindings) -> str:
    """The page's HTML; needs no network."""
    return written(story(f))


def story(f: SystemFindings) -> Story:
    """The page's contents."""
    d, shown = f.discovery, f.discovery.base.system.shown()
    after = Model(d.best.campaign, d.best.fit) if f.laws else None
    held = [one for one in f.recordings if one.held.any()]
    return Story(
        says=f.headline,
        where=f"{d.base.system.model.title.rstrip('.')}. {_where(f)}{_gain(f)}",
        picture=shown.picture(None, (), [one.law.place.name for one in f.laws]),
        runs=played(f.recordings, Model(d.base.campaign, d.base.fit), after, {one.name for one in held}),
        improved=after is not None,
        fitted_say=_unfitted(f),
        laws=[_law(one, k, len(f.laws)) for k, one in enumerate(f.laws, 1)],
        errors=_errors(f),
        errors_say=_errors_say(f),
        fits=_fits(f),
        rivals=[Rival(name, p, chosen=k == 0) for k, (name, p) in enumerate(f.probability.items())] if f.laws else (),
        rivals_say="How often each law comes first when the blocks of the recordings are resampled.",
        unseen_says=_unseen(f),
        doubts=[f"{one[:1].upper()}{one[1:]}." for one in f.asides] + _refused(f),
        next_says="Of a system of your own none is proposed: record one more that passes through states which these do "
        "not, and give it with --hold-out." if f.verdict in ("ambiguous", "unknown_physics") else "",
        details=_details(f),
    )  # fmt: skip


def _unfitted(f: SystemFindings) -> str:
    names = [one.name for one in f.recordings if one.held.any() and not one.fitted.any()]
    return f"Neither a fit nor the choice of laws saw {and_(names)}." if names else ""


def _where(f: SystemFindings) -> str:
    if not f.located:
        return "The base model is off nowhere beyond noise."
    x = f.located[0]
    return f"The base model is off most in {x['run']}, in {x['channel']}, from {x['from_s']:.3g} to {x['to_s']:.3g} s."


def _gain(f: SystemFindings) -> str:
    """The laws' improvement, in one sentence."""
    if not f.laws:
        return ""
    d = f.discovery
    parts = [
        f"{c.symbol} from {sig(d.held[0][k])} to {sig(d.held[-1][k])} {c.shown_unit} (noise {sig(d.noise[k])})"
        for k, c in enumerate(d.base.system.channels)
    ]
    form = " Its form is not determined." if f.forms else ""
    return f" {_there(f)}, the misfit decreases: {'; '.join(parts)}.{form}"


def _refused(f: SystemFindings) -> list[str]:
    """What was chosen and refused, in a sentence with its errors."""
    d = f.discovery
    if not f.refused:
        return []
    without = "without" if d.accepted else "of the base"
    parts = [
        f"{c.symbol} {sig(d.asked[-1][k])} {c.shown_unit} against {sig(d.held[-1][k])} {without}"
        for k, c in enumerate(d.base.system.channels)
    ]
    return [
        f"Chosen from what was fitted and refused: {and_(f.refused)}. With it, where nothing was fitted: "
        f"{'; '.join(parts)}."
    ]


def _there(f: SystemFindings) -> str:
    return "Where nothing was fitted" if any(o.held.any() for o in f.recordings) else "Where it was fitted"


def _law(one: ReportedLaw, number: int, of: int) -> LawTold:
    name = one.law.said[:1].upper() + one.law.said[1:]
    constants = [
        Constant(n, "", v, v - INTERVAL * s, v + INTERVAL * s, unit) for n, (v, s, unit) in one.constants.items()
    ]
    picture = ""
    if one.law.curved:
        place, state = one.law.place, one.law.state
        labels = (
            f"{x} / {unit}".removesuffix(" / 1") for x, unit in ((state.name, state.unit), (place.says, place.unit))
        )
        picture = f"<figure>{law_curve(LawCurve(*one.curve, *labels))}</figure>"
    shown = [] if one.law.shape == TABLE else constants
    return LawTold(f"{number}. {name}" if of > 1 else name, one.formula, "", shown, picture)


def _errors(f: SystemFindings) -> list[Error]:
    d, out = f.discovery, []
    for k, c in enumerate(d.base.system.channels):
        shares = [f"{_the_law(f, n)} {100 * one['share'][c.name]:.0f} %" for n, one in enumerate(f.explained, 1)]
        told = f"explained of the mean square above noise: {', '.join(shares)}" if shares else ""
        after = float(d.held[-1][k]) if f.laws else None
        out.append(Error(c.symbol, c.shown_unit, float(d.held[0][k]), after, float(d.noise[k]), told))
    return out


def _errors_say(f: SystemFindings) -> str:
    names = [o.name for o in f.recordings if o.held.any() and not o.fitted.any()]
    unseen = ", which neither a fit nor the choice of laws saw"
    where = f"in {and_(names)}{unseen}" if names else _there(f).lower()
    misfit = f"Misfit is the root mean square (RMS) of simulated minus measured {where}."
    return f"{misfit} Noise is what a perfect model would leave."


def _the_law(f: SystemFindings, number: int) -> str:
    return "the law" if len(f.laws) == 1 else f"law {number}"


def _fits(f: SystemFindings) -> list[tuple[str, str]]:
    d, out = f.discovery, []
    for one in sorted(f.recordings, key=lambda o: (not o.held.any(), o.fitted.any(), o.name))[:DRAWN]:
        before = d.base.system.simulated(one, d.base.fit.unknowns, d.base.fit.u)
        after = d.best.system.simulated(one, d.best.fit.unknowns, d.best.fit.u) if f.laws else None
        partly = one.fitted.any() and one.held.any()
        caption = f"{one.name}: simulated minus measured{'; grey: what was fitted' if partly else ''}."
        fitted = one.fitted if partly else None
        out.append((left_over(one, d.base.system.channels, before, after, fitted), caption))
    return out


def _unseen(f: SystemFindings) -> str:
    d = f.discovery
    channels = d.base.system.channels
    noise = and_([f"{sig(n)} {c.shown_unit} in {c.symbol}" for n, c in zip(d.noise, channels, strict=True)])
    left = [f"{sig(r)} {c.shown_unit} in {c.symbol}" for r, c in zip(f.remainder, channels, strict=True) if r > 0]
    rest = f" What remains above noise, {and_(left)} (RMS), is not explained by anything here." if left else ""
    states = "".join(
        f" Nothing is known of {_the_law(f, k)} outside {one.law.state.name} = {sig(one.law.state.low)} to "
        f"{sig(one.law.state.high)} {one.law.state.unit}.".replace(" 1.", ".")
        for k, one in enumerate(f.laws, 1)
        if one.law.curved
    )
    return f"Effects smaller than the noise ({noise}).{rest}{states}"


def _details(f: SystemFindings) -> list[tuple[str, str]]:
    d, out = f.discovery, []
    if f.located:
        places = [
            (x["run"], x["channel"], f"{x['from_s']:.3g} to {x['to_s']:.3g} s", f"{100 * x['share_of_misfit']:.0f} %")
            for x in f.located[:8]
        ]
        head = ("recording", "channel", "time", "share of squared misfit")
        out.append(("Where the base is off most", table(head, places)))
    tried = [one for step in d.steps for one in step.fitted if one not in d.accepted][:8]
    if tried:
        rows = [(one.laws[-1].says, f"{100 * np.sqrt(one.predicts / d.base.predicts):.1f} %") for one in tried]
        out.append(("What else was fitted", table(("law", "error of prediction, of the base's"), rows)))
    better = {k.target: k.value(float(u)) for k, u in zip(d.best.fit.unknowns, d.best.fit.u, strict=True)}
    constants = [
        (*d.base.system.named(k)[1:2], sig(k.value(float(u))), sig(better[k.target]), d.base.system.named(k)[2])
        for k, u in zip(d.base.fit.unknowns, d.base.fit.u, strict=True)
    ]
    if constants:
        out.append(("The base's constants", table(("constant", "base alone", "beside the laws", "unit"), constants)))
    if f.laws:
        code = "\n".join(law_text(d.best, k) for k in range(len(f.laws)))
        out.append(("The law as Python", f"<pre>{html.escape(code)}</pre>"))
    model = d.base.system.model
    about = f"<p class=facts>{html.escape(model.path.name)}, SHA-256 {model.sha256[:16]}…</p>"
    return [*out, ("The system", about)]
