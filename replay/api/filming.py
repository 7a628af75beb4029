"""From a video to the tip: what `straw track` does, as an object."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from straw.replay.api.given import GivenStraw, Named, the_straw
from straw.replay.api.recordings import TIP
from straw.replay.api.shown import Rows, Shown, motion_figure, remade
from straw.replay.commands.track import rest_of, summary
from straw.replay.gather import read_whole
from straw.replay.track_file import track_to_file
from straw.rig.run import Run
from straw.tracking import task
from straw.tracking.board import Board
from straw.tracking.camera import Camera, load_camera
from straw.tracking.follow import Rest
from straw.tracking.track import track as track_only

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclasses.dataclass(frozen=True)
class Track(Shown, task.Track):
    """What a video says about the tip: ``trace`` has ``time_s``, ``x_m``, ``z_m``, ``phi_rad``, their sigmas and
    ``valid``, each (frames,); ``rms_px``, ``corners`` (frames,) how well each was seen; ``camera`` as it was found."""

    def _columns(self) -> Rows:
        rows: dict[str, Any] = {name: getattr(self.trace, name) for name in ("frame", *TIP)}
        return {**rows, "rms_px": self.rms_px, "corners": self.corners}

    def _says(self) -> str:
        return summary(self)

    def _figure(self) -> Figure:
        return motion_figure(self._columns())


def track(
    videos: Named | Sequence[Named],
    camera: Camera | Named,
    output: Named | None = None,
    *,
    run: Run | Named | None = None,
    rest: Rest | None = None,
    start_s: float = 0.0,
    straw: GivenStraw = None,
    board: Board | None = None,
    progress: Callable[[int, int], None] | None = None,
    **more: Any,
) -> Track:
    """Track the checkerboard on the tip through the files of one recording.

    ``camera``: lens, and its place if known, or its file. ``output``: the track is written there as a recording on the
    clock of ``run``, as `straw track` does. ``rest``: the tip's pose while still at the beginning (x m, z m, phi rad),
    which places the camera; else the model's for the configuration in which ``run`` starts. ``start_s``: the first
    frame, s after the run's zero. ``board``: squares and side. ``more``: ``fps``, ``from_s``, ``to_s``, ``level``,
    ``near_px``, ``mend``. Raises TrackingError or ReplayError, one line.
    """
    files = [Path(v) for v in ([videos] if isinstance(videos, str | Path) else videos)]
    lens = camera if isinstance(camera, Camera) else load_camera(Path(camera))
    filmed = run if isinstance(run, Run) or run is None else read_whole(Path(run))
    pose = rest if rest is not None else rest_of(None, filmed, lens, the_straw(straw))
    if output is None:
        found = track_only(files, lens, board or Board(), rest_pose=pose, start_s=start_s, progress=progress, **more)
    else:
        found = track_to_file(files, lens, pose, Path(output), filmed, start_s, board=board, **more)
        assert found.record is not None
        found.record.remove()
    return remade(Track, found)  # type: ignore[no-any-return]
