"""Findings of a discovery: verdict, laws with constants and bands, places, and the held-out error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.discover.choose import drifts
from straw.replay.diagnose.discover.rounds import Discovery, Step
from straw.replay.diagnose.discover.said import asides, gain, headline, partly
from straw.replay.diagnose.discover.trial import TO_NOISE, Trial
from straw.replay.diagnose.discover.words import ReportedLaw, acts_in_recording, as_json, is_fault, law_text, told
from straw.replay.diagnose.systems.function.passed import passed
from straw.replay.diagnose.systems.function.places import makes_sense, states, together
from straw.replay.diagnose.systems.function.recording import Recorded

Floats = NDArray[np.float64]

#: Bootstrap samples of the blocks for the choice among laws (bootstrap of a selection: Efron 2014).
RESAMPLED = 500
#: Number of intervals reported.
MOST_LOCATED = 12


@dataclass(frozen=True, eq=False)
class SystemFindings:
    """A discovery with its recordings; ``tolerance`` by channel is the RMS that may remain."""

    discovery: Discovery
    recordings: tuple[Recorded, ...]
    tolerance: Mapping[str, float] = field(default_factory=dict)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names."""
        return tuple(c.name for c in self.discovery.base.system.channels)

    @cached_property
    def laws(self) -> list[ReportedLaw]:
        """Laws accepted, in order."""
        return [told(self.discovery.best, k) for k in range(len(self.discovery.best.laws))]

    @cached_property
    def first_step(self) -> Step | None:
        """The round in which the first law was accepted: earlier ones may have become redundant."""
        rounds = [step for step in self.discovery.steps if self.laws and step.accepted]
        return next((r for r in rounds if r.accepted and r.accepted.laws[-1].says == self.laws[0].law.says), None)

    @cached_property
    def alike(self) -> list[Trial]:
        """Laws that explain the recordings as well as the first one and differ from it."""
        return list(self.first_step.alike) if self.first_step else []

    @property
    def verdict(self) -> str:
        """The contract's verdict."""
        d = self.discovery
        held, noise = d.held[-1], d.noise
        if not d.accepted and np.all(held <= TO_NOISE * noise):
            return "complete"
        if self.tolerance and all(h <= self.tolerance.get(c, np.inf) for c, h in zip(self.channels, held, strict=True)):
            return "within_tolerance"
        if not d.accepted:
            return "unknown_physics"
        faults = [is_fault(one) for one in self.laws]
        first = [acts_in_recording(one.laws[-1]) for one in self.alike]
        others = any(one != acts_in_recording(d.best.laws[0]) for one in first) or len(self.alike_places) > 2
        if others or faults[0] is None or self.goes_with or drifts(d.best.laws[0]) or partly(self):
            return "ambiguous"
        return "measurement_fault" if all(faults) else "missing_physics"

    @cached_property
    def goes_with(self) -> list[str]:
        """States that correlate with the first law's in all recordings, so that they cannot be distinguished."""
        if not self.laws:
            return []
        trial, law = self.discovery.base, self.laws[0].law
        seen = passed(trial.system, self.discovery.searched, trial.values)
        others = [one for one in states(trial.system, seen) if makes_sense(law.place, one)]
        return together(law.state, others, seen)

    @property
    def same(self) -> list[str]:
        """Other places in which the first law is the same law, in words."""
        return list(dict.fromkeys(one.laws[-1].says for one in self.first_step.same)) if self.first_step else []

    @property
    def forms(self) -> tuple[str, ...]:
        """Other forms that the first law may have as well."""
        return self.first_step.forms if self.first_step else ()

    @property
    def alike_places(self) -> list[str]:
        """Places and states that cannot be distinguished from the first law, in words."""
        return list(dict.fromkeys(one.laws[-1].says for one in self.alike))

    @cached_property
    def located(self) -> list[dict[str, Any]]:
        """Intervals in which the base is off most."""
        trial, rows = self.discovery.base, []
        for one in self.recordings:
            shown = trial.system.simulated(one, trial.fit.unknowns, trial.fit.u)
            for part in one.stretches():
                here = (one.time_s >= part.from_s) & (one.time_s <= part.to_s)
                for k, channel in enumerate(self.channels):
                    off = (shown - one.seen)[k, here]
                    off = off[np.isfinite(off)]
                    square = float(np.sum(np.maximum(off**2 - one.noise[k] ** 2, 0.0)) / trial.unit[k] ** 2)
                    rows.append((square, one.name, channel, part, float(np.sqrt(np.mean(off**2))) if len(off) else 0.0))
        total = sum(row[0] for row in rows) or 1.0
        rows.sort(key=lambda row: -row[0])
        return [
            {
                "run": name,
                "channel": channel,
                "from_s": part.from_s,
                "to_s": part.to_s,
                "phase": part.phase,
                "cells": [],
                "share_of_misfit": square / total,
                "rms": rms,
            }
            for square, name, channel, part, rms in rows[:MOST_LOCATED]
            if square / total > 0.01
        ]

    @cached_property
    def probability(self) -> dict[str, float]:
        """How often each law comes first when the blocks are resampled, the largest first."""
        if self.verdict == "complete":
            return {"complete": 1.0}
        step = self.first_step
        if step is None:
            return {"unknown": 1.0}
        names, errors = [self.laws[0].law.says, *(one.laws[-1].says for one in step.alike)], step.errors
        rng = np.random.default_rng(0)
        drawn = rng.multinomial(errors.shape[1], np.full(errors.shape[1], 1 / errors.shape[1]), RESAMPLED)
        firsts = np.argmin(errors @ drawn.T, axis=0)
        out: dict[str, float] = {}
        for k, name in enumerate(names):
            out[name] = out.get(name, 0.0) + float(np.mean(firsts == k))
        return dict(sorted(out.items(), key=lambda item: -item[1]))

    @property
    def explained(self) -> list[dict[str, Any]]:
        """Share of the base's held-out mean squared misfit above noise that each law explains."""
        d = self.discovery
        whole = np.maximum(d.held[0] ** 2 - d.noise**2, 1e-300)
        out = []
        for k, law in enumerate(self.laws):
            share = (d.held[k] ** 2 - d.held[k + 1] ** 2) / whole
            out.append(
                {"cause": law.law.says, "share": {c: float(s) for c, s in zip(self.channels, share, strict=True)}}
            )
        return out

    @property
    def remainder(self) -> Floats:
        """Held-out RMS above noise that remains, (channels,)."""
        return np.sqrt(np.maximum(self.discovery.held[-1] ** 2 - self.discovery.noise**2, 0.0))

    @property
    def headline(self) -> str:
        """The verdict in one sentence."""
        return headline(self)

    @property
    def gain(self) -> str:
        """How far the laws reduce the error on what was held out, in one sentence; empty without laws."""
        return gain(self)

    @property
    def says(self) -> str:
        """The verdict, and where there are laws how far they reduce the error, in a sentence each."""
        return f"{self.headline} {self.gain}".strip()

    @property
    def asides(self) -> list[str]:
        """Remarks on the first law, in sentences."""
        return asides(self)

    @property
    def refused(self) -> list[str]:
        """Laws chosen from what was fitted that did not improve what was held out, in words."""
        d = self.discovery
        kept = [law.says for law in d.best.laws]
        return [law.says for law in d.chosen[-1].laws if law.says not in kept] if d.refused else []

    @property
    def best_located(self) -> str:
        """Place and state of the first law where all were refused, in words; empty where none was chosen."""
        refused = [] if self.discovery.accepted else self.discovery.chosen
        return refused[0].laws[-1].says if refused else ""

    def as_json(self) -> dict[str, Any]:
        """The contract's Findings."""
        d = self.discovery
        held = dict(zip(("rms_before", "rms_after"), (d.held[0], d.held[-1]), strict=True))
        names = [c.name for c in d.base.system.channels]
        discovered = None
        if self.laws:
            first = as_json(self.laws[0])
            laws = [as_json(one) for one in self.laws]
            text = "\n".join(law_text(d.best, k) for k in range(len(self.laws)))
            discovered = {**first, "cells": [], "law": text, "laws": laws}
        return {
            "verdict": self.verdict,
            "says": self.says,
            "causes": [one.law.place.name for one in self.laws] or ([] if self.verdict == "complete" else ["unknown"]),
            "probability": self.probability,
            "located": self.located,
            "parameters": {
                "base": {
                    k.target.partition(".")[2]: {"value": k.value(float(u)), "unit": d.base.system.named(k)[2]}
                    for k, u in zip(d.best.fit.unknowns, d.best.fit.u, strict=True)
                    if k.target.startswith("constant.")
                },
                **{one.law.place.name: as_json(one)["constants"] for one in self.laws},
            },
            "fit": {
                "train": {
                    "runs": [o.name for o in self.recordings if o.fitted.any()],
                    "rms_before": dict(zip(names, map(float, np.sqrt(d.base.squared)), strict=True)),
                    "rms_after": dict(zip(names, map(float, np.sqrt(d.best.squared)), strict=True)),
                },
                "heldout": {
                    "runs": [o.name for o in self.recordings if o.held.any()],
                    **{k: dict(zip(names, map(float, v), strict=True)) for k, v in held.items()},
                    "noise_floor": dict(zip(names, map(float, d.noise), strict=True)),
                },
            },
            "explained": self.explained,
            "remainder": dict(zip(names, map(float, self.remainder), strict=True)),
            "discovered": discovered,
            "indistinguishable": [[self.laws[0].law.says, *self.alike_places]] if self.alike_places else [],
            "goes_together": self.goes_with,
            "written_otherwise": self.same,
            "forms": list(self.forms),
            "refused": self.refused,
            "next_experiment": None,
            "system": {"file": d.base.system.model.path.name, "sha256": d.base.system.model.sha256},
        }
