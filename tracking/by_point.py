"""X and Z from a point on the tip while the board is hidden; frames that show both give the point's place."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from straw.tracking.chapters import Timeline
from straw.tracking.errors import TrackingError
from straw.tracking.mend import BY_HAND, Edit
from straw.tracking.point import Point, follow_point
from straw.tracking.pose import world_from_tip
from straw.tracking.task import Track

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

_FEWEST = 5  # frames that show both the board and the point
# prior of the point's distance from the tip in each direction; decides in directions that no motion determines
_ASIDE_M = 0.05
_ROUNDS = 20
_STEP = 1e-6


def with_point(track: Track, videos: Sequence[Path], edit: Edit, start_s: float) -> Track:
    """Return the track with X and Z by a point where the board was not seen; ``start_s`` as in ``Task``.

    Phi is interpolated between before and after, its sigma at least half of that change. Sigmas include the point's
    own, how well its place on the tip is known, and phi's share. TrackingError where board and point are never seen
    together.
    """
    row_s, trace = track.camera.line_s or 0.0, track.trace
    with Timeline(videos, *track.part) as timeline:
        shown = range(edit.first, edit.last + 1)
        times_s: list[float] = []

        def pictures() -> Iterator[Picture]:
            for frame in timeline.frames():
                if frame.index > edit.last:
                    return
                if frame.index >= edit.first:
                    times_s.append(start_s + frame.time_s)
                    yield frame.luma

        points = dict(zip(shown, follow_point(pictures(), edit.at_px or (0.0, 0.0)), strict=False))
    known = [k for k in shown if points.get(k) is not None and trace.valid[k]]
    if len(known) < _FEWEST:
        what = f"mend: the point at {edit.at_px} is seen beside the board in {len(known)} frames"
        raise TrackingError(f"{what}; at least {_FEWEST} are needed to locate it on the tip: widen its frames")
    place = np.column_stack((trace.x_m, trace.z_m, trace.phi_rad))
    seen = _SeenPoint(track, {k: point for k, point in points.items() if point is not None})
    dated = {k: times_s[k - edit.first] + row_s * point.at_px[1] for k, point in seen.points.items()}
    then = {k: _at(trace.time_s[trace.valid], place[trace.valid], dated[k]) for k in known}
    arm, spread = seen.arm(known, then)
    columns = {name: getattr(trace, name).copy() for name in (f.name for f in dataclasses.fields(trace))}
    said = track.said.copy()
    good = np.flatnonzero(trace.valid)
    for k in shown:
        if trace.valid[k] or k not in seen.points or not good[0] < k < good[-1]:
            continue
        before, after = good[good < k][-1], good[good > k][0]
        share = (dated[k] - trace.time_s[before]) / (trace.time_s[after] - trace.time_s[before])
        phi = (1 - share) * trace.phi_rad[before] + share * trace.phi_rad[after]
        sigma_phi = np.hypot(
            max(trace.sigma_phi_rad[before], trace.sigma_phi_rad[after]),
            abs(trace.phi_rad[after] - trace.phi_rad[before]) / 2,
        )
        found = seen.pose(k, (1 - share) * place[before] + share * place[after], phi, sigma_phi, arm, spread)
        if found is None or not columns["time_s"][k - 1] < dated[k] < columns["time_s"][k + 1]:
            continue
        (x, z), (sigma_x, sigma_z) = found
        values = {"time_s": dated[k], "x_m": x, "z_m": z, "phi_rad": phi, "valid": True}
        values |= {"sigma_x_m": sigma_x, "sigma_z_m": sigma_z, "sigma_phi_rad": sigma_phi}
        for name, value in values.items():
            columns[name][k] = value
        said[k] = f"{BY_HAND}by a point, {edit.reason}"
    return dataclasses.replace(track, trace=dataclasses.replace(trace, **columns), said=said)


class _SeenPoint:
    """What the camera sees of a point that the tip carries."""

    def __init__(self, track: Track, points: dict[int, Point]) -> None:
        assert track.camera.world_from_camera is not None
        self.lens, self.points = track.camera.lens, points
        self.to_camera = np.linalg.inv(track.camera.world_from_camera)

    def _seen(self, pose: Floats, arm: Floats) -> Floats:
        at = self.to_camera @ world_from_tip(*pose) @ np.append(arm, 1.0)
        return np.asarray(self.lens.project(at[None, :3])[0])

    def _slopes(self, pose: Floats, arm: Floats) -> Floats:
        """Return how the point moves with pose and arm (2, 6), px."""
        both = np.concatenate((pose, arm))
        here = self._seen(pose, arm)
        moved = [both + _STEP * e for e in np.eye(6)]
        return np.stack([(self._seen(each[:3], each[3:]) - here) / _STEP for each in moved], axis=1)

    def arm(self, known: list[int], then: dict[int, Floats]) -> tuple[Floats, Floats]:
        """Return where on the tip the point is (3,), m, in the tip's frame, and the covariance of that (3, 3)."""
        arm: Floats = np.zeros(3)
        normal: Floats = np.eye(3)
        for _ in range(_ROUNDS):
            normal, right = np.eye(3) / _ASIDE_M**2, -arm / _ASIDE_M**2
            square = 0.0
            for k in known:
                J = self._slopes(then[k], arm)[:, 3:]
                miss = self.points[k].at_px - self._seen(then[k], arm)
                weight = np.linalg.inv(self.points[k].covariance)
                normal, right = normal + J.T @ weight @ J, right + J.T @ weight @ miss
                square += float(miss @ weight @ miss)
            step = np.linalg.solve(normal, right)
            arm = arm + step
            if np.abs(step).max() < 1e-8:
                break
        free = max(2 * len(known) - 3, 1)
        self.scale = max(square / free, 1.0)  # factor by which the residuals exceed the stated sigmas
        return arm, np.asarray(self.scale * np.linalg.inv(normal), dtype=np.float64)

    def pose(
        self, k: int, start: Floats, phi: float, sigma_phi: float, arm: Floats, spread: Floats
    ) -> tuple[Floats, Floats] | None:
        """Return x and z (2,), m, and their sigmas (2,) in a frame where phi is known otherwise; None without any."""
        pose: Floats = np.array((start[0], start[1], phi))
        for _ in range(_ROUNDS):
            J = self._slopes(pose, arm)
            step = np.linalg.solve(J[:, :2], self.points[k].at_px - self._seen(pose, arm))
            pose[:2] += step
            if not np.isfinite(pose).all():
                return None
            if np.abs(step).max() < 1e-9:
                break
        back = np.linalg.inv(J[:, :2])
        by_phi, by_arm = back @ J[:, 2], back @ J[:, 3:]
        covariance = back @ (self.scale * self.points[k].covariance) @ back.T
        covariance += np.outer(by_phi, by_phi) * sigma_phi**2 + by_arm @ spread @ by_arm.T
        return np.asarray(pose[:2]), np.asarray(np.sqrt(np.diag(covariance)), dtype=np.float64)


def _at(time_s: Floats, place: Floats, when_s: float) -> Floats:
    """Return the pose (3,) at a moment between two frames."""
    return np.array([np.interp(when_s, time_s, column) for column in place.T])
