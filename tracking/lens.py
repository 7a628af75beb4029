"""Lens: where a ray meets the sensor and where a pixel looks, for OpenCV's fisheye and Brown-Conrady models."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from straw.tracking.errors import TrackingError
from straw.tracking.fields import Fields
from straw.tracking.kernels import distort_all, undistort_all

Floats = NDArray[np.float64]

COEFFICIENTS = {"fisheye": (4,), "brown_conrady": (4, 5)}  # (k1..k4) and (k1, k2, p1, p2[, k3]), OpenCV's order


@dataclass(frozen=True)
class Lens:
    """Intrinsics of one camera in one mode.

    Camera frame as OpenCV's: x right, y down, z forward; pixel (0, 0) is the centre of the top left pixel.
    ``fisheye`` is Kannala & Brandt, IEEE TPAMI 28 (2006) 1335, as in cv2.fisheye; ``brown_conrady`` is Brown,
    Photogrammetric Engineering 37 (1971) 855, as in cv2.projectPoints.
    """

    kind: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...]
    name: str = ""
    source: str = ""
    rms_px: float | None = None

    def __post_init__(self) -> None:
        label = f"lens '{self.name}'" if self.name else "lens"
        if self.kind not in COEFFICIENTS:
            raise TrackingError(f"{label}: kind is '{self.kind}'; it must be one of {', '.join(COEFFICIENTS)}")
        if len(self.distortion) not in COEFFICIENTS[self.kind]:
            wanted = " or ".join(map(str, COEFFICIENTS[self.kind]))
            raise TrackingError(f"{label}: {len(self.distortion)} distortion numbers; {self.kind} takes {wanted}")
        if not (1 <= self.width <= 100_000 and 1 <= self.height <= 100_000):
            raise TrackingError(f"{label}: width x height is {self.width}x{self.height}; give the picture's size in px")
        if not all(map(math.isfinite, (self.fx, self.fy, self.cx, self.cy, *self.distortion))):
            raise TrackingError(f"{label}: fx, fy, cx, cy and distortion must be finite numbers; calibrate again")
        if self.fx <= 0 or self.fy <= 0:
            raise TrackingError(f"{label}: fx, fy are {self.fx:g}, {self.fy:g}; focal lengths in px are positive")
        if not (0 <= self.cx < self.width and 0 <= self.cy < self.height):
            raise TrackingError(
                f"{label}: centre ({self.cx:g}, {self.cy:g}) lies off the {self.width}x{self.height} picture"
            )

    def project(self, points_m: ArrayLike) -> Floats:
        """Project camera-frame points (n, 3) to pixels (n, 2); NaN for points not in front of the camera."""
        return self.project_with_jacobian(points_m)[0]

    def project_with_jacobian(self, points_m: ArrayLike) -> tuple[Floats, Floats]:
        """Project camera-frame points (n, 3): pixels (n, 2) and d pixel / d point (n, 2, 3) in px/m."""
        x, y, z = np.asarray(points_m, dtype=np.float64).T
        z = np.where(z > 0, z, np.nan)
        a, b = x / z, y / z
        ad, bd, aa, ab, ba, bb = self._distort(a, b)
        jacobian = np.empty((len(z), 2, 3))
        jacobian[:, 0, 0], jacobian[:, 0, 1] = self.fx * aa / z, self.fx * ab / z
        jacobian[:, 1, 0], jacobian[:, 1, 1] = self.fy * ba / z, self.fy * bb / z
        jacobian[:, :, 2] = -(jacobian[:, :, 0].T * a + jacobian[:, :, 1].T * b).T
        return np.column_stack((self.fx * ad + self.cx, self.fy * bd + self.cy)), jacobian

    def rays(self, pixels: ArrayLike) -> Floats:
        """Undistort pixels (n, 2) to normalised rays (x/z, y/z) (n, 2); NaN where the model has no inverse."""
        wanted = np.ascontiguousarray(pixels, dtype=np.float64)
        out = np.empty_like(wanted)
        undistort_all(wanted, self.packed, out)
        return out

    def rays_with_slopes(self, pixels: ArrayLike) -> tuple[Floats, Floats]:
        """Undistort pixels (n, 2): rays (n, 2) as ``rays`` says, and d pixel / d ray (n, 2, 2) there."""
        rays = self.rays(pixels)
        slopes = self._distort(rays[:, 0], rays[:, 1])[2:].T.reshape(-1, 2, 2)
        return rays, slopes * np.array(((self.fx,), (self.fy,)))

    @cached_property
    def packed(self) -> Floats:
        """The lens as the compiled loops take it: 1 for fisheye, fx, fy, cx, cy, five coefficients."""
        numbers = (float(self.kind == "fisheye"), self.fx, self.fy, self.cx, self.cy, *self.distortion, 0.0, 0.0)
        return np.array(numbers[:10])

    def _distort(self, a: Floats, b: Floats) -> Floats:
        """Distort normalised points (n,): a', b' and the four derivatives da'/da, da'/db, db'/da, db'/db, (6, n)."""
        out = np.empty((6, len(a)))
        distort_all(np.ascontiguousarray(a), np.ascontiguousarray(b), self.packed, out)
        return out

    def to_json(self) -> dict[str, Any]:
        """Return the ``lens`` object of a CAMERA.json."""
        names = ("kind", "width", "height", "fx", "fy", "cx", "cy", "name", "source", "rms_px")
        return {**{name: getattr(self, name) for name in names}, "distortion": list(self.distortion)}


def lens_from_fields(fields: Fields) -> Lens:
    """Read a lens from a CAMERA.json's ``lens`` object or from a gyroflow lens profile."""
    if "fisheye_params" in fields:
        return _from_gyroflow(fields)
    return Lens(
        kind=fields.text("kind"),
        width=fields.integer("width"),
        height=fields.integer("height"),
        fx=fields.number("fx"),
        fy=fields.number("fy"),
        cx=fields.number("cx"),
        cy=fields.number("cy"),
        distortion=fields.numbers("distortion"),
        name=fields.text("name", ""),
        source=fields.text("source", ""),
        rms_px=fields.number("rms_px") if "rms_px" in fields else None,
    )


