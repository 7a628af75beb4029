"""The painter: renders the video that a GoPro would take of a given motion of the tip."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from fractions import Fraction

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from straw.tracking.board import Board
from straw.tracking.brush import NODE_ROWS, SAMPLES, paint, rays_of_box
from straw.tracking.camera import Camera
from straw.tracking.encode import GOPRO_RATE, VideoWriter
from straw.tracking.errors import TrackingError

Floats = NDArray[np.float64]
Motion = Callable[[Floats], tuple[ArrayLike, ArrayLike, ArrayLike]]
Retouch = Callable[[int, NDArray[np.uint8]], None]

DARK, LIGHT = 45.0, 205.0  # grey levels of the print under unit light
_EDGE_PX = 1.2  # width of the ramp across a printed edge after a GoPro's lens and sharpening
_BLUR_STEP_PX = 0.5  # sub-exposures are this far apart at most ...
_MOST_STEPS = 24  # ... and never more than this many
# Where the board's x, y, z point in the tip frame, by mount: its face along the axis, towards -Y, towards +Y.
_MOUNTED = {
    "face": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "side": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "back": ((-1, 0, 0), (0, 0, 1), (0, 1, 0)),
}
_PAD_PX = 4  # around the board's outline: wider than a soft edge


def camera_looking_at(target_m: ArrayLike, distance_m: float, azimuth_rad: float, elevation_rad: float) -> Floats:
    """Return ``world_from_camera`` (4x4) of an upright camera that looks at ``target_m`` (3,) from ``distance_m``.

    Azimuth turns from +X towards +Y, elevation rises towards +Z; both zero put the camera on the +X side.
    """
    if not (distance_m > 0 and abs(elevation_rad) < math.radians(89)):
        raise TrackingError("camera_looking_at: distance must be positive and elevation within +-89 degrees")
    level = math.cos(elevation_rad)
    back = np.array((level * math.cos(azimuth_rad), level * math.sin(azimuth_rad), math.sin(elevation_rad)))
    right = np.cross(-back, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack((right, np.cross(-back, right), -back))
    pose[:3, 3] = np.asarray(target_m, dtype=np.float64) + distance_m * back
    return pose


def paint_video(
    path: str | os.PathLike[str],
    camera: Camera,
    tip: Motion,
    duration_s: float,
    *,
    board: Board | None = None,
    rate: Fraction = GOPRO_RATE,
    exposure_s: float = 1 / 480,
    noise_sigma: float = 2.0,
    seed: int = 0,
    bitrate: float = 60e6,
    line_s: float = 0.0,
    decoys: Sequence[tuple[Board, Floats]] = (),
    retouch: Retouch | None = None,
    codec: str = "libx264",
    preset: str = "ultrafast",
    progress: Callable[[int, int], None] | None = None,
) -> Floats:
    """Paint and encode; return the frame times (n,) in seconds from 0, the middle of the first row's exposure.

    ``tip`` maps times (k,) to x_m, z_m, phi_rad, each (k,) or a scalar; ``noise_sigma`` is in grey levels. Row r is
    exposed ``r * line_s`` after the first (rolling shutter). ``decoys``: boards that lie around, each with its
    ``world_from_board`` (4x4). ``retouch(index, picture)`` may paint over a finished picture: fingers, glare. The
    camera needs ``world_from_camera`` and a fisheye lens. Modelled: lens, perspective, motion blur, rolling shutter,
    soft edges, uneven light, clutter, sensor noise, 8 bits, H.264 or HEVC. Not modelled: focus, sharpening, the straw.
    """
    lens, board = camera.lens, board or Board()
    if camera.world_from_camera is None:
        raise TrackingError("paint_video: the camera has no world_from_camera; make one with camera_looking_at")
    if lens.kind != "fisheye":
        raise TrackingError(f"paint_video: only a fisheye lens can be painted, this one is {lens.kind}")
    time_s = np.arange(round(duration_s * rate)) / float(rate)
    if not len(time_s):
        raise TrackingError(f"paint_video: {duration_s:g} s contain no frame at {float(rate):.2f} frames/s")
    scene = _Scene(camera, board, tip, time_s, exposure_s, np.random.default_rng(seed), noise_sigma, line_s)
    for decoy, world_from_board in decoys:
        scene.lay(decoy, world_from_board)
    canvases = [np.empty((lens.height, lens.width), np.uint8) for _ in range(2)]
    pending: Future[None] | None = None
    # One canvas is painted while the other is encoded: both loops release the interpreter.
    with (
        VideoWriter(path, lens.width, lens.height, rate, bitrate, codec, preset) as video,
        ThreadPoolExecutor(1) as encoder,
    ):
        for k, now_s in enumerate(time_s):
            scene.paint(canvases[k % 2], now_s)
            if retouch:
                retouch(k, canvases[k % 2])
            if pending:
                pending.result()
            pending = encoder.submit(video.write, canvases[k % 2])
            if progress:
                progress(k + 1, len(time_s))
        if pending:
            pending.result()
    return time_s


class _Scene:
    """What stays the same from picture to picture: rays, backdrop, light, noise; and the drawing of one picture."""

    def __init__(
        self,
        camera: Camera,
        board: Board,
        tip: Motion,
        time_s: Floats,
        exposure_s: float,
        rng: np.random.Generator,
        noise_sigma: float,
        line_s: float,
    ) -> None:
        assert camera.world_from_camera is not None
        self.lens, self.board, self.tip, self.exposure_s, self.rng = camera.lens, board, tip, exposure_s, rng
        self.line_s = line_s
        self.camera_from_world = np.linalg.inv(camera.world_from_camera)
        self.offset_m = camera.tip_offset_m
        about_x, about_z = camera.board_turn_rad
        mounted = np.column_stack(_MOUNTED[camera.mount])
        self.glued = Rotation.from_rotvec((about_x, 0.0, about_z)).as_matrix() @ mounted
        self.outline = _outline(board)
        late_s = line_s * camera.lens.height
        ends_s = np.concatenate((time_s - exposure_s / 2, time_s + late_s + exposure_s / 2))
        outlines = np.array([self._pixels(to_camera) for to_camera in self._board_to_camera(ends_s)]).reshape(-1, 2)
        if not np.all(np.isfinite(outlines)):
            raise TrackingError(
                "paint_video: tip gives a pose that is not finite within the duration; correct the motion"
            )
        self.box = self._around(outlines, _PAD_PX)
        left, top, right, bottom = self.box
        self.rays = np.empty((max(bottom - top, 0), max(right - left, 0), SAMPLES**2, 2), np.float32)
        f, c = np.array((self.lens.fx, self.lens.fy)), np.array((self.lens.cx, self.lens.cy))
        rays_of_box(left, top, right - left, bottom - top, f, c, np.array(self.lens.distortion), self.rays)
        self.light, self.backdrop = _surroundings(self.lens.width, self.lens.height, rng)
        # Noise is made once, larger than the picture, and added at a random shift: independent enough, 50 times
        # cheaper.
        shape = (2, self.lens.height + 256, self.lens.width + 256)
        self.noise = np.clip(np.round(rng.normal(0, noise_sigma, shape)), -127, 127).astype(np.int8)

    def paint(self, canvas: NDArray[np.uint8], now_s: float) -> None:
        """Paint the picture whose first row is exposed around ``now_s``."""
        ends = self._board_to_camera(
            now_s + np.array((-self.exposure_s / 2, self.exposure_s / 2 + self.line_s * self.lens.height))
        )
        area = self._around(np.concatenate([self._pixels(to_camera) for to_camera in ends]), _PAD_PX)
        area = np.concatenate((np.maximum(area[:2], self.box[:2]), np.minimum(area[2:], self.box[2:])))
        rows = area[1] + NODE_ROWS * np.arange(max(area[3] - area[1], 0) // NODE_ROWS + 2)
        middle_s = now_s + self.line_s * rows[len(rows) // 2]
        swept = self._board_to_camera(middle_s + self.exposure_s * np.array((-0.5, 0.5)))
        outline = np.array([self._pixels(to_camera) for to_camera in swept])
        travel_px = float(np.abs(outline[1] - outline[0]).max())
        steps = min(max(math.ceil(travel_px / _BLUR_STEP_PX), 1), _MOST_STEPS)
        moments = self.exposure_s * ((np.arange(steps) + 0.5) / steps - 0.5) + (now_s + self.line_s * rows)[:, None]
        boards = self._board_to_camera(moments.ravel()).reshape(len(rows), steps, 3, 3)
        down, across = self.rng.integers(0, 256, 2)
        noise = self.noise[self.rng.integers(2), down : down + canvas.shape[0], across : across + canvas.shape[1]]
        ink = self._ink(self.board, boards[0, 0, 2, 2])
        cv2.add(self.backdrop, noise, dst=canvas, dtype=cv2.CV_8U)  # saturates
        paint(canvas, self.backdrop, self.light, noise, self.rays, self.box, area, np.linalg.inv(boards), ink)

    def lay(self, board: Board, world_from_board: Floats) -> None:
        """Paint another board, at rest, into the backdrop."""
        placed = self.camera_from_world @ world_from_board
        to_camera = placed[:3, (0, 1, 3)]
        area = self._around(self._pixels(to_camera, _outline(board)), _PAD_PX)
        left, top, right, bottom = area
        rays = np.empty((max(bottom - top, 0), max(right - left, 0), SAMPLES**2, 2), np.float32)
        f, c = np.array((self.lens.fx, self.lens.fy)), np.array((self.lens.cx, self.lens.cy))
        rays_of_box(left, top, right - left, bottom - top, f, c, np.array(self.lens.distortion), rays)
        still = np.broadcast_to(np.linalg.inv(to_camera), ((bottom - top) // NODE_ROWS + 2, 1, 3, 3)).copy()
        canvas, calm = self.backdrop.copy(), np.zeros(self.backdrop.shape, np.int8)
        paint(canvas, self.backdrop, self.light, calm, rays, area, area, still, self._ink(board, placed[2, 3]))
        self.backdrop = canvas

    def _ink(self, board: Board, depth_m: float) -> Floats:
        edge_m = _EDGE_PX * depth_m / self.lens.fx
        return np.array((board.squares, board.size_m, board.pitch_m / 2, edge_m, DARK, LIGHT))

    def _board_to_camera(self, time_s: Floats) -> Floats:
        """Return (k, 3, 3): (u, v, 1) on the board to a camera-frame point; columns are the board's x, y and centre."""
        x, z, phi = (np.broadcast_to(np.asarray(value, np.float64), time_s.shape) for value in self.tip(time_s))
        sin, cos, zero = np.sin(phi), np.cos(phi), np.zeros_like(phi)
        axis = np.stack((sin, zero, cos), axis=-1)
        tip = np.stack((np.stack((cos, zero, -sin), axis=-1), np.stack((zero, zero + 1, zero), axis=-1), axis), axis=-1)
        u_axis, v_axis = tip @ self.glued[:, 0], tip @ self.glued[:, 1]
        centre = np.stack((x, zero, z), axis=-1) + self.offset_m * axis
        turn, shift = self.camera_from_world[:3, :3], self.camera_from_world[:3, 3]
        return np.stack((u_axis @ turn.T, v_axis @ turn.T, centre @ turn.T + shift), axis=-1)

    def _pixels(self, to_camera: Floats, outline: Floats | None = None) -> Floats:
        """Return where a board's outline (4, 2) falls: theta from the axis, then the polynomial."""
        x, y, z = to_camera @ (self.outline if outline is None else outline).T
        theta = np.arctan2(np.hypot(x, y), z)
        powers = theta[:, None] ** np.array((3, 5, 7, 9))
        bent = (theta + powers @ np.array(self.lens.distortion)) / np.hypot(x, y)
        return np.column_stack((self.lens.fx * bent * x + self.lens.cx, self.lens.fy * bent * y + self.lens.cy))

    def _around(self, pixels: Floats, pad: int) -> NDArray[np.int64]:
        """Return left, top, right, bottom of the pixels' box, padded, within the picture."""
        low, high = np.floor(pixels.min(axis=0)) - pad, np.ceil(pixels.max(axis=0)) + pad + 1
        size = np.array((self.lens.width, self.lens.height))
        return np.concatenate((np.clip(low, 0, size), np.clip(high, 0, size))).astype(np.int64)


