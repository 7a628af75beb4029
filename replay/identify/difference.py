"""How a recording's tip differs from its simulation, in sigmas, with derivatives by the constants that are fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from straw.model.derivative import Derivatives, differentiate
from straw.model.direction import Direction
from straw.model.errors import ModelError
from straw.model.parameters import StrawParameters
from straw.model.simulate import Prediction
from straw.replay.compare.comparison import CHANNELS, predict, setting
from straw.replay.compare.driving import driving_pressure
from straw.rig.run import PressureLog, Run

Floats = NDArray[np.float64]

#: Tolerance of simulations while searching; the tip's error is below a camera's noise.
SEARCH_TOLERANCE_M = 2e-6
#: Tolerance of the derivatives that intervals are made of, m. At the search's tolerance tangents may amplify a gauge's
#: noise, to 160 sigmas where 0.6 are right, most likely where a step is as long as an unstable mode takes to grow.
INTERVAL_TOLERANCE_M = 3e-8
#: Draws of the gauge's noise.
GAUGE_DRAWS = 12
#: Noise where a recording does not state it: m, m, rad.
UNSTATED = {"x_m": 30e-6, "z_m": 30e-6, "phi_rad": 2e-3}


@dataclass(frozen=True)
class Difference:
    """Simulated less recorded as a function of the logarithms of constants ``names`` of a straw.

    It is pickled for an executor's workers.
    """

    straw: StrawParameters
    names: tuple[str, ...]

    def at(self, run: Run, log_values: Floats) -> Floats | None:
        """Differences in sigmas, (channels, n), without blur; None where the model cannot follow."""
        assert run.tip is not None
        try:
            seen = predict(run, self._straw(log_values), tolerance_m=SEARCH_TOLERANCE_M)
        except ModelError:
            return None
        valid = run.tip.valid
        measured = np.array([getattr(run.tip, channel)[valid] for channel in CHANNELS])
        return np.asarray((_of_tip(run, seen) - measured) / sigmas(run))

    def slope(self, run: Run, log_values: Floats, tolerance_m: float = SEARCH_TOLERANCE_M) -> Floats | None:
        """Derivatives of `at` by the logarithms, (channels, n, constants); None where the model cannot follow."""
        try:
            straw, pressure, time_s, deployed = setting(run, self._straw(log_values))
            along = [
                float(np.exp(x)) * Direction.of(straw, name) for x, name in zip(log_values, self.names, strict=True)
            ]
            by = differentiate(straw, pressure, time_s, deployed, along, tolerance_m=tolerance_m)
        except ModelError:
            return None
        return np.asarray(_of_tip(run, by) / sigmas(run)[..., np.newaxis])

    def gauge(self, run: Run, log_values: Floats) -> Floats | None:
        """How `at` changes when the gauge's noise is added to its readings once more, (channels, n, draws)."""
        assert run.pressure is not None
        try:
            straw, pressure, time_s, deployed = setting(run, self._straw(log_values))
            along = []
            for seed in range(GAUGE_DRAWS):
                noisy = driving_pressure(_reread(run.pressure, seed), run.command)
                along.append(Direction.driven(straw, noisy) + -1.0 * Direction.driven(straw, pressure))
            by = differentiate(straw, pressure, time_s, deployed, along, tolerance_m=INTERVAL_TOLERANCE_M)
        except ModelError:
            return None
        return np.asarray(_of_tip(run, by) / sigmas(run)[..., np.newaxis])

    def _straw(self, log_values: Floats) -> StrawParameters:
        return with_values(self.straw, self.names, np.exp(log_values))


def with_values(straw: StrawParameters, names: Sequence[str], values: Floats) -> StrawParameters:
    """The straw with constants set, the same in every cell."""
    return straw.replace(**{name: float(value) for name, value in zip(names, values, strict=True)})


def _of_tip(run: Run, of: Prediction | Derivatives) -> Floats:
    """Channels at the tip's valid samples, (channels, n, ..)."""
    assert run.tip is not None
    return np.array([getattr(of, channel)[-len(run.tip) :][run.tip.valid] for channel in CHANNELS])


def sigmas(run: Run) -> Floats:
    """Noise of the tip's valid samples, (channels, n)."""
    assert run.tip is not None
    stated = [getattr(run.tip, f"sigma_{channel}")[run.tip.valid] for channel in CHANNELS]
    return np.array([np.where(np.isfinite(s), s, UNSTATED[c]) for s, c in zip(stated, CHANNELS, strict=True)])


def _reread(log: PressureLog, seed: int) -> PressureLog:
    """The readings with the gauge's noise added once more; the scatter of the readings where it does not state one."""
    # second differences see white noise, sigma^2 (1 + 4 + 1), and hardly the pressure
    scatter = 1.4826 * np.median(np.abs(np.diff(log.pressure_pa, 2))) / np.sqrt(6) if len(log) > 2 else 0.0
    sigma = np.where(np.isfinite(log.sigma_pa), log.sigma_pa, scatter)
    noise = np.random.default_rng([seed, len(log)]).normal(0, 1, len(log)) * sigma
    return replace(log, pressure_pa=log.pressure_pa + noise)