def _from_gyroflow(fields: Fields) -> Lens:
    """Read a profile of github.com/gyroflow/lens_profiles, whose ``fisheye_params`` are cv2.fisheye's K and D."""
    if fields.data.get("distortion_model") not in (None, "opencv_fisheye"):
        fields.wrong("distortion_model", "absent or 'opencv_fisheye', the only supported model")
    if fields.number("input_horizontal_stretch", 1.0) != 1.0 or fields.number("input_vertical_stretch", 1.0) != 1.0:
        fields.wrong(
            "input_horizontal_stretch", "1 in both directions: stretched (anamorphic) profiles are not supported"
        )
    size, params = fields.child("calib_dimension"), fields.child("fisheye_params")
    (fx, _, cx), (_, fy, cy), _ = params.matrix("camera_matrix", 3)
    return Lens(
        kind="fisheye",
        width=size.integer("w"),
        height=size.integer("h"),
        fx=fx,
        fy=fy,
        cx=cx,
        cy=cy,
        distortion=params.numbers("distortion_coeffs", 4),
        name=fields.text("name", ""),
        source="gyroflow lens profile",
        rms_px=params.number("RMS_error") if "RMS_error" in params else None,
    )


def load_lens(path: str | os.PathLike[str]) -> Lens:
    """Load a lens from a CAMERA.json or a gyroflow lens profile; TrackingError when it is neither."""
    fields = Fields.load(path)
    return lens_from_fields(fields.child("lens") if "fisheye_params" not in fields else fields)


def shipped_lens(name: str) -> Lens:
    """Return a lens that ships with this package; see ``tracking/lenses/SOURCES.md``."""
    folder = files("straw.tracking") / "lenses"
    known = sorted(entry.name.removesuffix(".json") for entry in folder.iterdir() if entry.name.endswith(".json"))
    if name not in known:
        raise TrackingError(f"lens '{name}' is not shipped; shipped are: {', '.join(known)}; or give a CAMERA.json")
    return lens_from_fields(Fields.parse((folder / f"{name}.json").read_text(encoding="utf-8"), f"lens '{name}'"))
