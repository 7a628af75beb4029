"""Arguments of the API: a straw, a protocol, recordings, each as the object or as its file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

from straw.model.parameters import StrawParameters
from straw.model.straw_file import load_straw
from straw.replay.api.recordings import load_protocol
from straw.replay.compare.gather import check_run, gather
from straw.replay.errors import ReplayError
from straw.rig.protocol import PressureProtocol
from straw.rig.run import Run

Named: TypeAlias = str | Path
#: A straw, its file, or None for the paper's.
GivenStraw: TypeAlias = StrawParameters | Named | None
GivenProtocol: TypeAlias = PressureProtocol | Named
#: One recording or several; those that are files are joined with the tracks among them.
GivenRuns: TypeAlias = Run | Named | Sequence[Run | Named]


def the_straw(given: GivenStraw) -> StrawParameters:
    """The straw of an argument."""
    return given if isinstance(given, StrawParameters) else load_straw(given)


def the_protocol(given: GivenProtocol) -> PressureProtocol:
    """The protocol of an argument."""
    return given if isinstance(given, PressureProtocol) else load_protocol(given)


def the_runs(given: GivenRuns, *, partial: bool = False) -> list[Run]:
    """Runs that can be compared: those from files joined with their tracks; ReplayError where one is incomplete."""
    several = [given] if isinstance(given, Run | str | Path) else list(given)
    if not several:
        raise ReplayError("no recording is given; give one, or a list of them")
    files = [Path(one) for one in several if not isinstance(one, Run)]
    runs = gather(files, partial=partial) if files else []
    return [*runs, *(check_run(one) for one in several if isinstance(one, Run))]
