"""Where to start: damping and channel of a specimen nobody has measured yet, coarse but from anywhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.hypothesis import Unknown
from straw.replay.diagnose.observation import Observation
from straw.replay.diagnose.search import descend

Floats = NDArray[np.float64]

#: Channel radius (m), axial (N s/m) and angular damping (N m s/rad) looked at; the paper's are 0.315 to 0.43 mm,
#: 0.1 to 620 and 0.7e-3 to 3e-3.
R_CH = tuple(0.28e-3 * 1.06**k for k in range(12))
C_ZETA = (1.0, 4.0, 8.0, 16.0, 32.0, 64.0, 150.0, 600.0)
C_PHI = (0.4e-3, 0.8e-3, 1.6e-3, 3.2e-3, 6.4e-3, 12.8e-3)
#: Runs looked at, and starts followed.
LOOKED_AT, FOLLOWED = 3, 4
#: What is left unexplained of a run that is looked at for that, at least, sigmas squared.
FAR_OFF = 300.0


def most_telling(observations: Sequence[Observation]) -> list[str]:
    """Names of a few runs that differ most: of each start configuration the one that snaps most."""
    best: dict[tuple[int, ...] | None, Observation] = {}
    for o in observations:
        key = o.run.initial_deployed
        if key not in best or len(o.snaps_s) > len(best[key].snaps_s):
            best[key] = o
    ranked = sorted(best.values(), key=lambda o: (-np.ptp(o.tip[0]), o.name))
    return [o.name for o in ranked[:LOOKED_AT]]


def few_of(observations: Sequence[Observation], left: Sequence[float]) -> list[str]:
    """The most telling runs, one that does not snap, and of the other start configurations that of which most is
    ``left`` unexplained (by run, sigmas squared), if more than noise: what only shows there is seen nowhere else."""
    still = [o.name for o in observations if len(o.snaps_s) == 0]
    few = most_telling(observations)
    few += [name for name in still if name not in few][:1]
    seen = {o.run.initial_deployed for o in observations if o.name in few}
    others = [(-x, o.name) for o, x in zip(observations, left, strict=True) if o.run.initial_deployed not in seen]
    return few + [name for x, name in sorted(others) if -x > FAR_OFF][:1]


def base_start(campaign: Campaign, unknowns: tuple[Unknown, ...]) -> Floats:
    """u of the base's unknowns from which all runs are roughly as recorded: from the straw's own and from a grid.

    The volume that has come in, so X, tells the channel's radius whatever the damping; runs that do not snap tell
    elasticity and geometry; then damping is looked for on a grid, in a few runs, and the best starts are followed.
    """
    few = campaign.only(most_telling(campaign.observations)).roughly()

    own = np.zeros(len(unknowns))
    radii = [own, *(_moved(unknowns, own, r_ch_m=r) for r in R_CH)]
    u = radii[int(np.argmin(_lengths_look(few, unknowns, radii)))]
    still = campaign.only([o.name for o in campaign.observations if len(o.snaps_s) == 0])
    if still.observations:
        u = descend(still, unknowns, u, rounds=4, enough=20.0).u
    points = [own, u, *dampings(unknowns, u)]
    looks = rough(few, unknowns, points)
    best = np.argsort(looks, kind="stable")[:FOLLOWED]
    ends = [descend(few, unknowns, points[k], rounds=3, share=0.01, enough=20.0) for k in best]
    u = min(ends, key=lambda fit: fit.cost).u
    return descend(campaign.roughly(), unknowns, u, rounds=8, enough=5.0).u


def dampings(unknowns: Sequence[Unknown], u: Floats) -> list[Floats]:
    """Points at u with each damping of a grid."""
    return [_moved(unknowns, u, c_zeta_n_s_per_m=a, c_phi_n_m_s_per_rad=b) for a in C_ZETA for b in C_PHI]


def _moved(unknowns: Sequence[Unknown], u: Floats, **values: float) -> Floats:
    """u with some of the straw's constants, SI, by name."""
    out = u.copy()
    for k, unknown in enumerate(unknowns):
        kind, _, name = unknown.target.partition(".")
        if kind == "straw" and name in values:
            out[k] = np.log(values[name] / unknown.start) / unknown.scale
    return out


def rough(campaign: Campaign, unknowns: tuple[Unknown, ...], points: list[Floats]) -> list[float]:
    """How bad each point looks, hardly minding how far off what is far off is."""
    return [float(np.sum(np.log1p((r / 10) ** 2))) for r in campaign.residuals(unknowns, points)]


def _lengths_look(campaign: Campaign, unknowns: tuple[Unknown, ...], points: list[Floats]) -> list[float]:
    """How far X alone is off at each point, m; what cannot be played is far off."""
    return [
        float(sum(1.0 if one is None else np.mean(np.abs(one.plain[0] - np.median(one.plain[0]))) for one in row))
        for row in campaign.misfits(unknowns, points)
    ]
