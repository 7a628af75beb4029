"""Camera: a lens, where it stands in the world, and how the board sits on the tip; the CAMERA.json below it."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from straw.tracking.errors import TrackingError
from straw.tracking.fields import Fields, write_json
from straw.tracking.lens import Lens, lens_from_fields

Floats = NDArray[np.float64]

# Where the board's axes lie in the tip frame (columns x, y, z): its face along the tip axis (the camera looks end-on),
# or in the plane of motion, towards -Y ("side") or +Y ("back").
MOUNTS = {
    "face": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "side": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "back": ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
}
IMAGE_DIRECTIONS = {"down": (0.0, 1.0), "up": (0.0, -1.0), "right": (1.0, 0.0), "left": (-1.0, 0.0)}
_FORMAT = "straw-camera"
_VERSION = 1
_ORTHONORMAL = 1e-6  # a rotation typed with 7 digits passes, a scaled or mirrored one does not


@dataclass(frozen=True)
class Camera:
    """One camera in one set-up.

    ``world_from_camera``: 4x4 rigid transform (camera frame OpenCV: x right, y down, z forward; world: X, Z the plane
    of motion, Y = Z x X); None when it is to be found from a rest pose. ``tip_offset_m``: board centre to tip along the
    tip axis, so tip = board centre - offset * axis. ``board_x_in_image``: where board +x points in the picture at
    rest, the one sign that no picture of the board shows (see ``Board``); "down" for an upright camera and a
    horizontal straw. ``board_turn_rad``: how far from square the board is glued, as the x and z components of a
    rotation vector in the tip frame (about y it would be a part of phi); found from the motion where it is not known.
    ``mount``: which way the board is glued to the tip (see ``MOUNTS``). ``line_s``: seconds from one row of the sensor
    to the next (rolling shutter); None when it is to be found from the video.
    """

    lens: Lens
    world_from_camera: Floats | None = None
    tip_offset_m: float = 0.0088
    board_x_in_image: str = "down"
    board_turn_rad: tuple[float, float] = (0.0, 0.0)
    mount: str = "face"
    line_s: float | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.tip_offset_m) and abs(self.tip_offset_m) < 1):
            raise TrackingError(f"camera: tip_offset_m is {self.tip_offset_m:g}; give it in metres, as 0.0088")
        if not all(math.isfinite(turn) and abs(turn) < 0.5 for turn in self.board_turn_rad):
            raise TrackingError(f"camera: board_turn_rad is {self.board_turn_rad}; give two small angles in rad")
        if self.board_x_in_image not in IMAGE_DIRECTIONS:
            known = ", ".join(IMAGE_DIRECTIONS)
            raise TrackingError(f"camera: board_x_in_image is '{self.board_x_in_image}'; it must be one of {known}")
        if self.mount not in MOUNTS:
            raise TrackingError(f"camera: mount is '{self.mount}'; it must be one of {', '.join(MOUNTS)}")
        if self.line_s is not None and not (math.isfinite(self.line_s) and abs(self.line_s) < 1e-3):
            raise TrackingError(f"camera: line_s is {self.line_s:g}; give the seconds from row to row, as 3.8e-6")
        if self.world_from_camera is not None:
            pose = np.array(self.world_from_camera, dtype=np.float64)
            check_rigid(pose, "camera: world_from_camera")
            pose.flags.writeable = False  # read-only, as the class is frozen
            object.__setattr__(self, "world_from_camera", pose)

    @property
    def image_x(self) -> Floats:
        """Where board +x points in the picture at rest, as a unit vector (2) in px."""
        return np.array(IMAGE_DIRECTIONS[self.board_x_in_image])

    @property
    def tip_from_board(self) -> Floats:
        """The 4x4 from board frame to tip frame: origin at the tip, z along the tip axis, y along the world's Y."""
        about_x, about_z = self.board_turn_rad
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_rotvec((about_x, 0.0, about_z)).as_matrix() @ np.array(MOUNTS[self.mount])
        pose[2, 3] = self.tip_offset_m
        return pose


def check_rigid(pose: Floats, where: str) -> None:
    """Raise TrackingError unless ``pose`` is a 4x4 rigid transform."""
    if pose.shape != (4, 4) or not np.all(np.isfinite(pose)):
        raise TrackingError(f"{where}: shape {pose.shape}; it must be 4 rows of 4 finite numbers")
    rotation = pose[:3, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=_ORTHONORMAL) or np.linalg.det(rotation) < 0:
        raise TrackingError(f"{where}: its upper left 3x3 is not a rotation; take it from the file that measured it")
    if not np.allclose(pose[3], (0, 0, 0, 1), atol=1e-12):
        raise TrackingError(f"{where}: its last row is {pose[3].tolist()}; it must be [0, 0, 0, 1]")


def save_camera(path: str | os.PathLike[str], camera: Camera) -> None:
    """Write CAMERA.json (atomically); TrackingError when the place cannot be written."""
    write_json(path, _as_data(camera))


def camera_json(camera: Camera) -> str:
    """The text of a CAMERA.json."""
    return json.dumps(_as_data(camera), indent=2)


def _as_data(camera: Camera) -> dict[str, Any]:
    data: dict[str, Any] = {
        "format": _FORMAT,
        "version": _VERSION,
        "lens": camera.lens.to_json(),
        "tip_offset_m": camera.tip_offset_m,
        "board_x_in_image": camera.board_x_in_image,
        "board_turn_rad": list(camera.board_turn_rad),
        "mount": camera.mount,
    }
    if camera.line_s is not None:
        data["line_s"] = camera.line_s
    if camera.world_from_camera is not None:
        data["world_from_camera"] = camera.world_from_camera.tolist()
    return data


def load_camera(path: str | os.PathLike[str]) -> Camera:
    """Read CAMERA.json, or a gyroflow lens profile (then only the lens is known); TrackingError when malformed."""
    fields = Fields.load(path)
    if "fisheye_params" in fields:
        return Camera(lens_from_fields(fields))
    if fields.data.get("format") != _FORMAT:
        fields.wrong("format", f"'{_FORMAT}' (or give a gyroflow lens profile)")
    if fields.integer("version") != _VERSION:
        fields.wrong("version", f"{_VERSION}, the only one this program knows: update it, or calibrate again")
    about_x, about_z = fields.numbers("board_turn_rad", 2) if "board_turn_rad" in fields else Camera.board_turn_rad
    try:
        return Camera(
            lens=lens_from_fields(fields.child("lens")),
            world_from_camera=np.array(fields.matrix("world_from_camera", 4))
            if "world_from_camera" in fields
            else None,
            tip_offset_m=fields.number("tip_offset_m", Camera.tip_offset_m),
            board_x_in_image=fields.text("board_x_in_image", Camera.board_x_in_image),
            board_turn_rad=(about_x, about_z),
            mount=fields.text("mount", Camera.mount),
            line_s=fields.number("line_s") if "line_s" in fields else None,
        )
    except TrackingError as error:  # each value is valid but together they are no camera: name the file
        message = str(error)
        raise TrackingError(message if message.startswith(str(path)) else f"{path}: {message}") from error
