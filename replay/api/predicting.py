"""The model's motion, and its exact derivatives by any constant of the straw."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from straw.model import derivative
from straw.model import simulate as model
from straw.model.direction import Direction
from straw.model.parameters import StrawParameters
from straw.model.stretches import LongPrediction as _Long
from straw.replay.api.given import GivenStraw, the_protocol, the_straw
from straw.replay.api.shown import Rows, Shown, motion_figure, remade
from straw.replay.compare.comparison import setting
from straw.replay.compare.gather import check_run
from straw.replay.errors import ReplayError
from straw.replay.protocol.prediction import RATE_HZ, predict_protocol
from straw.rig.outlet import Outlet
from straw.rig.protocol import PressureProtocol
from straw.rig.run import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
#: A protocol or its file, a recording (whose measured pressure drives), a constant in Pa, or any function of seconds.
GivenPressure: TypeAlias = PressureProtocol | str | Path | Run | float | Callable[[Floats], Floats]

_CHANNELS = ("time_s", "x_m", "z_m", "phi_rad", "external_pa", "pressure_pa", "volume_m3")


@dataclasses.dataclass(frozen=True, repr=False)
class Prediction(Shown, model.Prediction):
    """A motion of the straw, SI: ``time_s``, ``x_m``, ``z_m``, ``phi_rad`` of the tip, ``external_pa`` (driving),
    ``pressure_pa`` (inside), ``volume_m3``, each (n,); ``zeta_m``, ``frustum_phi_rad`` (n, cells, 2) of every frustum
    (odd, even). World frame: origin at the middle of the base, X horizontal, Z up, tip axis (sin phi, cos phi).
    """

    def _columns(self) -> Rows:
        return {name: getattr(self, name) for name in _CHANNELS}

    def _says(self) -> str:
        return f"{len(self.time_s)} samples, {self.time_s[0]:g} to {self.time_s[-1]:g} s, {self.steps} steps"

    def _figure(self) -> Figure:
        return motion_figure(self._columns())


@dataclasses.dataclass(frozen=True, repr=False)
class LongPrediction(Shown, _Long):
    """A motion of more than ten minutes: as Prediction, dense where the straw moves, with the ends of every rest."""

    def _columns(self) -> Rows:
        return {name: getattr(self, name) for name in _CHANNELS if name != "external_pa"}

    def _says(self) -> str:
        return f"{len(self.time_s)} samples up to {self.time_s[-1]:g} s, {self.skipped_s:g} s of rest left out"

    def _figure(self) -> Figure:
        return motion_figure(self._columns())


@dataclasses.dataclass(frozen=True, repr=False)
class Derivatives(Shown, derivative.Derivatives):
    """A prediction, and the derivatives (n, P) of ``x_m``, ``z_m``, ``phi_rad``, ``pressure_pa``, ``volume_m3`` by P
    parameters, called ``names``, SI by the parameter's unit; ``snaps`` with theirs."""

    def _columns(self) -> Rows:
        by = {
            f"d_{channel}_by_{name}": getattr(self, channel)[:, k]
            for k, name in enumerate(self.names)
            for channel in ("x_m", "z_m", "phi_rad", "pressure_pa")
        }
        return {"time_s": self.prediction.time_s, **by}

    def _says(self) -> str:
        return f"by {', '.join(self.names)}"


@dataclasses.dataclass(frozen=True, repr=False)
class _Asked:
    straw: StrawParameters
    pressure: Callable[[Floats], Floats]
    time_s: Floats
    deployed: Collection[int]


