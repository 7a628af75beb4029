"""Gathers recordings: raw runs, joined with the tracks that were derived from them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from straw.replay.errors import ReplayError
from straw.rig.run import Run
from straw.rig.run_read import read_run
from straw.tracking.trace import TipTrace


def read_whole(path: Path, *, partial: bool = False) -> Run:
    """Read a run; ReplayError for a cut or damaged one unless ``partial`` accepts the rest."""
    run = read_run(path)
    if run.damage and not partial:
        raise ReplayError(f"{path}: {run.damage[0]}; copy it again, or replay what is left with --partial")
    return run


def gather(paths: Sequence[Path], *, partial: bool = False) -> list[Run]:
    """One run per recording that has a pressure and a tip, in the order given.

    A file that names a given file as its parent (a track) is joined to it on the absolute clock. Raises ReplayError
    where a run then still lacks its pressure, its tip or its initial configuration, saying what to add, and for
    damaged files unless ``partial``.
    """
    read = [read_whole(path, partial=partial) for path in paths]
    by_sha: dict[str, Run] = {}
    for run in read:
        if (same := by_sha.setdefault(run.sha256, run)) is not run:
            raise ReplayError(f"{run.path}: the same recording as {same.path}; give it once, or it counts twice")
    beside: set[str] = set()
    tracked: set[str] = set()
    for run in read:
        parent = by_sha.get(run.metadata.get("parent_sha256", ""))
        if parent is None or run.tip is None:
            continue
        if parent.sha256 in tracked:
            raise ReplayError(f"{run.path}: a second track of {parent.path}; give one of them at a time")
        tracked.add(parent.sha256)
        by_sha[parent.sha256] = joined(by_sha[parent.sha256], run)
        beside.add(run.sha256)
    runs = [run for sha, run in by_sha.items() if sha not in beside]
    for run in runs:
        check_run(run)
    return runs


def joined(run: Run, track: Run) -> Run:
    """A run with the tip of a track that was derived from it, on the run's clock; ReplayError where it was not."""
    if track.tip is None or track.metadata.get("parent_sha256") != run.sha256:
        raise ReplayError(f"{track.path}: is not a track of {run.path}; give the track that was made with it as --run")
    return dataclasses.replace(
        run,
        tip=_shifted(track.tip, (track.zero_time_ns - run.zero_time_ns) / 1e9),
        attachments={**run.attachments, **track.attachments},
        lost=(*run.lost, *track.lost),
    )


def _shifted(tip: TipTrace, shift_s: float) -> TipTrace:
    return tip if shift_s == 0 else dataclasses.replace(tip, time_s=tip.time_s + shift_s)


def check_run(run: Run) -> Run:
    """The run, if it can be compared with a prediction; otherwise a ReplayError that names what is missing."""
    if run.pressure is None:
        tracked = bool(run.metadata.get("parent_sha256"))
        cure = "give the run it was tracked from as well" if tracked else "give a run that recorded it"
        raise ReplayError(f"{run.path}: no /pressure/measured, which drives the prediction; {cure}")
    if run.tip is None or not run.tip.valid.any():
        raise ReplayError(f"{run.path}: no valid /tip/state to compare with; track its video, give that file too")
    if run.initial_deployed is None:
        said = next((lost for lost in run.lost if "initial_deployed" in lost), "initial_deployed is missing")
        raise ReplayError(
            f"{run.path}: {said.partition(':')[0]}; a prediction needs the cells deployed at the start, as 1,4 or "
            "empty: write them into the metadata record straw.run"
        )
    if np.count_nonzero(run.tip.valid) < 2:
        raise ReplayError(f"{run.path}: only one valid tip sample; nothing to compare")
    return run
