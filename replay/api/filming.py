"""From a video to the tip, as `straw track` does, as an object."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from straw.replay.api.given import GivenStraw, Named, the_straw
from straw.replay.api.recordings import TIP
from straw.replay.api.shown import Rows, Shown, motion_figure, remade
from straw.replay.commands.track import rest_of, summary
from straw.replay.compare.gather import read_whole
from straw.replay.errors import ReplayError
from straw.replay.film.track import by_hand, track_to_file
from straw.rig.run import Run
from straw.tracking import task
from straw.tracking.board import Board
from straw.tracking.camera import Camera, load_camera
from straw.tracking.follow import Rest
from straw.tracking.mend import load_edits
from straw.tracking.track import track as track_only

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Largest distance of a tip from the straw's base; larger numbers must be in mm.
FARTHEST_M = 2.0


@dataclasses.dataclass(frozen=True, repr=False)
class Track(Shown, task.Track):
    """The tip's motion by a video: ``trace`` has ``time_s``, ``x_m``, ``z_m``, ``phi_rad``, their sigmas and
    ``valid``, each (frames,); ``rms_px``, ``corners`` (frames,) the quality of each frame; ``camera`` as estimated."""

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
    mend: Named | None = None,
    progress: Callable[[int, int], None] | None = None,
    fps: float = 0.0,
    from_s: float = -math.inf,
    to_s: float = math.inf,
    level: bool = False,
    near_px: tuple[float, float] | None = None,
) -> Track:
    """Track the checkerboard on the tip through the files of one recording.

    ``camera``: lens, and its place if known, or its file. ``output``: the track is written there as a recording on the
    clock of ``run``, as `straw track` does. ``rest``: the tip's pose while still at the beginning (x m, z m, phi rad),
    which places the camera; else the model's for the configuration in which ``run`` starts. ``start_s``: the first
    frame, s after the run's zero. ``board``: squares and side. ``mend``: a file of corrections by hand. ``progress``:
    called with (frames done, frames in all). ``fps``: the rate at which slow motion was filmed (0: its times are
    right); ``from_s``, ``to_s``: the part of the video; ``level``: the camera stands level; ``near_px``: where the
    board is in the first picture. Raises TrackingError or ReplayError, one line.
    """
    files = [Path(v) for v in ([videos] if isinstance(videos, str | Path) else videos)]
    lens = camera if isinstance(camera, Camera) else load_camera(Path(camera))
    filmed = run if isinstance(run, Run) or run is None else read_whole(Path(run))
    if rest is None and lens.world_from_camera is None and (filmed is None or filmed.initial_deployed is None):
        raise ReplayError(
            "track: the camera's place is unknown; give rest=(x_m, z_m, phi_rad), or run= with the cells it "
            "starts from, or a camera with its place"
        )
    pose = _checked(rest) if rest is not None else rest_of(None, filmed, lens, the_straw(straw))
    how: dict[str, Any] = {"fps": fps, "from_s": from_s, "to_s": to_s, "level": level, "near_px": near_px}
    by_whom = Path(mend) if mend else None
    if output is None:
        edits = load_edits(by_whom) if by_whom else []
        found = track_only(files, lens, board or Board(), rest_pose=pose, start_s=start_s, progress=progress, **how)
        return remade(Track, by_hand(found, files, edits, start_s))  # type: ignore[no-any-return]
    how |= {"calibration": None if isinstance(camera, Camera) else Path(camera)}
    found = track_to_file(
        files, lens, pose, Path(output), filmed, start_s, board=board, mend=by_whom, progress=progress, **how
    )
    assert found.record is not None
    found.record.remove()
    return remade(Track, found, record=None)  # type: ignore[no-any-return]


def _checked(rest: Rest) -> Rest:
    """Metres, metres and radians; ReplayError where the numbers look like mm and degrees."""
    try:
        x_m, z_m, phi_rad = (float(value) for value in rest)
    except (TypeError, ValueError):
        raise ReplayError(f"track: rest is {rest!r}; give (x_m, z_m, phi_rad)") from None
    if abs(x_m) > FARTHEST_M or abs(z_m) > FARTHEST_M or abs(phi_rad) > 2 * math.pi:
        raise ReplayError(f"track: rest is {rest!r} m, m, rad, which looks like mm and degrees; give SI")
    return x_m, z_m, phi_rad