def _outline(board: Board) -> Floats:
    """Return the corners (4, 3) of a board's paper as (u, v, 1)."""
    reach = board.size_m / 2 + board.pitch_m / 2
    return np.array([(u, v, 1.0) for u in (-reach, reach) for v in (-reach, reach)])


def _surroundings(width: int, height: int, rng: np.random.Generator) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return the light on the scene (about 1, falling off) and a backdrop of clutter (both height, width)."""
    v, u = np.mgrid[0:height, 0:width].astype(np.float32)
    across, down = u / width - 0.5, v / height - 0.5
    light = (1 + 0.15 * across - 0.1 * down) / (1 + 0.5 * (across**2 + down**2)) ** 2
    grey = np.full((height, width), 105, np.float32) + 12 * np.sin(9 * across + 4 * down)
    for _ in range(25):  # boxes, edges of shelves, a cable: straight edges that may mislead a detector
        left, top = rng.integers(0, width), rng.integers(0, height)
        wide, high = rng.integers(10, width // 5), rng.integers(10, height // 4)
        grey[top : top + high, left : left + wide] = rng.uniform(30, 190)
    for _ in range(8):  # bottles, screw heads
        x, y, radius = rng.integers(0, width), rng.integers(0, height), rng.integers(8, height // 8)
        grey[(u - x) ** 2 + (v - y) ** 2 < radius**2] = rng.uniform(30, 190)
    return light.astype(np.float32), np.clip(grey * light, 0, 255).astype(np.uint8)
