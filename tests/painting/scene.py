"""A scene to paint: camera, board, motion; and its pictures through a rolling shutter."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tests.painting.board_picture import expose, unbend

Floats = NDArray[np.float64]
Motion = Callable[[Floats], Floats]  # times (k,) to x_m, z_m, phi_rad (k, 3)

MOST_MOMENTS = 24


def about(axis: int, angle: float) -> Floats:
    """Rotation matrix about a coordinate axis."""
    c, s = math.cos(angle), math.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[i, i] = turn[j, j] = c
    turn[i, j], turn[j, i] = -s, s
    return turn


def looking(target: Floats, distance_m: float, azimuth: float, elevation: float, roll: float = 0.0) -> Floats:
    """``world_from_camera`` (4x4) of a camera at an azimuth (rad, +X to +Y) and an elevation, looking at ``target``."""
    back = np.array(
        (math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation))
    )
    forward, up = -back, np.array((0.0, 0.0, 1.0))
    right = np.cross(forward, up) / np.linalg.norm(np.cross(forward, up))
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack((right, np.cross(forward, right), forward)) @ about(2, roll)
    pose[:3, 3] = np.asarray(target) + distance_m * back
    return pose


@dataclass(frozen=True)
class Scene:
    """A scene without the codec. The tip's frame has z along its axis (sin phi, 0, cos phi) and y along the world's.

    ``mounted`` (3, 3): the board's x, y, z in the tip's frame, as columns. ``misprint_m``: each printed edge is off by
    a number drawn uniformly from +- this. ``light``: grey level factor at the picture's middle.
    """

    world_from_camera: Floats
    motion: Motion
    width: int = 1280
    height: int = 720
    f: float = 920.0
    centre: tuple[float, float] = (641.3, 357.8)
    brown: tuple[float, ...] = (-0.11, 0.04, 4e-4, -3e-4, -0.006)
    squares: tuple[int, int] = (8, 8)
    side_m: float = 0.0385
    offset_m: float = 0.0088
    mounted: Floats = field(default_factory=lambda: np.eye(3))
    misprint_m: float = 0.0
    row_s: float = 5.57e-6
    exposure_s: float = 1 / 720
    psf_px: float = 0.65
    noise: float = 2.0
    light: float = 1.0
    seed: int = 0


class Camera:
    """Takes the pictures of a scene."""

    def __init__(self, scene: Scene) -> None:
        self.scene = s = scene
        self.rng = np.random.default_rng(s.seed)
        self.rays = np.empty((s.height, s.width, 2))
        unbend(s.width, s.height, s.f, *s.centre, np.array(s.brown), self.rays)
        pitch = s.side_m / s.squares[0]
        self.half = np.array(s.squares) * pitch / 2
        self.lines = [np.arange(1, n) * pitch - n * pitch / 2 for n in s.squares]
        for lines in self.lines:
            lines += self.rng.uniform(-s.misprint_m, s.misprint_m, len(lines))
        self.margin = 0.7 * pitch
        self.camera_from_world = np.linalg.inv(s.world_from_camera)
        self.light, self.backdrop = self._surroundings()

    def take(self, now_s: float) -> NDArray[np.uint8]:
        """Return the picture whose first row is exposed around ``now_s``."""
        s = self.scene
        canvas = self.backdrop.copy()
        late_s = now_s + s.row_s * np.linspace(0, s.height, 9)
        spans = np.concatenate([self._outline(late_s + shift) for shift in (-s.exposure_s / 2, s.exposure_s / 2)])
        low, high = np.floor(spans.min(axis=0)) - 6, np.ceil(spans.max(axis=0)) + 7
        left, top = np.maximum(low, 1).astype(int)
        right, bottom = np.minimum(high, (s.width - 1, s.height - 1)).astype(int)
        if right > left and bottom > top:
            one, other = (
                self._outline(np.array([now_s + s.row_s * (top + bottom) / 2 + t]))
                for t in (-s.exposure_s / 2, s.exposure_s / 2)
            )
            moments = min(max(math.ceil(float(np.abs(one - other).max()) / 0.5), 1), MOST_MOMENTS)
            when = (
                now_s
                + s.row_s * np.arange(top, bottom)[:, None]
                + s.exposure_s * ((np.arange(moments) + 0.5) / moments - 0.5)
            )
            maps = np.linalg.inv(self._boards(when.ravel())).reshape(bottom - top, moments, 3, 3)
            expose(
                canvas,
                self.light,
                self.rays,
                (left, top, right, bottom),
                maps,
                *self.lines,
                *self.half,
                self.margin,
                s.psf_px,
            )
        canvas += self.rng.normal(0, s.noise, canvas.shape)
        return np.clip(np.round(canvas), 0, 255).astype(np.uint8)

    def _boards(self, time_s: Floats) -> Floats:
        """Return matrices (k, 3, 3) from (x, y, 1) on the board to the camera's frame."""
        s = self.scene
        x, z, phi = s.motion(time_s).T
        sin, cos, none = np.sin(phi), np.cos(phi), np.zeros_like(phi)
        axis = np.stack((sin, none, cos), axis=-1)
        tip = np.stack((np.stack((cos, none, -sin), axis=-1), np.stack((none, none + 1, none), axis=-1), axis), axis=-1)
        centre = np.stack((x, none, z), axis=-1) + s.offset_m * axis
        turn, shift = self.camera_from_world[:3, :3], self.camera_from_world[:3, 3]
        columns = [turn @ (tip @ s.mounted[:, k])[..., None] for k in (0, 1)] + [(centre @ turn.T + shift)[..., None]]
        return np.concatenate(columns, axis=-1)

    def _outline(self, time_s: Floats) -> Floats:
        """Return pixels of the sheet's corners at some times, without lens distortion: accurate enough for a box."""
        s, reach = self.scene, self.half + self.margin
        corners = np.array([(i * reach[0], j * reach[1], 1.0) for i in (-1, 1) for j in (-1, 1)])
        p = (self._boards(time_s) @ corners.T).transpose(0, 2, 1).reshape(-1, 3)
        ray = p[:, :2] / p[:, 2:]
        r2 = (ray**2).sum(axis=1, keepdims=True)
        return s.f * ray * (1 + s.brown[0] * r2 + s.brown[1] * r2**2) + s.centre

    def _surroundings(self) -> tuple[Floats, Floats]:
        """Return the light (height, width) and the illuminated background."""
        s, rng = self.scene, self.rng
        v, u = np.mgrid[0 : s.height, 0 : s.width].astype(float)
        light = (
            s.light
            * (1 + 0.2 * (u / s.width - 0.4) + 0.1 * (v / s.height - 0.6))
            * np.cos(np.hypot(u - s.width / 2, v - s.height / 2) / s.width) ** 2
        )
        grey = 90 + 25 * np.sin(u / 83.0) * np.cos(v / 61.0)
        for _ in range(30):
            at, size, turn = rng.uniform((0, 0), (s.width, s.height)), rng.uniform(15, 160, 2), rng.uniform(0, np.pi)
            across, along = (
                np.cos(turn) * (u - at[0]) + np.sin(turn) * (v - at[1]),
                np.cos(turn) * (v - at[1]) - np.sin(turn) * (u - at[0]),
            )
            grey[(np.abs(across) < size[0]) & (np.abs(along) < size[1])] = rng.uniform(25, 190)
        return light, grey * light
