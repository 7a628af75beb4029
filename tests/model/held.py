"""Runs with prescribed steps: central differences of the same map that the integrator's tangents differentiate."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from straw.model.compiled import compiled
from straw.model.drive import summed
from straw.model.errors import ModelError
from straw.model.integrate import FIRST_STEPS, at_rest, fill_inside, fill_start
from straw.model.parameters import StrawParameters
from straw.model.rest import rest_state
from straw.model.simulate import FIRST_STEP_S, MAX_STEP_S, Prediction, prediction, sampled
from straw.model.stages import Limits, arrive, limits_for, stages_for, work_for
from straw.model.step import DONE, take_step

Floats = NDArray[np.float64]

#: A tolerance that refuses no step of a finer run, and the share of it at which Newton stops: 1e-15 m. It stops as well
#: at corrections of `straw.model.step.ROUNDING` of the tolerance, 1e-14 m. A looser one leaves an error from the terms
#: that Newton's matrix omits, above all of drag: it is proportional to their strength, so that no choice of the
#: differences' step reveals it.
LOOSE_M, CLOSE = 1e-8, 1e-7


@compiled
def march(c, state, table, ends, limits, output_s, out_q, out_v, out_pa):
    """Take the steps that end at ``ends``, or where it is empty those that a run takes; their ends, how many were
    refused. One function for both, as a step takes long to compile into each."""
    sums, counts = summed(table), np.zeros(4, np.int64)
    s, w = stages_for(c, len(state.q)), work_for(c, len(state.q))
    filled = fill_start(state, output_s, out_q, out_v, out_pa)
    end_s, taken = limits.end_s, [state.clock[0]]
    while state.clock[0] < end_s:
        if len(ends):
            limits = Limits(ends[len(taken)], 1.0, LOOSE_M, CLOSE, np.inf, c.remembers, 1_000_000)
            state.clock[1] = 1.0
        remaining = limits.end_s - state.clock[0]
        status, h = take_step(c, state, table, sums, limits, s, w, counts)
        assert status == DONE
        new_s = limits.end_s if len(ends) or h == remaining else state.clock[0] + h
        filled = fill_inside(state, s, h, new_s, output_s, filled, out_q, out_v, out_pa)
        arrive(state, s, new_s)
        taken.append(new_s)
    return np.array(taken), counts[1]


@dataclass(frozen=True)
class Held:
    """The steps of a run, to be repeated by slightly different straws and under slightly different pressures."""

    time_s: Floats
    deployed: Collection[int]
    ends: Floats
    rest: Floats

    @classmethod
    def of(cls, straw: StrawParameters, pressure, time_s: Floats, deployed: Collection[int], tolerance_m: float):
        table, first_pa = sampled(pressure, time_s), float(np.asarray(pressure(time_s[:1])).ravel()[0])
        c, q = straw.constants(), rest_state(straw, deployed, first_pa)
        state = at_rest(c, q, float(time_s[0]), first_pa, FIRST_STEP_S)
        limits = limits_for(c, float(time_s[-1]), MAX_STEP_S, tolerance_m, FIRST_STEPS + 100_000)
        none, nowhere = np.empty(0), np.empty((0, straw.coordinates))
        ends, _ = march(c, state, table, none, limits, none, nowhere, nowhere, none)
        return cls(time_s, deployed, ends, q)

    def play(self, straw: StrawParameters, pressure, start: Floats | float = 0.0) -> Prediction:
        """The run of another straw; ``start`` is added to its rest state."""
        table = sampled(pressure, self.time_s)
        c, first_pa, n = straw.constants(), float(table.pressure_pa[0]), straw.coordinates
        q = rest_state(straw, self.deployed, first_pa, near=self.rest) + start
        state = at_rest(c, q, float(self.time_s[0]), first_pa, FIRST_STEP_S)
        out = np.empty((len(self.time_s), n)), np.empty((len(self.time_s), n)), np.empty(len(self.time_s))
        limits = limits_for(c, float(self.ends[-1]), MAX_STEP_S, LOOSE_M, FIRST_STEPS)
        _, rejected = march(c, state, table, self.ends, limits, self.time_s, *out)
        if rejected:
            raise ModelError("held: a step that the run takes is refused with these constants")
        return prediction(straw, table, self.time_s, out[0], out[2], np.array([len(self.ends), 0, 0, 0]), q)
