"""The proposal for a campaign: every cause with a score, hypotheses in the order to be tried, and starts for fits.

Scores are no verdict: exact fits decide. The network is evaluated twice, beside the given straw and beside the one with
base constants as estimated the first time (Papamakarios and Murray 2016: sequential proposals): scores are of both,
starts of the second.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.propose.dataset import Number
from straw.replay.diagnose.propose.features import features
from straw.replay.diagnose.propose.learned import Learned, shipped
from straw.replay.diagnose.propose.network import LOG_SD
from straw.replay.diagnose.propose.seen import observed
from straw.replay.diagnose.systems.straw.constants import applied, base_unknowns
from straw.replay.diagnose.systems.straw.library import causes
from straw.replay.diagnose.systems.straw.observation import Observation

Floats = NDArray[np.float64]

#: Beyond this quantile of held-out campaigns a campaign is outside the training distribution: every cause is tried.
UNFAMILIAR = 0.995
#: Weight of an untrained cause, relative to the mean share of the trained ones.
AS_KNOWN = 1.0


@dataclass(frozen=True)
class Start:
    """A start of one unknown: u and its spread (one deviation), u of the library.

    ``size_u``: magnitude of a signed strength; ``positive``: the probability of a plus.
    """

    unknown: Unknown
    u: float
    spread: float
    size_u: float | None = None
    positive: float = 1.0


@dataclass(frozen=True)
class Proposal:
    """What to try for a campaign.

    ``scores`` (0 to 1) of every cause of the library, highest first; ``hypotheses`` are names of causes that act
    together, () for none, with their weights, in the order to be tried. ``base`` are starts for the base's constants,
    beside the straw that was given; ``starts`` those of each cause's unknowns, in the library's order. ``distance`` is
    the share of held-out campaigns that lie nearer to the training data; ``disagreement`` the deviation between members
    of the ensemble in their most uncertain score. ``unknown_to_it`` are untrained causes.
    """

    scores: Mapping[str, float]
    hypotheses: tuple[tuple[tuple[str, ...], float], ...]
    base: tuple[Start, ...]
    starts: Mapping[str, tuple[Start, ...]]
    distance: float
    disagreement: float
    unknown_to_it: tuple[str, ...]
    runs_left_out: tuple[str, ...]

    @property
    def familiar(self) -> bool:
        """Whether the campaign is within the training distribution; if not, every cause is to be tried."""
        return self.distance < UNFAMILIAR

    def start(self, names: Sequence[str]) -> tuple[tuple[Start, ...], ...]:
        """Starts for a fit of the base's constants with these causes: one, or two where a sign is open."""
        of_base = self.base
        parts = [self._ways(name) for name in names]
        return tuple(of_base + sum(way, ()) for way in itertools.product(*parts))

    def _ways(self, name: str) -> list[tuple[Start, ...]]:
        known = self.starts[name]
        signed = [s for s in known if s.size_u is not None]
        if len(signed) != 1 or not 0.1 < signed[0].positive < 0.9 or signed[0].size_u is None:
            return [known]
        size, more = signed[0].size_u, 1 if signed[0].positive >= 0.5 else -1
        return [
            tuple(Start(s.unknown, sign * size, s.spread, size, s.positive) if s is signed[0] else s for s in known)
            for sign in (more, -more)
        ]


def propose(
    observations: Sequence[Observation],
    straw: StrawParameters,
    library: Sequence[str] | None = None,
    learned: Learned | None = None,
) -> Proposal:
    """Propose causes, hypotheses and starts for a campaign of one specimen, beside its nominal straw.

    ``library`` names the causes to weigh, all of them where it is None. Takes a simulation of each run twice and some
    milliseconds more. A run that the straw cannot follow is left out; where none is left all scores are priors.
    """
    learned = learned or shipped()
    names = tuple(library if library is not None else causes(straw.cells))
    first, left_out = _asked(observations, straw, learned)
    if first is None:
        return _nothing_seen(straw, names, learned, left_out)
    base = base_unknowns(straw)
    u = np.array([s.u for s in _base(first, straw)])
    try:
        nearer, _ = applied(straw, base, u)
        second, _ = _asked(observations, nearer, learned)
    except ModelError:
        second = None
    if second is None:
        return _proposal(first, straw, np.zeros(len(base)), names, learned, left_out)
    both = replace(second, logits=(first.logits + second.logits) / 2)
    return _proposal(both, straw, u, names, learned, left_out)


@dataclass(frozen=True, eq=False)
class _Said:
    """The ensemble's output: logits (members, causes), mean and deviation of each number by name, distance."""

    logits: Floats
    numbers: Mapping[str, tuple[float, float]]
    distance: float


