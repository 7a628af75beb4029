"""The diagnosis of a user's own system, as `straw diagnose --system`, as an object."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from straw.replay.api.findings_shown import constants_table, heldout_table, located_table, verdict_figure
from straw.replay.api.given import Named
from straw.replay.api.shown import Rows, Shown
from straw.replay.diagnose.discover.discover import discover
from straw.replay.diagnose.discover.findings import SystemFindings
from straw.replay.diagnose.discover.page import page
from straw.replay.diagnose.discover.said import text
from straw.replay.diagnose.systems.function.check import check_on
from straw.replay.diagnose.systems.function.model import load_model
from straw.replay.diagnose.systems.function.read_recordings import read_recordings, recordings_of
from straw.replay.diagnose.systems.function.system import FunctionSystem
from straw.replay.errors import ReplayError
from straw.replay.output import finite, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Hypotheses that a picture shows.
SHOWN = 8
#: Recordings: their files, or columns (n,) by their headings, of each recording by its name.
GivenTables = Named | Sequence[Named] | Mapping[str, Mapping[str, ArrayLike]]


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class SystemDiagnosis(Shown):
    """A diagnosis of a system; figures are in the units of the system's file. `to_dataframe` gives the laws found with
    their constants, and so do ``probability``, ``heldout`` and ``located`` as columns."""

    findings: SystemFindings

    @property
    def verdict(self) -> str:
        """complete, within_tolerance, missing_physics, measurement_fault, ambiguous or unknown_physics."""
        return self.findings.verdict

    @property
    def says(self) -> str:
        """The answer in one sentence."""
        return self.findings.says

    @property
    def probability(self) -> Mapping[str, float]:
        """How often each law comes first when the blocks of the recordings are resampled; the largest first."""
        return self.findings.probability

    @property
    def laws(self) -> tuple[str, ...]:
        """Formulas of the laws found, in order."""
        return tuple(one.formula for one in self.findings.laws)

    @property
    def curves(self) -> tuple[Rows, ...]:
        """Of each law: ``state``, ``value``, ``sigma``, each (n,)."""
        return tuple(
            dict(zip(("state", "value", "sigma"), np.asarray(one.curve, dtype=np.float64), strict=True))
            for one in self.findings.laws
        )

    @property
    def constants(self) -> Rows:
        """Of the laws found: ``cause``, ``constant``, ``value``, ``sigma``, ``unit``."""
        return constants_table(
            {
                one.law.says: {n: {"value": v, "sigma": s, "unit": u} for n, (v, s, u) in one.constants.items()}
                for one in self.findings.laws
            }
        )

    @property
    def heldout(self) -> Rows:
        """Held-out RMS: ``channel``, ``rms_before``, ``rms_after``, ``noise_floor``."""
        d = self.findings.discovery
        rows = (d.held[0], d.held[-1], d.noise)
        return heldout_table(*(dict(zip(self.findings.channels, map(float, row), strict=True)) for row in rows))

    @property
    def located(self) -> Rows:
        """Where the base is off most: ``run``, ``channel``, ``from_s``, ``to_s``, ``phase``, ``share_of_misfit``."""
        return located_table(self.findings.located)

    def __str__(self) -> str:
        return text(self.findings)

    def as_json(self) -> dict[str, Any]:
        """The findings that `straw diagnose --system --json` writes."""
        data: dict[str, Any] = finite(self.findings.as_json())
        return data

    def write_page(self, path: str | Path) -> None:
        """The page of `straw diagnose --system --report`."""
        write_text(Path(path), page(self.findings))

    def _says(self) -> str:
        return f"{self.verdict}: {self.says}"

    def _columns(self) -> Rows:
        return self.constants

    def _tables(self) -> list[tuple[str, Rows]]:
        found = [("What was found", self.constants)] if self.laws else []
        return [*found, ("Where nothing was fitted", self.heldout), ("Where the base is off", self.located)]

    def _figure(self) -> Figure:
        channels = self.findings.discovery.base.system.channels
        shown = {c.name: (c.symbol, 1.0, c.shown_unit) for c in channels}
        return verdict_figure(dict(list(self.probability.items())[:SHOWN]), self.heldout, shown)


def diagnose_system(
    system: Named,
    recordings: GivenTables,
    *,
    hold_out: Sequence[str] = (),
    given: Mapping[str, tuple[float, float, float]] | None = None,
    tolerance: Mapping[str, float] | None = None,
    jobs: int = 2,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> SystemDiagnosis:
    """Diagnose what the base model in a system's file leaves out of its recordings, as `straw diagnose --system`.

    ``recordings``: files, or columns by recording, ``{"monday": {"time_s": t, "p": p}}``. ``hold_out``: names of those
    left out of every fit; ``given``: constants known better than in the file, (value, low, high); ``tolerance``: RMS
    that may remain by channel, in its unit; ``jobs``, ``executor``, ``progress`` as for `diagnose`. Seconds to minutes.
    Raises ReplayError, one line with place and cure.
    """
    model = load_model(Path(system), [(name, *values) for name, values in (given or {}).items()])
    if isinstance(recordings, Mapping):
        if not recordings:
            raise ReplayError("no recordings; give at least one")
        tables = {name: ("recordings", table) for name, table in recordings.items()}
        recorded = recordings_of(model, tables, hold_out)
    else:
        files = [recordings] if isinstance(recordings, str | Path) else recordings
        recorded = read_recordings(model, [Path(one) for one in files], hold_out)
    names = [y.name for y in model.channels]
    for name, value in (tolerance or {}).items():
        if name not in names:
            raise ReplayError(f"tolerance: no channel {name!r}; known: {', '.join(names)}")
        if not value > 0:
            raise ReplayError(f"tolerance: {name} = {value!r} must be above zero")
    one = FunctionSystem(model)
    check_on(one, recorded)
    pool = executor or ThreadPoolExecutor(max(1, jobs))
    try:
        found = discover(one, recorded, executor=pool, told=lambda _what, done, total: progress(done, total))
    finally:
        if executor is None:
            pool.shutdown(wait=True, cancel_futures=True)
    return SystemDiagnosis(SystemFindings(found, tuple(recorded), dict(tolerance or {})))
