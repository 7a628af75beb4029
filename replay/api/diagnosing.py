"""What the model leaves out: what `straw diagnose` finds, as an object."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from straw.model.parameters import StrawParameters, straw_from_toml
from straw.replay.api.given import GivenRuns, GivenStraw, the_runs, the_straw
from straw.replay.api.shown import Rows, Shown, table
from straw.replay.commands.diagnose import check_campaign, chosen, text
from straw.replay.diagnose.diagnosis import inquire
from straw.replay.diagnose.findings import Findings, conclude
from straw.replay.diagnose.inquiry import Inquiry
from straw.replay.diagnose.report import report
from straw.replay.diagnose.systems.straw.observation import observe
from straw.replay.diagnose.systems.straw.system import StrawSystem
from straw.replay.output import finite, write_text


@dataclasses.dataclass(frozen=True, eq=False)
class Diagnosis(Shown):
    """What the runs say. ``findings`` is all of it, ``inquiry`` how it was found."""

    findings: Findings
    inquiry: Inquiry

    @property
    def verdict(self) -> str:
        """complete, within_tolerance, missing_physics, measurement_fault, ambiguous or unknown_physics."""
        return self.findings.verdict

    @property
    def causes(self) -> list[str]:
        """What was left out, most probable first; empty when nothing was."""
        return self.findings.causes

    @property
    def probability(self) -> Mapping[str, float]:
        """Of each hypothesis, most probable first; sums to 1."""
        return self.findings.judgement.probability

    @property
    def straw(self) -> StrawParameters:
        """The model with what was found."""
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

    def _columns(self) -> Rows:
        names, values = list(self.probability), list(self.probability.values())
        return {"hypothesis": np.array(names), "probability": np.array(values)}

    def _repr_html_(self) -> str:
        return f"<div><p><b>{escape(self.says)}</b></p><pre>{escape(str(self))}</pre>{table(self._columns())}</div>"


def diagnose(
    recordings: GivenRuns,
    straw: GivenStraw = None,
    *,
    without: Sequence[str] = (),
    partial: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Diagnosis:
    """What the model leaves out of the runs of one specimen, or which instrument lies, as `straw diagnose` finds it.

    ``recordings``: five to ten, of different kinds; ``straw``: the base model; ``without``: causes that are not to be
    tried; ``progress``: told (steps done, steps in all). Minutes. Raises what `straw diagnose` says in one line.
    """
    the = the_straw(straw)
    system = StrawSystem(the)
    library = chosen(system, without)
    runs = the_runs(recordings, partial=partial)
    check_campaign(runs, the.cells)

    def told(_what: str, done: int, total: int) -> None:
        progress(done, total)

    with ThreadPoolExecutor() as pool:
        found = inquire([observe(run) for run in runs], system, library=library, executor=pool, told=told)
        notes = [f"{run.run_id}: {lost}" for run in runs for lost in run.lost]
        return Diagnosis(conclude(found, notes, told), found)