@overload
def simulate(
    straw: GivenStraw,
    pressure: GivenPressure,
    time_s: ArrayLike,
    deployed: Collection[int] | None = None,
    *,
    tolerance_m: float = model.TOLERANCE_M,
) -> Prediction: ...
@overload
def simulate(
    straw: GivenStraw,
    pressure: GivenPressure,
    time_s: None = None,
    deployed: Collection[int] | None = None,
    *,
    tolerance_m: float = model.TOLERANCE_M,
) -> Prediction | LongPrediction: ...
def simulate(
    straw: GivenStraw,
    pressure: GivenPressure,
    time_s: ArrayLike | None = None,
    deployed: Collection[int] | None = None,
    *,
    tolerance_m: float = model.TOLERANCE_M,
) -> Prediction | LongPrediction:
    """Motion of a straw from rest under a pressure, as `straw simulate` and `straw replay` predict it.

    ``straw``: parameters, their file, or None for the paper's. ``pressure``: a protocol or its file (through a
    controller of nominal speed), a recording (its measured pressure, at its tip's samples), a constant (Pa), or a
    function from seconds (k,) to gauge Pa (k,). ``time_s`` (n,) increases: output times, s; by
    default 240 a second for a protocol and the tip's own for a recording. ``deployed``: cells deployed at the start,
    from 1 at the base; by default the protocol's or recording's. ``tolerance_m``: accuracy of a step.

    Raises ModelError where the model cannot follow, ReplayError where an argument is missing.
    """
    the = the_straw(straw)
    if isinstance(pressure, str | Path):
        pressure = the_protocol(pressure)
    if isinstance(pressure, PressureProtocol) and time_s is None and deployed is None:
        found, _ = predict_protocol(the, pressure)
        kind = Prediction if isinstance(found, model.Prediction) else LongPrediction
        return remade(kind, found)  # type: ignore[no-any-return]
    asked = _asked(the, pressure, time_s, deployed)
    found = model.simulate(asked.straw, asked.pressure, asked.time_s, asked.deployed, tolerance_m=tolerance_m)
    return remade(Prediction, found)  # type: ignore[no-any-return]


def differentiate(
    straw: GivenStraw,
    pressure: GivenPressure,
    by: Sequence[str | Direction],
    time_s: ArrayLike | None = None,
    deployed: Collection[int] | None = None,
    *,
    cells: bool = False,
) -> Derivatives:
    """The motion that `simulate` gives and its exact derivatives by parameters.

    ``by``: constants named as in a straw file ("c_zeta_n_s_per_m", "terms.cohesion.force_n"), "delay_s" (of the
    pressure), or any ``straw.Direction``: of one cell, of a sum, of the pressure or the start. ``cells`` adds the
    derivatives of every frustum's coordinates. Other arguments and errors as in `simulate`.
    """
    the = the_straw(straw)
    asked = _asked(the, the_protocol(pressure) if isinstance(pressure, str | Path) else pressure, time_s, deployed)
    directions = [
        one
        if isinstance(one, Direction)
        else Direction.delay(asked.straw, asked.pressure)
        if one == "delay_s"
        else Direction.of(asked.straw, one)
        for one in ([by] if isinstance(by, str | Direction) else by)
    ]
    found = derivative.differentiate(asked.straw, asked.pressure, asked.time_s, asked.deployed, directions, cells=cells)
    return remade(Derivatives, found)  # type: ignore[no-any-return]


def _asked(
    straw: StrawParameters,
    pressure: PressureProtocol | Run | float | Callable[[Floats], Floats],
    time_s: ArrayLike | None,
    deployed: Collection[int] | None,
) -> _Asked:
    """The model's arguments from those of the API."""
    if isinstance(pressure, Run):
        straw, pressure, when, at_start = setting(check_run(pressure), straw)
    elif isinstance(pressure, PressureProtocol):
        when, at_start = np.arange(0.0, pressure.duration_s, 1 / RATE_HZ), pressure.initial_deployed
        pressure = Outlet(pressure)
    else:
        if time_s is None or deployed is None:
            raise ReplayError("simulate: give time_s and deployed; only a protocol or a recording has them itself")
        when, at_start = np.empty(0), ()
    if not callable(pressure):
        pressure = _constant(float(pressure))
    if time_s is not None:
        when = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        if when.ndim != 1 or not len(when) or not np.all(np.isfinite(when)) or np.any(np.diff(when) <= 0):
            raise ReplayError(f"simulate: time_s of shape {when.shape}; expected seconds (n,) that increase")
    return _Asked(straw, pressure, when, at_start if deployed is None else deployed)


def _constant(pressure_pa: float) -> Callable[[Floats], Floats]:
    return lambda time_s: np.full(np.shape(time_s), pressure_pa)
