"""The result of `straw diagnose` as a story: gathers the page's contents from findings, fits and the system."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from straw.replay.diagnose.figures import smallest_seen
from straw.replay.diagnose.findings import Findings
from straw.replay.diagnose.formed import Model
from straw.replay.diagnose.heldout import noise_floor, plain_rms
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.names import words
from straw.replay.diagnose.page.details import details
from straw.replay.diagnose.page.fits import left_over
from straw.replay.diagnose.page.laws import laws_of, laws_say
from straw.replay.diagnose.page.player import played
from straw.replay.diagnose.page.shown import Shown
from straw.replay.diagnose.page.story import Error, Next, Rival, Story
from straw.replay.diagnose.page.words import and_, raised, sig, symbol_of
from straw.replay.diagnose.page.write import written

#: Largest number of other explanations shown.
RIVALS = 6


def report(findings: Findings, found: Inquiry) -> str:
    """The page's HTML; needs no network. The inquiry's workers must still be there."""
    return written(story(findings, found))


def story(f: Findings, found: Inquiry) -> Story:
    """The page's contents."""
    campaign = found.campaign
    shown = campaign.system.shown()
    places = sorted({cell for one in f.located for cell in one.cells}) if f.located else []
    errors, errors_say, fits = _before_and_after(f, found)
    unseen, unseen_says = _unseen(f, found)
    return Story(
        says=f.says,
        where=" ".join(filter(None, [f.where, _gain(f, campaign.system.channels)])),
        picture=shown.picture(
            f.model, places, [law.place for law in f.missing.laws] if f.missing and f.discovered else f.causes
        ),
        runs=played(
            campaign.observations,
            Model(campaign, found.null),
            f.fitted if f.improved else None,
            f.held.heldout if f.held else (),
        ),
        improved=f.improved,
        laws=laws_of(f, campaign.system),
        laws_head=_laws_head(f),
        laws_say=laws_say(f),
        errors=errors,
        errors_say=errors_say,
        fits=fits,
        rivals=_rivals(f, found),
        rivals_say="Probabilities of all hypotheses that were tried. "
        + _definition("in all runs", campaign.system.channels),
        channels=[f"{c.symbol} / {c.shown_unit}" for c in campaign.system.channels],
        unseen=unseen,
        unseen_says=unseen_says,
        doubts=f.notes,
        next=_next(f, shown),
        next_says=_nothing_next(f),
        details=details(f, found),
    )


def _laws_head(f: Findings) -> str:
    if f.missing and not f.discovered:
        return "The nearest that was found"
    return "The laws" if f.missing and len(f.missing.laws) > 1 else "The law"


def _gain(f: Findings, channels: Sequence[Any]) -> str:
    """The improved model's held-out improvement, in one sentence."""
    held = f.held
    if held is None or not f.improved:
        return ""
    parts = []
    for c in channels:
        before, after, floor = (sig(c.shown_per_si * row[c.name]) for row in (held.before, held.after, held.floor))
        parts.append(f"{c.symbol} from {before} to {after} {c.shown_unit} (noise {floor})")
    where = f"{and_(held.heldout)}, which {'was' if len(held.heldout) == 1 else 'were'} not fitted,"
    return f"In {where} the misfit decreases: {'; '.join(parts)}."


def _definition(where: str, channels: Sequence[Any]) -> str:
    names = ", ".join(c.symbol for c in channels)
    return f"Misfit is the root mean square (RMS) of simulated minus measured {where}, in {names}."


