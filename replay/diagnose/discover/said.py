"""Findings of a discovery in sentences: verdict, gain, remarks on the first law, and the text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from straw.replay.diagnose.discover.choose import drifts
from straw.replay.diagnose.discover.trial import TO_NOISE, of_all
from straw.replay.diagnose.discover.words import acts_in_recording

if TYPE_CHECKING:
    from straw.replay.diagnose.discover.findings import SystemFindings


#: A law that leaves more than this share of the base's error, and many times the noise, may have taken another's place.
#: One is found where held-out runs get three times better; of five times the noise less than a twentieth of the mean
#: square is noise, so that a poor estimate of it does not matter.
PART, MANY = 1 / 3, 5.0


def partly(f: SystemFindings) -> bool:
    """Whether the laws explain only a part of what the base leaves where it was held out."""
    d = f.discovery
    before, after, noise = (np.sqrt(of_all(x**2)) for x in (d.held[0], d.held[-1], d.noise))
    return bool(d.accepted) and bool(after > max(PART * before, MANY * noise))


def headline(f: SystemFindings) -> str:
    """The verdict in one sentence."""
    runs = len(f.recordings)
    these = f"{'this recording' if runs == 1 else f'these {runs} recordings'}"
    verdict = f.verdict
    if verdict == "complete":
        return f"Nothing is missing: the base model explains {these} to within their noise where nothing was fitted."
    if verdict == "within_tolerance":
        return f"Good enough: {these} are explained within the tolerance given."
    if verdict == "unknown_physics":
        place = f.best_located
        if place:
            return (
                f"Located, not explained: what is missing shows most in {place}, but the law found there from what "
                "was fitted does not improve what was held out."
            )
        if f.discovery.base.to_noise:
            return "The base model explains what was fitted, but not what was held out; hold out less of what differs."
        return f"The base model does not explain {these}, and they cannot tell what is missing."
    names = counted([one.law.said for one in f.laws])
    text = names[0] if len(names) == 1 else f"{'; '.join(names[:-1])}; and {names[-1]}"
    if verdict == "ambiguous":
        first = f.laws[0].law
        others = [
            *f.alike_places[:2],
            *(f"a law over {one}, which varies together with it" for one in f.goes_with[:1]),
        ]
        if not others and partly(f):
            others = ["something else, as this explains only a part of what the base model leaves"]
        if not others:
            by_itself = "a delay" if first.place.unit == "s" else "a drift"
            changing = drifts(first) and not acts_in_recording(first)
            what = "a law over anything else that changes with time"
            others = [what if changing else f"{by_itself} of the system itself"]
        return f"Something is missing {first.said}; {these} cannot distinguish it from {'; or '.join(others)}."
    what = "The recording is at fault" if verdict == "measurement_fault" else "The model leaves something out"
    return f"{what} {text}."


def counted(said: Sequence[str]) -> list[str]:
    """Each once, with how many laws there are of it."""
    many = {one: said.count(one) for one in said}
    return [one if k == 1 else f"{one} ({'two' if k == 2 else 'three'} laws)" for one, k in many.items()]


def gain(f: SystemFindings) -> str:
    """How far the laws reduce the error on what was held out, and what remains; empty without laws."""
    if f.verdict not in ("ambiguous", "measurement_fault", "missing_physics"):
        return ""
    d = f.discovery
    before, after = (float(np.sqrt(of_all(h**2))) for h in (d.held[0], d.held[-1]))
    form = "Its form is not determined. " if f.forms else ""
    mean = ", a geometric mean of the channels," if len(d.noise) > 1 else ""
    text = f"{form}With it the error on what was held out{mean} is {100 * after / before:.2g} % of the base model's"
    noise = float(np.sqrt(of_all(d.noise**2)))
    left = f"{after / noise:.2g} times the noise" if after > TO_NOISE * noise else "no more than noise"
    return f"{text}: {left}."


def asides(f: SystemFindings) -> list[str]:
    """Remarks on the first law, and what the others cannot be distinguished from, in sentences."""
    remarks: dict[str, Sequence[str]] = {
        "law 1 is the same law written in": f.same,
        "the form of law 1 is not determined; it may equally be": f.forms,
        "cannot be distinguished from law 1:": f.alike_places,
        "varies together with the state of law 1 in all recordings:": f.goes_with,
    }
    for number, step in enumerate(f.discovery.steps[1 : len(f.discovery.accepted)], 2):
        if step.accepted and len(step.accepted.laws) == number:
            alike = dict.fromkeys(one.laws[-1].says for one in step.alike)
            remarks[f"cannot be distinguished from law {number}:"] = list(alike)
    return [f"{words} {'; '.join(names)}" for words, names in remarks.items() if names] + spikes(f)


def spikes(f: SystemFindings) -> list[str]:
    """How many readings were left out as spikes, of each channel."""
    out = []
    for k, channel in enumerate(f.discovery.base.system.channels):
        many = sum(one.left_out[k] for one in f.recordings if one.left_out)
        every = sum(int(np.isfinite(one.seen[k]).sum()) for one in f.recordings) + many
        if many:
            of = f"{many} of {every} readings of {channel.symbol}"
            out.append(f"left out as spikes: {of} (keep_spikes = True in the system's file keeps them)")
    return out


def text(f: SystemFindings) -> str:
    """Findings for a terminal: the verdict first."""
    d, lines = f.discovery, [f.says, ""]
    for k, one in enumerate(f.laws, 1):
        lines.append(f"law {k}: {one.law.says}")
        lines.append(f"  {one.formula}")
        if len(one.constants) <= 4:
            constants = (f"{n} = {v:.4g} ± {s:.2g} {u}".removesuffix(" 1") for n, (v, s, u) in one.constants.items())
            lines.append(f"  {', '.join(constants)}")
    lines += f.asides
    if f.refused:
        lines.append(
            f"chosen from what was fitted and refused, as it does not improve the rest: {'; '.join(f.refused)}"
        )
    where = "where nothing was fitted" if any(o.held.any() for o in f.recordings) else "where it was fitted"
    for k, channel in enumerate(d.base.system.channels):
        path = " -> ".join(f"{h[k]:.4g}" for h in d.held)
        lines.append(f"{channel.symbol}, RMS {where}: {path} {channel.shown_unit}; noise {d.noise[k]:.2g}")
    return "\n".join(lines)
