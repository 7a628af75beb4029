"""Messages that viewers draw without configuration: the camera and the corners in its pictures, in Foxglove's schemas.

Field names are those of github.com/foxglove/schemas (MIT); viewers find them by the descriptor that is in the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from straw.rig.schema import message_class

CALIBRATION, ANNOTATIONS = "foxglove.CameraCalibration", "foxglove.ImageAnnotations"
ANNOTATION = "foxglove.PointsAnnotation"

# Message: (name, number, type) with "*" for repeated ones; other messages by their name.
_MESSAGES = {
    "Point2": (("x", 1, "double"), ("y", 2, "double")),
    "Color": (("r", 1, "double"), ("g", 2, "double"), ("b", 3, "double"), ("a", 4, "double")),
    "PointsAnnotation": (
        ("timestamp", 1, "google.protobuf.Timestamp"),
        ("type", 2, "int32"),
        ("points", 3, "*foxglove.Point2"),
        ("outline_color", 4, "foxglove.Color"),
        ("thickness", 7, "double"),
    ),
    "ImageAnnotations": (("points", 2, "*foxglove.PointsAnnotation"),),
    "CameraCalibration": (
        ("timestamp", 1, "google.protobuf.Timestamp"),
        ("frame_id", 9, "string"),
        ("width", 2, "fixed32"),
        ("height", 3, "fixed32"),
        ("distortion_model", 4, "string"),
        ("D", 5, "*double"),
        ("K", 6, "*double"),
        ("R", 7, "*double"),
        ("P", 8, "*double"),
    ),
}
_POINTS = 1  # PointsAnnotation.type: dots
_POINT = np.dtype([("head", "u1", 3), ("x", "<f8"), ("tag", "u1"), ("y", "<f8")])
_SEEN, _COVERED = (0.1, 0.8, 0.2, 1.0), (0.9, 0.2, 0.1, 1.0)


@cache
def descriptors() -> bytes:
    """Serialized FileDescriptorSet of all messages here."""
    from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
    from google.protobuf.timestamp_pb2 import DESCRIPTOR

    file = FileDescriptorProto(name="foxglove.proto", package="foxglove", syntax="proto3")
    file.dependency.append(DESCRIPTOR.name)
    for name, fields in _MESSAGES.items():
        message = file.message_type.add(name=name)
        for field, number, kind in fields:
            many, kind = kind.startswith("*"), kind.lstrip("*")
            made = message.field.add(
                name=field,
                number=number,
                label=FieldDescriptorProto.LABEL_REPEATED if many else FieldDescriptorProto.LABEL_OPTIONAL,
            )
            if "." in kind:
                made.type, made.type_name = FieldDescriptorProto.TYPE_MESSAGE, f".{kind}"
            else:
                made.type = getattr(FieldDescriptorProto, f"TYPE_{kind.upper()}")
    own = FileDescriptorProto()
    DESCRIPTOR.CopyToProto(own)
    return FileDescriptorSet(file=[own, file]).SerializeToString()


def calibration(
    happened_ns: int, size: tuple[int, int], model: str, coefficients: Sequence[float], matrix: NDArray[np.float64]
) -> bytes:
    """A camera's intrinsics: picture size, distortion model and coefficients, camera matrix (3, 3)."""
    message = _message(CALIBRATION)(
        timestamp=_stamp(happened_ns),
        frame_id="camera",
        width=size[0],
        height=size[1],
        distortion_model=model,
        D=list(coefficients),
        K=matrix.ravel().tolist(),
        R=np.eye(3).ravel().tolist(),
        P=np.column_stack((matrix, np.zeros(3))).ravel().tolist(),
    )
    return bytes(message.SerializeToString())


def dots(happened_ns: int, pixels: NDArray[np.float64], used: NDArray[np.bool_]) -> bytes:
    """Corners (n, 2) px on a picture: green where used (n,), red where not."""
    found = b""
    head = _message(ANNOTATION)(timestamp=_stamp(happened_ns), type=_POINTS).SerializeToString()
    seen = np.count_nonzero(used)
    for count, which, color in ((seen, used, _SEEN), (len(used) - seen, ~used, _COVERED)):
        if count:
            one = head + _points(pixels if count == len(used) else pixels[which]) + _look(color)
            found += b"\x12" + _varint(len(one)) + one  # field 2 of the annotations of a picture
    return found


def _points(pixels: NDArray[np.float64]) -> bytes:
    """Field 3 of an annotation for each of n points (n, 2), as protobuf writes it, at once: there are fifty a frame."""
    made = _blank(len(pixels)).copy()
    # The origin is the corner of the first pixel there, its middle here.
    made["x"], made["y"] = (pixels + 0.5).T
    return made.tobytes()


@cache
def _blank(count: int) -> NDArray[np.void]:
    made = np.zeros(count, _POINT)
    made["head"], made["tag"] = (0x1A, 18, 0x09), 0x11  # field, its length, x; y
    return made


@cache
def _look(color: tuple[float, ...]) -> bytes:
    outline = dict(zip("rgba", color, strict=True))
    return bytes(_message(ANNOTATION)(outline_color=outline, thickness=3.0).SerializeToString())


def _varint(number: int) -> bytes:
    """A number as protobuf writes lengths: seven bits a byte, the lowest first."""
    found = bytearray()
    while number > 0x7F:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes((*found, number))


def _message(name: str) -> Any:
    return message_class(name, descriptors())


def _stamp(happened_ns: int) -> dict[str, int]:
    return {"seconds": happened_ns // 10**9, "nanos": happened_ns % 10**9}