def _before_and_after(f: Findings, found: Inquiry) -> tuple[list[Error], str, list[tuple[str, str]]]:
    """RMS by channel on the runs held out (where there are none: in all, of the base alone), and their pictures."""
    campaign, channels = found.campaign, found.campaign.system.channels
    held = f.held
    if held is None:
        rms, floor = plain_rms(campaign, found.null.unknowns, found.null.u), noise_floor(campaign)
        errors = [_error(c, rms[c.name], None, floor[c.name], "") for c in channels]
        few = f"{_definition('in all runs', channels)} Nothing was held out."
        return errors, few, []
    after = f.improved
    share = held.explained() if after else []
    errors = []
    for c in channels:
        told = ""
        if share:
            parts = (f"{words(one['cause'])} {100 * one['share'][c.short]:.0f} %" for one in share)
            told = f"explained of the mean square above noise: {', '.join(parts)}"
        errors.append(_error(c, held.before[c.name], held.after[c.name] if after else None, held.floor[c.name], told))
    where = f"in {and_(held.heldout)}, which {'was' if len(held.heldout) == 1 else 'were'} not fitted"
    says = f"{_definition(where, channels)} Fitted here: {and_(held.train)}. Noise is what a perfect model would leave."
    runs = [o for o in campaign.observations if o.name in held.lines]
    fits = []
    for o in runs:
        before, improved = held.lines[o.name]
        caption = f"{o.name}, not fitted: simulated minus measured."
        fits.append((left_over(o, channels, before, improved if after else None), caption))
    return errors, says, fits


def _error(c: Any, before: float, after: float | None, noise: float, told: str) -> Error:
    scale = c.shown_per_si
    return Error(c.symbol, c.shown_unit, scale * before, None if after is None else scale * after, scale * noise, told)


def _rivals(f: Findings, found: Inquiry) -> list[Rival]:
    """The most probable hypotheses, with the misfit of each in all runs."""
    fits = {"complete": found.null, **{c.name: c.fit for c in found.contestants}}
    channels, out = found.campaign.system.channels, []
    for name, p in list(f.judgement.probability.items())[:RIVALS]:
        leaves: list[str] = []
        if name in fits:
            rms = plain_rms(found.campaign, fits[name].unknowns, fits[name].u)
            leaves = [f"{c.shown_per_si * rms[c.name]:.3g}" for c in channels]
        chosen = set(name.split("+")) == set(f.causes) or name == f.verdict
        out.append(Rival(words(name) + (": the base model" if name == "complete" else ""), p, leaves, chosen))
    return out


def _unseen(f: Findings, found: Inquiry) -> tuple[list[tuple[str, str, str]], str]:
    """The smallest effect of each cause that these runs would have shown beside what explains them."""
    best = f.best.fit if f.best and f.verdict != "ambiguous" else found.null
    if not found.whole or f.verdict in ("unknown_physics", "ambiguous"):
        return [], "While the runs are not explained, no limit can be given for what else may act beside."
    causes = f.best.hypothesis.causes if f.best else ()
    sizes = f.smallest or smallest_seen(found.campaign, found, beside=best, but=causes)
    beside = f"beside {and_([words(c) for c in causes])}" if causes else "in these runs"
    rows = []
    for cause, size in sorted(sizes.items()):
        name, _, least = size.partition(" ")
        symbol, what = symbol_of(name, found.campaign.system.shown().about(cause).get(name, ""))
        number, _, unit = least.partition(" ")
        size_ = f"{sig(float(number))} {raised(unit)}".removesuffix(" 1")
        rows.append((words(cause), what or symbol, size_))
    return (
        rows,
        f"Smaller effects may be there: each would have been seen {beside} from this size on, to first order.",
    )


def _next(f: Findings, shown: Shown) -> Next | None:
    if not f.experiment:
        return None
    e = f.experiment
    apart = f"expected to set them {e.expected_separation_sigma:.0f} standard deviations apart"
    return Next(f"{e.why[:1].upper()}{e.why[1:]}; {apart}.", shown.experiment(e), e.protocol)


def _nothing_next(f: Findings) -> str:
    if f.verdict in ("ambiguous", "unknown_physics"):
        return "None of the candidate experiments would distinguish the hypotheses."
    return "None is needed: there are no hypotheses left to distinguish."
