"""Recordings compared with the model, as `straw replay` does, as objects."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from straw.replay.api.given import GivenRuns, GivenStraw, the_runs, the_straw
from straw.replay.api.shown import Rows, Shown, remade
from straw.replay.commands.replay import as_data, table
from straw.replay.compare import comparison as compared
from straw.replay.output import finite, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True, repr=False)
class Comparison(Shown, compared.Comparison):
    """One run beside its prediction. ``signals["x_m"]`` (also "z_m", "phi_rad") has ``time_s``, ``measured``,
    ``sigma``, ``predicted``, ``u_val``, each (n,), SI, at the tip's valid samples, and its ``metrics``; ``pairs`` are
    the snaps, measured and predicted; ``quantities`` are the figures of merit, judged."""

    def _columns(self) -> Rows:
        rows: dict[str, Any] = {"time_s": self.signals["x_m"].time_s}
        for name, s in self.signals.items():
            rows |= {f"measured_{name}": s.measured, f"sigma_{name}": s.sigma, f"predicted_{name}": s.predicted}
        return rows

    def _says(self) -> str:
        return table([self], {}).splitlines()[-1]

    def _figure(self) -> Figure:
        from straw.replay.report.png import overlay

        return overlay(self)


@dataclasses.dataclass(frozen=True, repr=False)
class Replay(Shown):
    """Every run beside its prediction: a sequence of Comparisons with the metrics as a table."""

    comparisons: tuple[Comparison, ...]

    def __len__(self) -> int:
        return len(self.comparisons)

    def __getitem__(self, which: int | str) -> Comparison:
        """By number, or by the run's name."""
        if isinstance(which, int):
            return self.comparisons[which]
        named = {c.run.run_id: c for c in self.comparisons}
        if which not in named:
            raise KeyError(f"no run {which!r}; there are {', '.join(named)}")
        return named[which]

    def _columns(self) -> Rows:
        rows: dict[str, list[Any]] = {"run": [c.run.run_id for c in self.comparisons]}
        for name in compared.CHANNELS:
            rows[f"rmse_{name}"] = [c.signals[name].metrics.rmse for c in self.comparisons]
            rows[f"reduced_chi2_{name}"] = [c.signals[name].metrics.reduced_chi2 for c in self.comparisons]
        rows["lag_s"] = [c.signals["phi_rad"].metrics.lag_s for c in self.comparisons]
        return {name: np.array(column) for name, column in rows.items()}

    def _figure(self) -> Figure | None:
        return self.comparisons[0].plot() if len(self) == 1 else None

    def as_json(self) -> dict[str, Any]:
        """The data that `straw replay --json` writes."""
        data: dict[str, Any] = finite(as_data(list(self.comparisons)))
        return data

    def write_page(self, path: str | Path) -> None:
        """The page of `straw replay --report`."""
        from straw.replay.report.page import page

        write_text(Path(path), page(list(self.comparisons)))


def replay(
    recordings: GivenRuns,
    straw: GivenStraw = None,
    *,
    uncertain: Mapping[str, float] | None = None,
    partial: bool = False,
) -> Replay:
    """Compare recordings with the model's predictions of them, as `straw replay` does.

    ``recordings``: one or several, objects or files; tracks among the files are joined to their runs. ``straw``:
    parameters, their file, or None for the paper's. ``uncertain``: standard uncertainties of constants by name, SI.
    Raises ReplayError for a recording that lacks its pressure, tip or start, or is damaged unless ``partial``.
    """
    the = the_straw(straw)
    runs = the_runs(recordings, partial=partial)
    return Replay(tuple(remade(Comparison, compared.compare(run, the, uncertain)) for run in runs))
