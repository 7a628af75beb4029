"""Where a fit gains by a hypothesis to first order: a score test over the library (Rao 1948)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, evaluated, moved, normal_equations, step_to
from straw.replay.diagnose.hypothesis import Hypothesis
from straw.replay.diagnose.settings import FAINT, LONGEST_STEP

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Start:
    """A hypothesis with a start u (of the base's unknowns and its own) and its predicted gain there."""

    hypothesis: Hypothesis
    u: Floats
    gain: float = np.inf  # squared sigmas, to first order; NaN if unknown


def screen(
    campaign: Campaign, known: Fit, hypotheses: Sequence[Hypothesis], beside: Hypothesis | None = None
) -> list[Start]:
    """First-order fits of each hypothesis beside a given fit, the most promising first (a score test, profiled over the
    known unknowns: Rao 1948)."""
    promised: list[Start] = []
    for h, shape, slopes, columns in linearised_beside(campaign, known, hypotheses):
        u, gain = _added(replace(known, slopes=slopes), h, shape, columns)
        promised.append(Start(h.beside(beside) if beside else h, u, gain))
    return sorted(promised, key=lambda start: -start.gain)


def linearised_beside(
    campaign: Campaign, known: Fit, hypotheses: Sequence[Hypothesis]
) -> Iterator[tuple[Hypothesis, Floats, Floats, Floats]]:
    """Each hypothesis in each of its shapes, next to nothing of it beside a fit: shape (k,), and Jacobians of the fit's
    unknowns (m, n) and of its own (m, k). Those of all hypotheses are worked out in one simulation of each run."""
    for level in range(2):
        group = [(h, shape) for h in hypotheses for shape in _shapes(h)[level : level + 1]]
        unknowns = tuple(u for h, _ in group for u in h.unknowns)
        if not unknowns:
            continue
        every = (*known.unknowns, *unknowns)
        at = evaluated(campaign, every, np.concatenate([known.u, *(shape for _, shape in group)]))
        first = len(known.unknowns)
        for h, shape in group:
            columns = at.slopes[:, first : first + len(h.unknowns)]
            first += len(h.unknowns)
            yield h, shape, at.slopes[:, : len(known.unknowns)], columns


def _shapes(h: Hypothesis) -> list[Floats]:
    """The different shapes among a hypothesis' starts, with no strength: u (unknowns,)."""
    strength = np.array([k.kind == "strength" for k in h.unknowns])
    if not strength.any():
        return []
    out: list[Floats] = []
    for start in h.starts:
        shape = np.where(strength, FAINT, start)
        if not any(np.array_equal(shape, other) for other in out):
            out.append(shape)
    return out


def _added(known: Fit, h: Hypothesis, shape: Floats, columns: Floats) -> tuple[Floats, float]:
    """u with the hypothesis added by linear least squares, and its gain; strengths keep their sign."""
    n = len(known.u)
    unknowns = (*known.unknowns, *h.unknowns)
    at = np.concatenate([known.u, shape])
    H, g = normal_equations(unknowns, at, known.residual, np.hstack([known.slopes, columns]))
    free = [*range(n), *(n + k for k, u in enumerate(h.unknowns) if u.kind == "strength")]
    step = np.zeros(len(at))
    for _ in h.unknowns:
        step[:] = 0.0
        step[free] = -np.linalg.solve(H[np.ix_(free, free)], g[free])
        wrong = [k for k in free if k >= n and at[k] + step[k] < unknowns[k].low]
        if not wrong:
            break
        free = [k for k in free if k not in wrong]
    own = free[:n]
    alone = -np.linalg.solve(H[np.ix_(own, own)], g[own])
    gain = float(-g @ step - step @ H @ step / 2 - (-g[own] @ alone - alone @ H[np.ix_(own, own)] @ alone / 2))
    room = np.abs(step_to(unknowns, at, at + LONGEST_STEP * np.sign(step)))
    step *= min(1.0, float(np.min(room / np.maximum(np.abs(step), 1e-12), where=step != 0, initial=1.0)))
    return moved(unknowns, at, step), 2 * gain
