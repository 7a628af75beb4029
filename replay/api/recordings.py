"""Recordings and protocols for notebooks: read, written, shown."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from straw.replay.api.shown import Rows, Shown, motion_figure, remade
from straw.replay.compare.gather import joined, read_whole
from straw.replay.errors import ReplayError
from straw.replay.output import check_new
from straw.replay.protocol.figure import protocol_figure
from straw.rig import protocol_toml
from straw.rig.protocol import PressureProtocol
from straw.rig.run import CELLS, Event, PressureLog, Run
from straw.rig.run_derived import write_columns
from straw.tracking.trace import TipTrace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: A pressure or a tip: columns by name, or an object that has them as attributes.
Columns = Mapping[str, ArrayLike] | PressureLog | TipTrace
#: Zero of recordings without a date: a message at time 0 breaks Foxglove.
NOMINAL_ZERO_NS = 1_000_000_000


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Recording(Shown, Run):
    """One recording, SI, seconds since the run's zero.

    ``pressure`` and ``command`` (``time_s``, ``pressure_pa``, ``sigma_pa``, each (n,)), ``tip`` (``time_s``, ``x_m``,
    ``z_m``, ``phi_rad``, their sigmas, ``valid``, each (m,)), ``events``, ``metadata``; None where it was not recorded.
    ``lost``: sentences on what is missing, damaged or assumed.
    """

    def _columns(self) -> Rows:
        """The tip's samples with the pressure at these times, or the pressure's samples where there is no tip."""
        if self.tip is not None:
            rows: dict[str, NDArray[Any]] = {name: getattr(self.tip, name) for name in TIP}
            if self.pressure is not None:
                rows["pressure_pa"] = self.pressure(self.tip.time_s)
        elif self.pressure is not None:
            rows = {name: getattr(self.pressure, name) for name in ("time_s", "pressure_pa", "sigma_pa")}
        else:
            return {}
        if self.command is not None:
            rows["command_pa"] = self.command(rows["time_s"])
        return rows

    def _says(self) -> str:
        deployed = ",".join(map(str, self.initial_deployed or ())) or "none"
        lost = f" {'; '.join(self.lost)}" if self.lost else ""
        specimen = f"specimen {self.specimen}, " if self.specimen else ""
        return f"{self.run_id}: {specimen}cycle {self.cycle}, cells deployed at the start: {deployed}.{lost}"

    def _figure(self) -> Figure | None:
        return motion_figure(self._columns()) if self._columns() else None


TIP = ("time_s", "x_m", "z_m", "phi_rad", "sigma_x_m", "sigma_z_m", "sigma_phi_rad", "valid")


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Protocol(Shown, PressureProtocol):
    """Commanded gauge pressure: ``time_s`` and ``pressure_pa`` (n,), straight in between, a repeated time is a step.

    Called with seconds since its start it gives Pa. ``zero_s`` is where its main part begins.
    """

    def _columns(self) -> Rows:
        return {"time_s": self.time_s, "pressure_pa": self.pressure_pa}

    def _says(self) -> str:
        return f"{self.name}: {self.duration_s:g} s, within {self.limits}"

    def _figure(self) -> Figure:
        return protocol_figure(self)


def load_protocol(path: str | Path) -> Protocol:
    """The protocol in a TOML file; RigError, one line, for anything else."""
    return cast(Protocol, remade(Protocol, protocol_toml.load_protocol(path)))


def read_recording(path: str | Path, *tracks: str | Path, partial: bool = False) -> Recording:
    """One recording, and on its clock the tracks that were derived from it.

    Raises ReplayError for a damaged file, unless ``partial`` accepts its intact part, and for a track of another
    recording; RigError for a file that is no recording.
    """
    run = read_whole(Path(path), partial=partial)
    for track in tracks:
        run = joined(run, read_whole(Path(track), partial=partial))
    return cast(Recording, remade(Recording, run))


def write_recording(
    path: str | Path,
    *,
    pressure: Columns | None = None,
    command: Columns | None = None,
    tip: Columns | None = None,
    events: Iterable[Event] = (),
    initial_deployed: Iterable[int] | None = None,
    run_id: str = "",
    specimen: str = "",
    cycle: int = 0,
    cells: int = CELLS,
    zero_time_ns: int = NOMINAL_ZERO_NS,
    metadata: Mapping[str, str] | None = None,
) -> Recording:
    """Write columns as a recording (MCAP) and return it as read back; nothing is overwritten.

    ``pressure``: ``time_s``, ``pressure_pa`` (n,) and, where known, ``sigma_pa``, ``channel``, ``flow_m3_s``;
    ``command``: ``time_s``, ``pressure_pa``; ``tip``: ``time_s``, ``x_m``, ``z_m``, ``phi_rad`` (m,) and, where known,
    their sigmas (``sigma_x_m``, ...) and ``valid``: a sample that is not finite is not valid. Gauge pressures,
    seconds since ``zero_time_ns`` (ns since the Unix epoch). Raises ReplayError for a column that is missing, of
    another length, unknown, or whose time does not increase.
    """
    path = Path(path)
    check_new(path)
    topics = {
        topic: columns_of(topic, given)
        for topic, given in (("/pressure/command", command), ("/pressure/measured", pressure), ("/tip/state", tip))
        if given is not None
    }
    if (happened := list(events)) != []:
        topics["/events"] = {
            name: np.array([getattr(e, name) for e in happened]) for name in ("time_s", "kind", "text")
        }
    if not topics:
        raise ReplayError(f"{path}: give a pressure, a command, a tip or events; there is nothing to write")
    about = {"run_id": run_id or path.stem, "specimen": specimen, "cycle": str(cycle), "cells": str(cells)}
    if initial_deployed is not None:
        about["initial_deployed"] = ",".join(str(cell) for cell in initial_deployed)
    write_columns(path, {**(metadata or {}), **about}, "", zero_time_ns, topics)
    return read_recording(path)


#: Columns of each topic: those that must be given, and those that may.
_KNOWN = {
    "/pressure/command": (("pressure_pa",), ("channel",)),
    "/pressure/measured": (("pressure_pa",), ("sigma_pa", "channel", "flow_m3_s")),
    "/tip/state": (("x_m", "z_m", "phi_rad"), ("sigma_x_m", "sigma_z_m", "sigma_phi_rad", "valid", "frame")),
}


def columns_of(topic: str, given: Columns) -> dict[str, NDArray[Any]]:
    """Columns of one topic, checked, ``time_s`` first."""
    must, may = _KNOWN[topic]
    columns = ("time_s", *must, *may)
    there = given if isinstance(given, Mapping) else {n: getattr(given, n) for n in columns if hasattr(given, n)}
    for name in there:
        if name not in columns:
            raise ReplayError(f"{topic}: unknown column {name!r}; known: {', '.join(columns)}")
    for name in ("time_s", *must):
        if name not in there:
            raise ReplayError(f"{topic}: column {name} is missing; given: {', '.join(there) or 'none'}")
    found = {"time_s": _numbers(topic, "time_s", there["time_s"])}
    found |= {name: _numbers(topic, name, there[name]) for name in (*must, *may) if name in there}
    n = len(found["time_s"])
    for name, column in found.items():
        if column.shape != (n,):
            raise ReplayError(f"{topic}: {name} has shape {column.shape}, time_s ({n},); make them equal")
    if not n or not np.all(np.isfinite(found["time_s"])) or np.any(np.diff(found["time_s"]) <= 0):
        raise ReplayError(f"{topic}: time_s must have samples, be finite and increase; sort it, drop repeated times")
    found |= {name: np.full(n, np.nan) for name in may if name.startswith("sigma_") and name not in found}
    if topic == "/tip/state":
        finite = np.all([np.isfinite(found[name]) for name in must], axis=0)
        found["valid"] = finite & found.get("valid", np.ones(n)).astype(bool)
        found["frame"] = found.get("frame", np.arange(n)).astype(np.int64)
    elif not np.all(np.isfinite(found["pressure_pa"])):
        raise ReplayError(f"{topic}: pressure_pa has values that are no numbers; leave these samples out")
    if "channel" in may:
        found["channel"] = found.get("channel", np.ones(n)).astype(np.int64)
    return found


def _numbers(topic: str, name: str, given: ArrayLike) -> NDArray[np.float64]:
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise ReplayError(f"{topic}: {name} is not a column of numbers") from None
