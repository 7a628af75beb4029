"""The base model's fit: channel and damping of an unmeasured specimen, from any start."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Fit, fits_from, fitted
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.judge import run_by_run
from straw.replay.diagnose.recording import Recording
from straw.replay.diagnose.refine import refined
from straw.replay.diagnose.settings import FIRST_ROUNDS, FOLLOWED, NOISE_LEAVES, ROUNDS
from straw.replay.diagnose.systems.straw.constants import base_unknowns
from straw.replay.diagnose.systems.straw.of import straw_of

Floats = NDArray[np.float64]

#: Channel radii searched, m; the paper's are 0.315 to 0.43 mm.
R_CH = tuple(0.28e-3 * 1.06**k for k in range(12))
#: Axial dampings searched, N s/m; the paper's are 0.1 to 620.
C_ZETA = (1.0, 4.0, 8.0, 16.0, 32.0, 64.0, 150.0, 600.0)
#: Angular dampings searched, N m s/rad; the paper's are 0.7e-3 to 3e-3.
C_PHI = (0.4e-3, 0.8e-3, 1.6e-3, 3.2e-3, 6.4e-3, 12.8e-3)
#: Runs used, and starts followed.
LOOKED_AT = 3


def base_fit(campaign: Campaign, proposed: Sequence[Floats] = ()) -> tuple[Fit, Fit]:
    """The base fitted to all samples, and to the coarse comparison: multi-start over channel and damping.

    The inflow, and so X, determines the channel's radius whatever the damping; then damping is searched on a grid, in a
    few runs, and the best starts are followed.
    """
    unknowns = base_unknowns(straw_of(campaign))
    few = campaign.only(_most_telling(campaign.observations)).coarse()
    own = np.zeros(len(unknowns))
    radii = [own, *(_moved(unknowns, own, r_ch_m=r) for r in R_CH)]
    u = radii[int(np.argmin(_lengths(few, unknowns, radii)))]
    dampings = [_moved(unknowns, u, c_zeta_n_s_per_m=a, c_phi_n_m_s_per_rad=b) for a in C_ZETA for b in C_PHI]
    points = [own, u, *proposed, *dampings]
    best = np.argsort(logarithmic(few, unknowns, points), kind="stable")[:FOLLOWED]
    ends = fits_from(few, [(unknowns, points[k]) for k in best], rounds=FIRST_ROUNDS)
    coarse = fitted(campaign.coarse(), unknowns, min(ends, key=lambda fit: fit.cost).u, rounds=ROUNDS)
    return refined(campaign, coarse, ROUNDS), coarse


def logarithmic(campaign: Campaign, unknowns: Sequence[Unknown], points: list[Floats]) -> list[float]:
    """Misfit of each point as a sum of logarithms, which is insensitive to the size of large differences."""
    return [float(np.sum(np.log1p((r / 10) ** 2))) for r in campaign.residuals(unknowns, points)]


def telling_runs(campaign: Campaign, fit: Fit) -> list[str]:
    """A few runs that differ most, one without a snap, and of the other start configurations the one with the largest
    misfit, if above noise, as it may show effects that no other run shows."""
    observations, left = campaign.observations, run_by_run(campaign, fit)
    few = different_runs(observations)
    seen = {o.kind for o in observations if o.name in few}
    others = [(-x, o.name) for o, x in zip(observations, left, strict=True) if o.kind not in seen]
    return few + [name for x, name in sorted(others) if -x > NOISE_LEAVES][:1]


def different_runs(observations: Sequence[Recording]) -> list[str]:
    """Names of a few runs that differ most, and of one that does not snap."""
    still = [o.name for o in observations if len(o.events_s) == 0]
    few = _most_telling(observations)
    return few + [name for name in still if name not in few][:1]


def _most_telling(observations: Sequence[Recording]) -> list[str]:
    """Names of a few runs that differ most: of each start configuration the one that snaps most."""
    best: dict[Hashable, Recording] = {}
    for o in observations:
        key = o.kind
        if key not in best or len(o.events_s) > len(best[key].events_s):
            best[key] = o
    ranked = sorted(best.values(), key=lambda o: (-np.ptp(o.seen[0]), o.name))
    return [o.name for o in ranked[:LOOKED_AT]]


def _moved(unknowns: Sequence[Unknown], u: Floats, **values: float) -> Floats:
    """u with some of the straw's constants, SI, by name."""
    out = u.copy()
    for k, unknown in enumerate(unknowns):
        kind, _, name = unknown.target.partition(".")
        if kind == "straw" and name in values:
            out[k] = np.log(values[name] / unknown.start) / unknown.scale
    return out


def _lengths(campaign: Campaign, unknowns: Sequence[Unknown], points: list[Floats]) -> list[float]:
    """Error of X alone at each point, m; large where a run cannot be simulated."""
    return [
        float(sum(1.0 if one is None else np.mean(np.abs(one.plain[0] - np.median(one.plain[0]))) for one in row))
        for row in campaign.misfits(unknowns, points)
    ]
