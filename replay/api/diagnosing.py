"""The diagnosis of `straw diagnose` as an object."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from straw.model.parameters import StrawParameters
from straw.model.straw_file import straw_from_toml
from straw.replay.api.findings_shown import constants_table, heldout_table, located_table, verdict_figure
from straw.replay.api.given import GivenRuns, GivenStraw, the_runs, the_straw
from straw.replay.api.shown import Rows, Shown
from straw.replay.commands.diagnose import check_campaign, chosen, text
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import Findings, conclude
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.page.report import report
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.diagnose.tolerance import parse_tolerance
from straw.replay.output import finite, write_text
from straw.replay.progress import prepare

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Hypotheses that a picture and a notebook show.
SHOWN = 8


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Shown):
    """A diagnosis. ``findings`` is all of it, ``inquiry`` how it was found; `to_dataframe` gives the hypotheses
    with their probabilities, and so do ``probability``, ``constants``, ``heldout`` and ``located`` as columns."""

    findings: Findings
    inquiry: Inquiry

    @property
    def verdict(self) -> str:
        """complete, within_tolerance, missing_physics, measurement_fault, ambiguous or unknown_physics."""
        return self.findings.verdict

    @property
    def causes(self) -> list[str]:
        """The causes named, most probable first; empty when nothing is missing."""
        return self.findings.causes

    @property
    def probability(self) -> Mapping[str, float]:
        """Posterior probability of each hypothesis, most probable first; sums to 1."""
        return self.findings.judgement.probability

    @property
    def constants(self) -> Rows:
        """Constants of the causes named: columns ``cause``, ``constant``, ``value``, ``sigma``, ``unit``."""
        return constants_table(self.findings.parameters)

    @property
    def heldout(self) -> Rows:
        """RMS on the runs that were not fitted: ``channel``, ``rms_before``, ``rms_after``, ``noise_floor`` in the SI
        unit of the channel's name; no rows where nothing could be held out."""
        held = self.findings.held
        return heldout_table(held.before, held.after, held.floor) if held else heldout_table({}, {}, {})

    @property
    def located(self) -> Rows:
        """Where the base model is off most: ``run``, ``channel``, ``from_s``, ``to_s``, ``phase``,
        ``share_of_misfit``."""
        return located_table([vars(one) for one in self.findings.located])

    @property
    def straw(self) -> StrawParameters:
        """The model with the causes found."""
        return straw_from_toml(self.findings.written["straw"])

    @property
    def says(self) -> str:
        """The answer in one sentence."""
        return self.findings.says

    def __str__(self) -> str:
        return text(self.findings, self.inquiry.campaign.system.channels)

    def as_json(self) -> dict[str, Any]:
        """The findings that `straw diagnose --json` writes."""
        data: dict[str, Any] = finite(self.findings.as_json())
        return data

    def write_page(self, path: str | Path) -> None:
        """The page of `straw diagnose --report`."""
        write_text(Path(path), report(self.findings, self.inquiry))

    def write_straw(self, path: str | Path) -> None:
        """The improved straw as a file, which every command takes as ``--straw``."""
        write_text(Path(path), self.findings.written["straw"])

    def _columns(self) -> Rows:
        names, values = list(self.probability), list(self.probability.values())
        return {"hypothesis": np.array(names, dtype=str), "probability": np.array(values, dtype=np.float64)}

    def _says(self) -> str:
        return f"{self.verdict}: {self.says}"

    def _tables(self) -> list[tuple[str, Rows]]:
        every = {name: column[:SHOWN] for name, column in self._columns().items()}
        return [
            ("How probable is each hypothesis", every),
            *((title, rows) for title, rows in (("What was found", self.constants),) if len(rows["value"])),
            *((title, rows) for title, rows in (("Runs held out", self.heldout),) if len(rows["channel"])),
            *((title, rows) for title, rows in (("Where the base is off", self.located),) if len(rows["run"])),
        ]

    def _figure(self) -> Figure:
        names, held = list(self.probability)[:SHOWN], self.heldout
        scaled = {c.name: (c.short, c.shown_per_si, c.shown_unit) for c in self.inquiry.campaign.system.channels}
        return verdict_figure({name: self.probability[name] for name in names}, held, scaled)


def diagnose(
    recordings: GivenRuns,
    straw: GivenStraw = None,
    *,
    without: Sequence[str] = (),
    tolerance: str | None = None,
    partial: bool = False,
    jobs: int = 2,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Diagnosis:
    """Diagnose what the model leaves out of the runs of one specimen, or which instrument is wrong, as `straw
    diagnose`.

    ``recordings``: five to ten, of different kinds; ``straw``: the base model; ``without``: causes left out of
    the library; ``tolerance``: what may remain, as "x=0.1mm,phi=2mrad" or "2%"; ``jobs``: threads, or an ``executor``
    of threads or of a Dask client in their place, which must outlive the diagnosis; ``progress``: called with (steps
    done, steps in all). Takes minutes. Raises ReplayError or ModelError, one line, as `straw diagnose` does.
    """
    the = the_straw(straw)
    system = StrawSystem(the)
    library = chosen(system, without)
    accepted = parse_tolerance(tolerance, system.channels) if tolerance else None
    runs = the_runs(recordings, partial=partial)
    check_campaign(runs, the.cells)
    prepare(derivatives=True)

    def told(_what: str, done: int, total: int) -> None:
        progress(done, total)

    # Not closed, as the page simulates again; its threads end with the diagnosis object.
    pool = executor or ThreadPoolExecutor(max(1, jobs))
    try:
        found = inquire([observe(run) for run in runs], system, library=library, executor=pool, told=told)
        notes = [f"{run.run_id}: {lost}" for run in runs for lost in run.lost]
        return Diagnosis(conclude(found, notes, told, tolerance=accepted), found)
    except BaseException:
        if executor is None:
            pool.shutdown(wait=False, cancel_futures=True)
        raise
