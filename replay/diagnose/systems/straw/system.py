"""The straw as a system of the diagnosis: its constants, causes, misfits and page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.terms import TERMS
from straw.replay.diagnose.campaign import Campaign
from straw.replay.diagnose.fit import Contestant, Fit, evaluated
from straw.replay.diagnose.hypothesis import Hypothesis, Unknown
from straw.replay.diagnose.inquiry import Told
from straw.replay.diagnose.page.shown import Shown
from straw.replay.diagnose.recording import Channel
from straw.replay.diagnose.settings import MOST_WORK
from straw.replay.diagnose.system import Differences, Level, Misfit, System
from straw.replay.diagnose.systems.straw.base import base_fit, telling_runs
from straw.replay.diagnose.systems.straw.constants import (
    MEASUREMENT,
    REPEATS_MOUNT,
    applied,
    base_unknowns,
    repeat_steps,
    walls_known,
)
from straw.replay.diagnose.systems.straw.experiment import Experiment, next_experiment
from straw.replay.diagnose.systems.straw.library import causes, hypothesis
from straw.replay.diagnose.systems.straw.misfit import coarse_misfit, misfit
from straw.replay.diagnose.systems.straw.missing import Missing, missing_force
from straw.replay.diagnose.systems.straw.observation import Observation
from straw.replay.diagnose.systems.straw.simulated import simulated

Floats = NDArray[np.float64]

#: Channels with their unit on pages and its factor.
CHANNELS = (
    Channel("x_m", "X", "mm", 1e3),
    Channel("z_m", "Z", "mm", 1e3),
    Channel("phi_rad", "Phi", "mrad", 1e3),
)
#: The cause that needs finite elements of the straw's own geometry.
WALLS = "wall_elasticity"
#: Units of instruments' constants.
UNITS = {
    "clock_offset_s": "s",
    "clock_drift": "1",
    "length_scale": "1",
    "camera_roll_rad": "rad",
    "tip_offset_m": "m",
    "gauge_offset_pa": "Pa",
    "gauge_gain": "1",
}
#: Equations of the base's constants, for a message where one would have to vary from run to run.
EQUATIONS = {
    "r_ch_m": ("flow through the channel (equation 2)", "channel radius r_ch"),
    "c_zeta_n_s_per_m": ("axial dissipation (equation 4)", "damping c_zeta"),
    "c_phi_n_m_s_per_rad": ("angular dissipation (equation 4)", "damping c_phi"),
    "E_pa": ("elasticity (equations 6, 7)", "modulus E"),
    "h_m": ("elasticity (equations 6, 7)", "wall thickness h"),
    "zeta01": ("geometry of the odd frusta", "height zeta_01"),
    "zeta02": ("geometry of the even frusta", "height zeta_02"),
}


@dataclass(frozen=True, eq=False)
class StrawSystem(System):
    """A straw with its assumed constants."""

    straw: StrawParameters

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Tip X, Z, Phi."""
        return CHANNELS

    @property
    def base(self) -> tuple[Unknown, ...]:
        """Channel, damping, elasticity and geometry."""
        return base_unknowns(self.straw)

    @property
    def causes(self) -> tuple[str, ...]:
        """The library's; walls of another elasticity where there are finite elements of this geometry."""
        known = causes(self.straw.cells)
        return tuple(name for name in known if name != WALLS or walls_known(self.straw))

    @property
    def most_work(self) -> float:
        """See `MOST_WORK`."""
        return MOST_WORK

    @property
    def faults(self) -> frozenset[str]:
        """Camera, clock and gauge."""
        return frozenset(MEASUREMENT)

    def hypothesis(self, names: Sequence[str]) -> Hypothesis:
        """Causes of the library together."""
        return hypothesis(names, self.straw.cells)

    def misfit(
        self,
        recording: Observation,
        unknowns: Sequence[Unknown],
        u: Floats,
        *,
        level: Level = Level.FINE,
        derivatives: bool = False,
    ) -> Misfit | None:
        """Registered at the snaps; None where the straw cannot be simulated."""
        try:
            if level is Level.FINE:
                return misfit(recording, self.straw, unknowns, u, derivatives=derivatives)
            vector, jacobian, work = coarse_misfit(recording, self.straw, unknowns, u, derivatives=derivatives)
        except ModelError:
            return None
        return Differences(vector, jacobian, np.empty((len(CHANNELS), 0)), work)

    def size(self, recording: Observation, level: Level) -> int:
        """Shape, or slow part and envelope; each snap time, one for additional snaps, one for the vented gauge."""
        shaped = recording.envelope.size if level is Level.COARSE else recording.tip.size
        return int(shaped + len(recording.snaps_s) + 2)

    def ready(self, recordings: Sequence[Observation]) -> None:
        """Find where the straw rests before each run."""
        for one in recordings:
            one.rest_of(self.straw)

    def propose(self, recordings: Sequence[Observation], names: Sequence[str]) -> Any:
        """The proposal learned from simulated campaigns."""
        from straw.replay.diagnose.propose.proposal import propose

        return propose(recordings, self.straw, names)

    def fit_base(self, campaign: Campaign, proposed: Sequence[Floats]) -> tuple[Fit, Fit]:
        """Multi-start over channel and damping."""
        return base_fit(campaign, proposed)

    def telling(self, campaign: Campaign, fit: Fit) -> list[str]:
        """Runs that differ most, one without a snap, and the one with the largest misfit."""
        return telling_runs(campaign, fit)

    def repeats(self, campaign: Campaign, fit: Fit) -> Floats | None:
        """Elasticity, damping and mounting differ a little from run to run."""
        at = evaluated(campaign, (*fit.unknowns, REPEATS_MOUNT), np.append(fit.u, 0.0))
        steps = self.repeat_steps(fit.unknowns)
        return np.column_stack([at.slopes[:, -1], at.slopes[:, list(steps)] * list(steps.values())])

    def repeat_steps(self, unknowns: Sequence[Unknown]) -> dict[int, float]:
        """Of elasticity and damping; the mounting has no unknown of its own."""
        return repeat_steps(unknowns)

    def cannot_follow(self, recording: Observation) -> str:
        """Most likely the start configuration in the file is wrong."""
        return (
            f"run {recording.name}: the straw cannot be simulated from where this run starts, neither with the "
            "constants given nor with those that fit; check initial_deployed and the straw, or leave the run out"
        )

    def named(self, unknown: Unknown) -> tuple[str, str, str]:
        """Cause, constant and unit of an unknown."""
        kind, *rest = unknown.target.split(".")
        if kind == "term":
            (terms, name, *cell) = rest
            term = terms.partition("&")[0]
            unit = next(c.unit for c in TERMS[term].constants if c.name == name)
            return term, ".".join([name, *cell]), unit
        name = rest[0] if rest else kind
        cause = next((one for one in MEASUREMENT if name.startswith(one)), name)
        return ("odd_frusta_compliance" if name == "odd_E" else cause), name, UNITS.get(name, "1")

    def equation(self, unknown: Unknown) -> tuple[str, str] | None:
        """The paper's equation of a constant."""
        return EQUATIONS.get(unknown.target.split(".")[1])

    def places(self, campaign: Campaign, fit: Fit, recording: Observation) -> tuple[int, ...]:
        """Cells in the order in which the fitted straw snaps them in this run."""
        seen = simulated(recording, self.straw, fit.unknowns, fit.u).prediction
        zeta = seen.zeta_m[:, :, 1]
        crossed = [
            (int(np.flatnonzero(np.sign(zeta[:, cell]) != np.sign(zeta[0, cell]))[0]), cell + 1)
            for cell in range(zeta.shape[1])
            if np.any(np.sign(zeta[:, cell]) != np.sign(zeta[0, cell]))
        ]
        return tuple(cell for _, cell in sorted(crossed))

    def doubts(self, recordings: Sequence[Observation]) -> list[str]:
        """Without snaps, wear or a table of the walls much is untested."""
        out = []
        if not any(len(o.snaps_s) for o in recordings):
            out.append("no run shows a snap: what acts only in snaps (film, cohesion, inertia, drag) was not tested")
        if len({o.run.cycle for o in recordings}) < 2:
            out.append("all runs are of the same cycle: wear was not tested")
        if not walls_known(self.straw):
            out.append(
                f"{WALLS} was not tested: there are no finite elements of this geometry; make them with straw shell "
                '--straw S.toml --elasticity E.json, and name them in the straw file, elasticity = "E.json"'
            )
        return out

    def experiment(self, campaign: Campaign, among: Sequence[Contestant], *, explain: bool) -> Experiment | None:
        """Of a menu of protocols, the one under which hypotheses differ most."""
        return next_experiment(campaign, among, explain=explain)

    def missing(self, campaign: Campaign, null: Fit, told: Told) -> list[Missing]:
        """A missing force as one curve over a state, and before it as two."""
        return missing_force(campaign, null, told)

    def shown(self) -> Shown:
        """Portrait, laws, motion, and the next protocol."""
        from straw.replay.diagnose.systems.straw.shown import StrawShown

        return StrawShown(self.straw)

    def fitted(self, unknowns: Sequence[Unknown], u: Floats) -> StrawParameters:
        """The straw with unknowns at u."""
        return applied(self.straw, unknowns, u)[0]

    def simulated(self, recording: Observation, unknowns: Sequence[Unknown], u: Floats) -> Floats:
        """Tip at the recording's times, not registered, (3, n)."""
        seen = simulated(recording, self.straw, unknowns, u)
        return np.stack([np.interp(recording.time_s, seen.time_s, line) for line in seen.pose])

    def written(self, model: StrawParameters) -> dict[str, str]:
        """TOML that every command reads as --straw."""
        return {"straw": model.to_toml()}