def _asked(
    observations: Sequence[Observation], straw: StrawParameters, learned: Learned
) -> tuple[_Said | None, tuple[str, ...]]:
    runs = [observed(o, straw) for o in observations]
    left_out = tuple(o.name for o, run in zip(observations, runs, strict=True) if run is None)
    seen = [run for run in runs if run is not None]
    if not seen:
        return None, left_out
    x = features(seen)
    said = np.stack(learned.ask(x)).astype(np.float64)
    many, names = len(learned.about["causes"]), learned.about["numbers"]
    means, log_sds = said[:, many : many + len(names)], said[:, many + len(names) :]
    mean = means.mean(axis=0)
    spread = np.sqrt(np.mean(np.exp(2 * np.clip(log_sds, *LOG_SD)), axis=0) + means.var(axis=0))
    scales = learned.about["scales"]
    told = {name: (float(m) * k, float(s) * k) for name, m, s, k in zip(names, mean, spread, scales, strict=True)}
    distance = learned.familiar.quantile(learned.scaling(x))
    return _Said(said[:, :many] / learned.about["temperature"], told, distance), left_out


def _number(said: _Said, number: Number) -> tuple[float, float] | None:
    """u of a number and its spread; None for untrained ones."""
    return said.numbers.get(number.name)


def _base(said: _Said, straw: StrawParameters) -> tuple[Start, ...]:
    out = []
    for unknown in base_unknowns(straw):
        u, spread = _number(said, Number("", unknown)) or (unknown.mean, unknown.sd)
        out.append(Start(unknown, float(np.clip(u, unknown.low, unknown.high)), spread))
    return tuple(out)


def _starts(said: _Said | None, straw: StrawParameters, name: str) -> tuple[Start, ...]:
    out = []
    for one in causes(straw.cells)[name][0]:
        known = None if said is None else _number(said, Number(name, one))
        u, spread = known or (one.at(1.0) if one.kind == "strength" else one.mean, one.sd)
        size = None if said is None else _number(said, Number(name, one, True))
        size_u = None if size is None else max(size[0], 0.1)
        positive = 1.0 if size_u is None else float(np.clip(0.5 * (1 + u / size_u), 0.0, 1.0))
        out.append(Start(one, float(np.clip(u, one.low, one.high)), spread, size_u, positive))
    return tuple(out)


def _proposal(
    said: _Said,
    straw: StrawParameters,
    moved: Floats,
    names: tuple[str, ...],
    learned: Learned,
    left_out: tuple[str, ...],
) -> Proposal:
    column = {name: k for k, name in enumerate(learned.about["causes"])}
    taught = [name for name in names if name in column]
    prior = AS_KNOWN * float(np.mean(learned.about["prior"]))
    p = 1 / (1 + np.exp(-said.logits))
    scores = {name: float(p[:, column[name]].mean()) if name in column else prior for name in names}
    scores = dict(sorted(scores.items(), key=lambda item: -item[1]))
    each = np.stack([p[:, column[n]] if n in column else np.full(len(p), prior) for n in names], axis=1)
    base = tuple(
        Start(one, float(np.clip(u + more.u, one.low, one.high)), more.spread)
        for one, u, more in zip(base_unknowns(straw), moved, _base(said, straw), strict=True)
    )
    return Proposal(
        scores,
        _hypotheses(names, each),
        base,
        {name: _starts(said, straw, name) for name in names},
        said.distance,
        float(np.max(p.std(axis=0))) if taught else 0.0,
        tuple(name for name in names if name not in column),
        left_out,
    )


def _hypotheses(names: tuple[str, ...], p: Floats) -> tuple[tuple[tuple[str, ...], float], ...]:
    """All sets of at most two causes by weight: each member of the ensemble takes causes as independent (members,
    causes), their mean does not."""
    p = np.clip(p, 1e-6, 1 - 1e-6)
    odds, nothing = p / (1 - p), np.prod(1 - p, axis=1)
    weights: dict[tuple[str, ...], float] = {(): float(nothing.mean())}
    for k, name in enumerate(names):
        weights[(name,)] = float((nothing * odds[:, k]).mean())
        for j in range(k):
            weights[(names[j], name)] = float((nothing * odds[:, k] * odds[:, j]).mean())
    total = sum(weights.values())
    return tuple(sorted(((key, w / total) for key, w in weights.items()), key=lambda item: -item[1]))


def _nothing_seen(
    straw: StrawParameters, names: tuple[str, ...], learned: Learned, left_out: tuple[str, ...]
) -> Proposal:
    """The prior as a proposal, where no run could be simulated."""
    known = dict(zip(learned.about["causes"], learned.about["prior"], strict=True))
    mean = AS_KNOWN * float(np.mean(list(known.values())))
    scores = {name: float(known.get(name, mean)) for name in names}
    base = tuple(Start(one, one.mean, one.sd) for one in base_unknowns(straw))
    return Proposal(
        scores,
        _hypotheses(names, np.array([list(scores.values())])),
        base,
        {name: _starts(None, straw, name) for name in names},
        1.0,
        1.0,
        tuple(name for name in names if name not in known),
        left_out,
    )
